//! Hyper-parameters of the off-policy algorithms that the command line does not set.

/// Values for [`super::run`] and [`super::ddqn`].
pub(super) struct OffPolicyConstants {
    /// Step size of the running average of the policy's parameters, per update: 0.001. The average is what is evaluated
    /// and exported, since single updates are noisy. It does not influence the training. The paper has none.
    pub averaging: f32,
    /// Share of the slots of a guided mission that GREEDY decides: 0.9. The policy explores in the others. The paper has
    /// none.
    pub guided_slots: f64,
    /// Share of random actions of DDQN at the start of the annealing: 1 (uniform exploration, Mnih et al. 2015).
    pub epsilon_start: f32,
    /// Share of random actions of DDQN after the annealing: 0.05 (Mnih et al. 2015 use 0.1).
    pub epsilon_end: f32,
}

/// The values that trained the models of `models/paper`.
pub(super) const CONSTANTS: OffPolicyConstants =
    OffPolicyConstants { averaging: 0.001, guided_slots: 0.9, epsilon_start: 1.0, epsilon_end: 0.05 };
