//! Hyper-parameters of the refinement.

/// Hyper-parameters that the command line does not set. Where no source is given, the value is from trials on the
/// default city.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PpoSettings {
    /// Flights in parallel: 128.
    pub flights: u64,
    /// Slots that each flight contributes to one update: 32.
    pub slots: usize,
    /// Flights that are always the mission out and back for energy alone: 3. It lasts two slots, so drawn missions
    /// would hardly contain it, and it must be flown without an error.
    pub shortest: u64,
    /// Epochs over one rollout: 2.
    pub epochs: usize,
    /// Samples in one gradient step: 512.
    pub minibatch: usize,
    /// Largest change of the probability ratio that is rewarded: 0.15 (Schulman et al. 2017 use 0.1 to 0.3).
    pub clip_range: f32,
    /// lambda of the generalised advantage estimate: 0.9 (Schulman et al. 2016 use 0.9 to 0.99). gamma is 1: missions
    /// end by themselves.
    pub gae_lambda: f32,
    /// Weight of the entropy, in standard deviations of the advantage: 0.003.
    pub entropy_coefficient: f32,
    /// Scale of the critic's output, utility: 10.
    pub value_scale: f32,
    /// Adam's step size of the critic, in multiples of the actor's: 3.
    pub critic_rate: f32,
    /// Updates in which only the critic is trained: 25.
    pub critic_warm_up: u64,
    /// Bins of `w_data` in which advantages are normalised separately: 11.
    pub preference_bins: usize,
    /// Smallest standard deviation that advantages are divided by, utility: 0.3.
    pub deviation_min: f32,
    /// Advantages are clipped to this many standard deviations: 8.
    pub advantage_max: f32,
    /// Loss of a move that ends a mission, up to which it counts as noise of planner and channel, utility: 0.5.
    pub loss_noise: f32,
    /// Weight of the unlikelihood loss, in standard deviations of the advantage: 1 (Welleck et al. 2020 use 1).
    pub unlikelihood: f32,
    /// Probability that the planner is consulted in a slot: 0.5.
    pub prompt_probability: f64,
    /// Probability that a prompt continues in the next slot: 0.8. A single move is soon undone by the policy.
    pub prompt_continues: f64,
    /// A prompt starts only where the policy gives the planner's action less than this probability: 0.2.
    pub prompt_unlikely: f32,
    /// A prompt starts only where the policy's action loses at least this utility: 1.5.
    pub prompt_loss: f32,
    /// A prompted slot is imitated if its advantage exceeds this many standard deviations: 0.7.
    pub prompt_advantage: f32,
    /// Gradients are clipped to this norm: 0.5 (as CleanRL's PPO).
    pub gradient_norm: f32,
    /// Step size of the running average of the actor, per update: 0.03.
    pub averaging: f32,
}

impl PpoSettings {
    /// The values that trained the shipped policy.
    pub const DEFAULT: PpoSettings = PpoSettings {
        flights: 128,
        slots: 32,
        shortest: 3,
        epochs: 2,
        minibatch: 512,
        clip_range: 0.15,
        gae_lambda: 0.9,
        entropy_coefficient: 0.003,
        value_scale: 10.0,
        critic_rate: 3.0,
        critic_warm_up: 25,
        preference_bins: 11,
        deviation_min: 0.3,
        advantage_max: 8.0,
        loss_noise: 0.5,
        unlikelihood: 1.0,
        prompt_probability: 0.5,
        prompt_continues: 0.8,
        prompt_unlikely: 0.2,
        prompt_loss: 1.5,
        prompt_advantage: 0.7,
        gradient_norm: 0.5,
        averaging: 0.03,
    };
}
