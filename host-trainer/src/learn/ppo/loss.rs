//! The losses of actor and critic, and their gradient steps.

use crate::env::distribution::{ACTIONS, Distribution};
use crate::learn::ppo::advantage::Target;
use crate::learn::ppo::settings::PpoSettings;
use crate::net::{self, Adam, Batch, Sample, Shape, Workspace};

/// The actor's network with one output: the state value.
pub(super) const fn critic_shape() -> Shape {
    Shape { outputs: 1, ..Shape::critic() }
}

/// Buffers for the passes of one network.
#[derive(Default)]
pub(super) struct Buffers {
    pub batch: Batch,
    pub workspace: Workspace,
}

impl Buffers {
    pub fn pack<'a>(&mut self, samples: impl Iterator<Item = &'a Sample>) {
        self.batch.clear();
        samples.for_each(|sample| self.batch.push_sample(sample));
    }
}

/// The critic's values of these states, utility.
pub(super) fn values(critic: &[f32], buffers: &mut Buffers, samples: &[Sample], scale: f32) -> Vec<f32> {
    buffers.pack(samples.iter());
    let outputs = net::answer(&critic_shape(), critic, &buffers.batch, &mut buffers.workspace);
    outputs.iter().map(|value| value * scale).collect()
}

/// A gradient step of the critic; returns half the mean squared error, scaled.
pub(super) fn step_critic(
    critic: &mut [f32],
    adam: &mut Adam,
    buffers: &mut Buffers,
    targets: &[&Target],
    rate: f32,
    constants: &PpoSettings,
) -> f32 {
    let scale = 1.0 / targets.len() as f32;
    let mut gradients = vec![0.0; critic.len()];
    let mut loss = 0.0;
    buffers.pack(targets.iter().map(|target| &target.sample));
    net::forward_backward(
        &critic_shape(),
        critic,
        &buffers.batch,
        &mut buffers.workspace,
        |range, outputs, gradients| {
            for ((value, gradient), target) in outputs.iter().zip(gradients).zip(&targets[range]) {
                let error = value - target.shaped_return / constants.value_scale;
                loss += 0.5 * scale * error * error;
                *gradient = scale * error;
            }
        },
        &mut gradients,
    );
    clip_norm(&mut gradients, constants.gradient_norm);
    adam.lr = rate;
    adam.step(critic, &gradients);
    loss
}

/// A gradient step of the actor; returns mean entropy and divergence, nats.
pub(super) fn step_actor(
    actor: &mut [f32],
    adam: &mut Adam,
    buffers: &mut Buffers,
    targets: &[&Target],
    rate: f32,
    constants: &PpoSettings,
) -> (f32, f32) {
    let scale = 1.0 / targets.len() as f32;
    let mut gradients = vec![0.0; actor.len()];
    let (mut entropy, mut divergence) = (0.0, 0.0);
    buffers.pack(targets.iter().map(|target| &target.sample));
    net::forward_backward(
        &Shape::actor(),
        actor,
        &buffers.batch,
        &mut buffers.workspace,
        |range, outputs, gradients| {
            let rows = outputs.as_chunks::<ACTIONS>().0.iter().zip(gradients.as_chunks_mut::<ACTIONS>().0);
            for ((logits, gradients), target) in rows.zip(&targets[range]) {
                let (h, kl) = target.gradient(logits, gradients, constants);
                gradients.iter_mut().for_each(|gradient| *gradient *= scale);
                entropy += scale * h;
                divergence += scale * kl;
            }
        },
        &mut gradients,
    );
    clip_norm(&mut gradients, constants.gradient_norm);
    adam.lr = rate;
    adam.step(actor, &gradients);
    (entropy, divergence)
}

impl Target {
    /// The gradient of the clipped objective, the entropy bonus and the unlikelihood with respect to the logits. Returns
    /// entropy and divergence.
    fn gradient(
        &self,
        logits: &[f32; ACTIONS],
        gradient: &mut [f32; ACTIONS],
        constants: &PpoSettings,
    ) -> (f32, f32) {
        let policy = Distribution::new(logits, self.mask);
        let taken = self.action.index();
        let log_ratio = policy.log_probability[taken] - self.log_probability;
        let ratio = log_ratio.exp();
        let weight = if self.is_prompted {
            // Imitation, until the policy is likely enough to explore the action itself.
            let is_unlikely = policy.probability[taken] < constants.prompt_unlikely;
            if is_unlikely { (self.advantage - constants.prompt_advantage).max(0.0) } else { 0.0 }
        } else {
            let clip = constants.clip_range;
            let is_clipped = if self.advantage > 0.0 { ratio > 1.0 + clip } else { ratio < 1.0 - clip };
            if is_clipped { 0.0 } else { self.advantage * ratio }
        };
        let entropy = policy.entropy();
        for (action, gradient) in gradient.iter_mut().enumerate() {
            let p = policy.probability[action];
            let chosen = if action == taken { 1.0 } else { 0.0 };
            *gradient = -weight * (chosen - p)
                + constants.entropy_coefficient * p * (policy.log_probability[action] + entropy);
        }
        self.add_unlikelihood(&policy, gradient, constants.unlikelihood);
        (entropy, if self.is_prompted { 0.0 } else { ratio - 1.0 - log_ratio })
    }

    /// Adds the gradient of `-loss ln(1 - pi(action))` for a move that ended the mission too early (unlikelihood: Welleck
    /// et al. 2020). Unlike a policy gradient it does not vanish where the policy is certain.
    fn add_unlikelihood(&self, policy: &Distribution, gradient: &mut [f32; ACTIONS], weight: f32) {
        let taken = self.action.index();
        let others: f32 =
            (0..ACTIONS).filter(|&other| other != taken).map(|other| policy.probability[other]).sum();
        if self.loss_of_ending <= 0.0 || others <= 0.0 {
            return;
        }
        let push = weight * self.loss_of_ending * policy.probability[taken];
        for (action, gradient) in gradient.iter_mut().enumerate() {
            *gradient += if action == taken { push } else { -push * policy.probability[action] / others };
        }
    }
}

/// Clips the gradient to this Euclidean norm.
fn clip_norm(gradient: &mut [f32], norm_max: f32) {
    let norm = gradient.iter().map(|x| x * x).sum::<f32>().sqrt();
    if norm > norm_max {
        gradient.iter_mut().for_each(|x| *x *= norm_max / norm);
    }
}

#[cfg(test)]
mod tests;
