//! Prompts: slots in which the planner's action replaces the policy's.
//!
//! Another device order takes many moves in the other direction. A certain policy gives each of them almost no
//! probability, so it does not explore other orders. A prompt starts at random in a slot where the policy is unlikely to
//! take the planner's action and its own action loses utility by the planner's estimate. It lasts a few slots.

use crate::env::distribution::Distribution;
use crate::learn::ppo::rollout::RolloutFlight;
use crate::learn::ppo::settings::PpoSettings;
use gleaner_units::Action;
use rand::RngExt;

/// Words of the random generator reserved for one slot.
const WORDS_PER_SLOT: u128 = 1 << 20;

impl RolloutFlight {
    /// The action to fly where the policy sampled `picked`, and whether it is a prompt. Actions are in the view.
    pub(super) fn prompt(
        &mut self,
        picked: Action,
        policy: &Distribution,
        constants: &PpoSettings,
    ) -> (Action, bool) {
        self.prompt_rng.set_word_pos(self.actions.len() as u128 * WORDS_PER_SLOT);
        let continues = self.is_prompted && self.prompt_rng.random_bool(constants.prompt_continues);
        let starts = !self.is_prompted && self.prompt_rng.random_bool(constants.prompt_probability);
        if !continues && !starts {
            self.is_prompted = false;
            return (picked, false);
        }
        let advice = self.prospect.advice(&self.flight).map(|action| self.view.action(action));
        let advice = advice.filter(|&advice| advice != picked && self.mask().allows(advice));
        let Some(advice) = advice else {
            // Planner and policy agree.
            self.is_prompted = continues;
            return (picked, false);
        };
        self.is_prompted = continues || (starts && self.needs_prompt(picked, advice, policy, constants));
        (if self.is_prompted { advice } else { picked }, self.is_prompted)
    }

    fn needs_prompt(
        &mut self,
        picked: Action,
        advice: Action,
        policy: &Distribution,
        constants: &PpoSettings,
    ) -> bool {
        let picked = self.unviewed(picked);
        policy.probability[advice.index()] < constants.prompt_unlikely
            && self.planner_value - self.prospect.value_with(&self.flight, picked, &mut self.prompt_rng)
                > constants.prompt_loss
    }
}
