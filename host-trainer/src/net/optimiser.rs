//! Updates of parameters: Adam, and the Polyak average of target networks.

use super::lanes::{multiply_add, vectorised};

/// Adam (Kingma and Ba 2015) as in PyTorch, without weight decay.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Adam {
    /// First moment of each parameter's gradient.
    pub m: Vec<f32>,
    /// Second moment of each parameter's gradient.
    pub v: Vec<f32>,
    /// Steps taken.
    pub step: u64,
    /// Learning rate.
    pub lr: f32,
    /// Decay of the first moments.
    pub beta1: f32,
    /// Decay of the second moments.
    pub beta2: f32,
    /// Added to the root of the second moment.
    pub epsilon: f32,
}

impl Adam {
    /// Adam for `count` parameters, with the decays 0.9 and 0.999 of the paper.
    #[must_use]
    pub fn new(count: usize, lr: f32) -> Self {
        Self {
            m: vec![0.0; count],
            v: vec![0.0; count],
            step: 0,
            lr,
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-8,
        }
    }

    /// One descent step.
    ///
    /// # Panics
    /// When the lengths differ.
    pub fn step(&mut self, parameters: &mut [f32], gradients: &[f32]) {
        assert!(parameters.len() == self.m.len() && gradients.len() == self.m.len());
        self.step += 1;
        let correction = |beta: f32| 1.0 - f64::from(beta).powf(self.step as f64);
        let rates = Rates {
            beta1: self.beta1,
            beta2: self.beta2,
            epsilon: self.epsilon,
            step_size: (f64::from(self.lr) / correction(self.beta1)) as f32,
            root_scale: (1.0 / correction(self.beta2).sqrt()) as f32,
        };
        step_all(rates, parameters, gradients, &mut self.m, &mut self.v);
    }
}

#[derive(Clone, Copy)]
struct Rates {
    beta1: f32,
    beta2: f32,
    epsilon: f32,
    step_size: f32,
    root_scale: f32,
}

#[inline(always)]
fn step_all_body<const FUSED: bool>(
    rates: Rates,
    parameters: &mut [f32],
    gradients: &[f32],
    m: &mut [f32],
    v: &mut [f32],
) {
    let moments = m.iter_mut().zip(v.iter_mut());
    for ((p, &g), (m, v)) in parameters.iter_mut().zip(gradients).zip(moments) {
        *m = multiply_add::<FUSED>(g - *m, 1.0 - rates.beta1, *m);
        *v = multiply_add::<FUSED>(*v, rates.beta2, (1.0 - rates.beta2) * g * g);
        let root = multiply_add::<FUSED>(v.sqrt(), rates.root_scale, rates.epsilon);
        *p -= rates.step_size * (*m / root);
    }
}

#[inline(always)]
fn follow_body<const FUSED: bool>(target: &mut [f32], source: &[f32], tau: f32) {
    for (t, &s) in target.iter_mut().zip(source) {
        *t = multiply_add::<FUSED>(s - *t, tau, *t);
    }
}

vectorised! {
    fn step_all(
        rates: Rates,
        parameters: &mut [f32],
        gradients: &[f32],
        m: &mut [f32],
        v: &mut [f32],
    ) = step_all_body
}

vectorised! {
    fn follow(target: &mut [f32], source: &[f32], tau: f32) = follow_body
}

/// `target = (1 - tau) target + tau source`.
///
/// # Panics
/// When the lengths differ.
pub fn polyak(target: &mut [f32], source: &[f32], tau: f32) {
    assert_eq!(target.len(), source.len(), "two vectors of one shape");
    follow(target, source, tau);
}
