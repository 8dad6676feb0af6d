//! Engines and their outputs.

use crate::{FIRST_DEVICE_TOKEN, Slots, TOKENS, Tokens};
use gleaner_units::Action;

/// An engine with a model: it maps tokens to logits.
pub trait Policy {
    /// Why an inference failed.
    type Error;

    /// Evaluates the model. The result depends on the tokens alone: an engine must not read a clock, sleep, or keep state
    /// that changes results.
    ///
    /// # Errors
    /// The engine failed. Otherwise all logits are finite.
    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, Self::Error>;

    /// The logits of [`Policy::infer`] alone. Engines that can skip the attention override it.
    ///
    /// # Errors
    /// As [`Policy::infer`].
    fn logits(&mut self, tokens: &Tokens) -> Result<[f32; Action::COUNT], Self::Error> {
        self.infer(tokens).map(|inference| inference.logits)
    }
}

impl<P: Policy> Policy for &mut P {
    type Error = P::Error;

    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, P::Error> {
        (**self).infer(tokens)
    }

    fn logits(&mut self, tokens: &Tokens) -> Result<[f32; Action::COUNT], P::Error> {
        (**self).logits(tokens)
    }
}

/// The outputs of one inference.
#[derive(Clone, Debug, PartialEq)]
pub struct Inference {
    /// One per action, in contract order.
    pub logits: [f32; Action::COUNT],
    /// Attention weights of the second layer.
    pub attention: Attention,
}

/// Attention weights of the second layer, averaged over the heads: row = query, column = key. The row of each present
/// token sums to one; rows and columns of absent devices are zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Attention(pub [[f32; TOKENS]; TOKENS]);

impl Attention {
    /// All weights zero.
    pub const NONE: Attention = Attention([[0.0; TOKENS]; TOKENS]);

    /// Attention that each token receives: the column sums (paper, attention map analysis).
    #[must_use]
    pub fn received(&self) -> [f32; TOKENS] {
        let mut sums = [0.0; TOKENS];
        for row in &self.0 {
            for (sum, weight) in sums.iter_mut().zip(row) {
                *sum += weight;
            }
        }
        sums
    }

    /// Mission index of the device that receives the most attention; `None` without devices.
    #[must_use]
    pub fn most_attended(&self, slots: &Slots) -> Option<u16> {
        let received = self.received();
        slots
            .iter()
            .zip(received.iter().skip(FIRST_DEVICE_TOKEN))
            .reduce(|best, next| if next.1 > best.1 { next } else { best })
            .map(|(&device, _)| device)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn most_attended_device_is_a_mission_index() {
        let mut attention = Attention::NONE;
        attention.0[0][FIRST_DEVICE_TOKEN] = 0.4;
        attention.0[1][FIRST_DEVICE_TOKEN + 1] = 0.3;
        attention.0[2][FIRST_DEVICE_TOKEN + 1] = 0.3;
        attention.0[2][0] = 0.9;
        let slots = Slots::from_slice(&[7, 20]).unwrap();
        assert_eq!(attention.most_attended(&slots), Some(20));
        assert_eq!(attention.most_attended(&Slots::new()), None);
        assert_eq!(attention.received()[0], 0.9);
    }
}
