//! What an engine answers.

use crate::{FIRST_DEVICE_TOKEN, Slots, TOKENS, Tokens};
use gleaner_units::Action;

/// Something that turns tokens into logits: an engine with a model in it.
pub trait Policy {
    /// Why there is no answer.
    type Error;

    /// Evaluates the model. The same tokens give the same answer, whatever was asked before. An engine must
    /// not read a clock, sleep or keep state between calls that changes answers.
    ///
    /// # Errors
    /// The engine failed; the logits are finite otherwise.
    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, Self::Error>;
}

impl<P: Policy> Policy for &mut P {
    type Error = P::Error;

    fn infer(&mut self, tokens: &Tokens) -> Result<Inference, P::Error> {
        (**self).infer(tokens)
    }
}

/// One answer of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Inference {
    /// One per action, in contract order.
    pub logits: [f32; Action::COUNT],
    /// Who looked at whom in the second layer.
    pub attention: Attention,
}

/// Attention of the second layer, mean over the heads: row = query, column = key. Each row of a token that is
/// present sums to one; rows and columns of absent devices are zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Attention(pub [[f32; TOKENS]; TOKENS]);

impl Attention {
    /// Nobody looks at anybody.
    pub const NONE: Attention = Attention([[0.0; TOKENS]; TOKENS]);

    /// How much each token is looked at: the column sums (paper, attention map analysis).
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

    /// The device that is looked at most, as its index in the mission; `None` without devices.
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
    fn the_most_attended_device_is_named_by_its_place_in_the_mission() {
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
