//! A stochastic policy over the allowed actions.

use gleaner_units::{Action, ActionMask};

/// Number of actions.
pub(crate) const ACTIONS: usize = Action::COUNT;

/// A categorical distribution over the actions, zero outside the mask.
#[derive(Clone, Copy, Debug)]
pub struct Distribution {
    /// pi(a); zero outside the mask.
    pub probability: [f32; ACTIONS],
    /// ln pi(a); zero outside the mask, where it has no meaning.
    pub log_probability: [f32; ACTIONS],
}

impl Distribution {
    /// Softmax of the allowed logits. An empty mask counts as full: it occurs only after the end of a flight.
    #[must_use]
    pub fn new(logits: &[f32; ACTIONS], mask: ActionMask) -> Distribution {
        let mask = if mask.is_empty() { ActionMask::FULL } else { mask };
        let highest = mask.iter().map(|action| logits[action.index()]).fold(f32::NEG_INFINITY, f32::max);
        let mut distribution = Distribution { probability: [0.0; ACTIONS], log_probability: [0.0; ACTIONS] };
        let sum: f32 = mask.iter().map(|action| (logits[action.index()] - highest).exp()).sum();
        for action in mask.iter().map(Action::index) {
            distribution.log_probability[action] = logits[action] - highest - sum.ln();
            distribution.probability[action] = distribution.log_probability[action].exp();
        }
        distribution
    }

    /// Softmax of the allowed logits at temperature `heat` (paper, eq. 20).
    #[must_use]
    pub fn heated(logits: &[f32; ACTIONS], heat: f32, mask: ActionMask) -> Distribution {
        Distribution::new(&logits.map(|logit| logit / heat), mask)
    }

    /// A label from the utilities of the actions: [`Distribution::heated`], in which no action is more probable than `advice`.
    #[must_use]
    pub fn label(mut utilities: [f32; ACTIONS], heat: f32, advice: Action, mask: ActionMask) -> Distribution {
        utilities[advice.index()] = utilities.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        Distribution::heated(&utilities, heat, mask)
    }

    /// The best allowed action with probability `1 - epsilon`, else a uniform allowed one.
    #[must_use]
    pub fn epsilon_greedy(epsilon: f32, scores: &[f32; ACTIONS], mask: ActionMask) -> Distribution {
        let mut distribution = Distribution::new(&[0.0; ACTIONS], mask);
        let Some(best) = mask.argmax(scores) else { return distribution };
        for (action, probability) in distribution.probability.iter_mut().enumerate() {
            *probability *= epsilon;
            *probability += if action == best.index() { 1.0 - epsilon } else { 0.0 };
        }
        distribution.log_probability = distribution.probability.map(|p| if p > 0.0 { p.ln() } else { 0.0 });
        distribution
    }

    /// sum_a pi(a) f(a).
    pub fn expectation(&self, value: impl Fn(usize) -> f32) -> f32 {
        (0..ACTIONS)
            .filter(|&action| self.probability[action] > 0.0)
            .map(|action| self.probability[action] * value(action))
            .sum()
    }

    /// Entropy, nats.
    #[must_use]
    pub fn entropy(&self) -> f32 {
        -self.expectation(|action| self.log_probability[action])
    }

    /// Inverse of the cumulative distribution at `unit` in `0..1`: a sample if `unit` is uniform.
    #[must_use]
    pub fn sample(&self, unit: f32) -> Action {
        let mut left = unit;
        let mut last = Action::Hover;
        for action in Action::ALL {
            let probability = self.probability[action.index()];
            if probability > 0.0 {
                last = action;
                left -= probability;
                if left < 0.0 {
                    break;
                }
            }
        }
        last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forbidden_actions_have_no_probability() {
        let mask = ActionMask::EMPTY.with(Action::Hover).with(Action::East);
        let policy = Distribution::new(&[1.0, 50.0, 50.0, 50.0, 1.0], mask);
        assert_eq!(policy.probability, [0.5, 0.0, 0.0, 0.0, 0.5]);
        assert!((policy.entropy() - 2.0f32.ln()).abs() < 1e-6);
        assert_eq!(policy.sample(0.2), Action::Hover);
        assert_eq!(policy.sample(0.7), Action::East);
        assert_eq!(policy.sample(1.0), Action::East);
    }

    #[test]
    fn epsilon_greedy_takes_allowed_actions_only() {
        let mask = ActionMask::EMPTY.with(Action::Hover).with(Action::East);
        let policy = Distribution::epsilon_greedy(0.5, &[1.0, 50.0, 50.0, 50.0, 2.0], mask);
        assert_eq!(policy.probability, [0.25, 0.0, 0.0, 0.0, 0.75]);
        let greedy = Distribution::epsilon_greedy(0.0, &[1.0, 50.0, 50.0, 50.0, 2.0], mask);
        assert_eq!(greedy.probability, [0.0, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!(greedy.log_probability, [0.0; ACTIONS]);
    }

    #[test]
    fn huge_logits_stay_finite() {
        let policy = Distribution::new(&[1e30, -1e30, 0.0, 0.0, 0.0], ActionMask::FULL);
        assert_eq!(policy.probability[0], 1.0);
        assert!(policy.entropy().is_finite());
    }
}
