//! Rewards shaped by the planner, and generalised advantage estimates (Schulman et al. 2016).
//!
//! The shaped reward of a slot is its reward plus the change of the planner's state value. The planner's search is
//! random, and a tour that it finds late was possible earlier. A slot's state value is therefore the larger of the
//! planner's estimate and the return realised later. With it no slot gains: the shaped reward is zero where nothing is
//! lost, and negative otherwise.

use crate::learn::ppo::rollout::Experience;
use crate::learn::ppo::settings::PpoSettings;
use crate::net::Sample;
use gleaner_units::{Action, ActionMask};

/// One slot with its training targets.
pub(super) struct Target {
    pub sample: Sample,
    pub mask: ActionMask,
    pub action: Action,
    pub log_probability: f32,
    pub is_prompted: bool,
    /// Advantage under the mission's preference; after [`normalise`] in standard deviations.
    pub advantage: f32,
    /// Return of the shaped rewards: the critic's target, utility.
    pub shaped_return: f32,
    /// Utility lost by ending the mission too early; after [`normalise`] in the unit of the advantage.
    pub loss_of_ending: f32,
}

/// The targets of one flight's slots, last slot first. `value_after` is the critic's value of the state after the last.
pub(super) fn targets(
    experiences: Vec<Experience>,
    value_after: f32,
    constants: &PpoSettings,
) -> Vec<Target> {
    let mut targets = Vec::with_capacity(experiences.len());
    let (mut next_value, mut next_advantage) = (value_after, 0.0);
    let mut next_state_value = f32::NEG_INFINITY;
    for experience in experiences.into_iter().rev() {
        if experience.is_over {
            (next_value, next_advantage) = (0.0, 0.0);
            next_state_value = 0.0;
        }
        // Best known return from before the slot with its action, and with the best action.
        let action_value = experience.reward + next_state_value.max(experience.planner_values[1]);
        let state_value = action_value.max(experience.planner_values[0]);
        let shaped_reward = action_value - state_value;
        next_state_value = state_value;
        let advantage = shaped_reward + next_value - experience.value + constants.gae_lambda * next_advantage;
        let loss_of_ending =
            if experience.is_over { (-shaped_reward - constants.loss_noise).max(0.0) } else { 0.0 };
        targets.push(Target {
            sample: experience.sample,
            mask: experience.mask,
            action: experience.action,
            log_probability: experience.log_probability,
            is_prompted: experience.is_prompted,
            advantage,
            shaped_return: advantage + experience.value,
            loss_of_ending,
        });
        // The policy's earlier actions get no credit for a prompt.
        (next_value, next_advantage) =
            (experience.value, if experience.is_prompted { 0.0 } else { advantage });
    }
    targets
}

/// Divides the advantages by their standard deviation among samples of similar preference. With one deviation for all, half
/// a battery unit at w = (0, 1) would be small against the variance of the data.
pub(super) fn normalise(targets: &mut [Target], constants: &PpoSettings) {
    let bins = constants.preference_bins;
    let mut sums = vec![(0.0, 0.0); bins];
    let bin = |target: &Target| (target.sample.preference[0] * (bins - 1) as f32).round() as usize;
    for target in targets.iter() {
        let (squares, count) = &mut sums[bin(target)];
        *squares += target.advantage * target.advantage;
        *count += 1.0_f32;
    }
    for target in targets {
        let (squares, count) = sums[bin(target)];
        let deviation = f32::sqrt(squares / count).max(constants.deviation_min);
        let limit = constants.advantage_max;
        target.advantage = (target.advantage / deviation).clamp(-limit, limit);
        target.loss_of_ending = (target.loss_of_ending / deviation).min(limit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONSTANTS: PpoSettings = PpoSettings::DEFAULT;

    fn slot(reward: f32, before: f32, after: f32) -> Experience {
        Experience {
            sample: Sample::default(),
            mask: ActionMask::FULL,
            action: Action::Hover,
            log_probability: 0.0,
            is_prompted: false,
            reward,
            planner_values: [before, after],
            value: 0.0,
            is_over: false,
        }
    }

    /// The shaped rewards: the advantages of a critic of zeros, with lambda taken out again.
    fn shaped_rewards(experiences: Vec<Experience>) -> Vec<f32> {
        let mut next = 0.0;
        let reward = |target: &Target| {
            target.advantage - CONSTANTS.gae_lambda * std::mem::replace(&mut next, target.advantage)
        };
        let rewards: Vec<_> = targets(experiences, 0.0, &CONSTANTS).iter().map(reward).collect();
        rewards.into_iter().rev().collect()
    }

    #[test]
    fn late_finds_of_the_planner_count_for_earlier_slots() {
        // The planner finds 4 more during the second slot: the first has not lost the 1 that it seemed to.
        assert_eq!(shaped_rewards(vec![slot(2.0, 10.0, 7.0), slot(3.0, 7.0, 8.0)]), [0.0, 0.0]);
        // A loss counts in its own slot only.
        assert_eq!(
            shaped_rewards(vec![slot(2.0, 10.0, 8.0), slot(1.0, 8.0, 3.0), slot(1.0, 3.0, 2.0)]),
            [0.0, -4.0, 0.0]
        );
        // Part of a loss was a worse search.
        assert_eq!(shaped_rewards(vec![slot(2.0, 10.0, 5.0), slot(2.0, 5.0, 4.0)]), [-2.0, 0.0]);
        // The next mission does not influence the one before.
        let over = Experience { is_over: true, ..slot(1.0, 6.0, 0.0) };
        assert_eq!(shaped_rewards(vec![over, slot(2.0, 50.0, 48.0)]), [-5.0, 0.0]);
    }

    #[test]
    fn advantages_are_scaled_within_their_preference() {
        let target = |w_data: f32, advantage: f32| {
            let mut targets = targets(vec![slot(0.0, 0.0, 0.0)], 0.0, &CONSTANTS);
            let mut target = targets.pop().unwrap();
            target.sample.preference = [w_data, 1.0 - w_data];
            Target { advantage, ..target }
        };
        let mut both = vec![target(1.0, 20.0), target(1.0, -20.0), target(0.0, 0.5), target(0.0, -0.5)];
        normalise(&mut both, &CONSTANTS);
        let scaled: Vec<f32> = both.iter().map(|target| target.advantage).collect();
        assert_eq!(scaled, [1.0, -1.0, 1.0, -1.0]);
    }
}
