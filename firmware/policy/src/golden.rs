//! Golden pairs and the self-test: the engine on board reproduces the trained model.

use crate::{Inference, Policy, Tokens};
use core::borrow::Borrow;
use core::fmt;
use gleaner_units::Action;
use serde::{Deserialize, Serialize};

/// Largest difference between a logit and its golden value that rounding explains.
pub const GOLDEN_TOLERANCE: f32 = 1e-4;

/// Tokens and their logits, computed by the trainer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Golden {
    /// The input.
    pub tokens: Tokens,
    /// The output.
    pub logits: [f32; Action::COUNT],
}

/// Why an engine must not fly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SelfTestError {
    /// The model has no golden pair.
    NoGolden,
    /// The engine failed on a pair.
    NoAnswer {
        /// Index of the golden pair.
        pair: usize,
    },
    /// A logit differs by more than [`GOLDEN_TOLERANCE`] or is NaN.
    Differs {
        /// Index of the golden pair.
        pair: usize,
        /// The largest difference in it.
        by: f32,
    },
}

impl fmt::Display for SelfTestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SelfTestError::NoGolden => write!(f, "the model has no golden pair"),
            SelfTestError::NoAnswer { pair } => {
                write!(f, "the engine fails on golden pair {pair}")
            }
            SelfTestError::Differs { pair, by } => {
                write!(f, "golden pair {pair} differs by {by:e}, more than {GOLDEN_TOLERANCE:e}")
            }
        }
    }
}

impl core::error::Error for SelfTestError {}

/// Evaluates every golden pair and compares the logits.
///
/// # Errors
/// The first pair that fails, see [`SelfTestError`].
pub fn self_test<P: Policy>(
    policy: &mut P,
    goldens: impl IntoIterator<Item: Borrow<Golden>>,
) -> Result<(), SelfTestError> {
    let mut compared = false;
    for (pair, golden) in (0..usize::MAX).zip(goldens) {
        let golden = golden.borrow();
        let Inference { logits, .. } =
            policy.infer(&golden.tokens).map_err(|_| SelfTestError::NoAnswer { pair })?;
        let by = largest_difference(&logits, &golden.logits);
        // In this form NaN fails.
        #[expect(clippy::neg_cmp_op_on_partial_ord)]
        if !(by <= GOLDEN_TOLERANCE) {
            return Err(SelfTestError::Differs { pair, by });
        }
        compared = true;
    }
    if compared { Ok(()) } else { Err(SelfTestError::NoGolden) }
}

fn largest_difference(a: &[f32; Action::COUNT], b: &[f32; Action::COUNT]) -> f32 {
    let mut largest = 0.0;
    for (a, b) in a.iter().zip(b) {
        let difference = (a - b).abs();
        if difference.is_nan() {
            return f32::NAN;
        }
        largest = f32::max(largest, difference);
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Attention;

    struct Constant(Option<[f32; 5]>);

    impl Policy for Constant {
        type Error = ();
        fn infer(&mut self, _: &Tokens) -> Result<Inference, ()> {
            self.0.map(|logits| Inference { logits, attention: Attention::NONE }).ok_or(())
        }
    }

    #[test]
    fn self_test_measures_the_difference() {
        let tokens = Tokens {
            uav: [0.0; 4],
            preference: [0.5; 2],
            local_map: heapless::Vec::new(),
            devices: heapless::Vec::new(),
        };
        let golden = [Golden { tokens, logits: [1.0, 2.0, 3.0, 4.0, 5.0] }];
        let verdict = |answer| self_test(&mut Constant(answer), &golden);
        assert_eq!(verdict(Some([1.0, 2.0, 3.0, 4.0, 5.00005])), Ok(()));
        assert_eq!(
            verdict(Some([1.0, 2.5, 3.0, 4.0, 5.1])),
            Err(SelfTestError::Differs { pair: 0, by: 0.5 })
        );
        assert!(matches!(verdict(Some([f32::NAN; 5])), Err(SelfTestError::Differs { pair: 0, .. })));
        assert_eq!(verdict(None), Err(SelfTestError::NoAnswer { pair: 0 }));
        assert_eq!(self_test(&mut Constant(None), [] as [Golden; 0]), Err(SelfTestError::NoGolden));
    }
}
