//! Rollouts: flights in progress, the planner's estimate beside them, and the recorded slots.

use crate::env::flight::Flight;
use crate::env::mismatch::MapError;
use crate::env::mission::MissionSource;
use crate::env::variety::Variety;
use crate::learn::ppo::settings::PpoSettings;
use crate::learn::trainer::TrainError;
use crate::net::Sample;
use crate::observe::tokens;
use crate::planner::{Prospect, Rates, W_DATA_MAX};
use crate::settings::Settings;
use gleaner_lookahead::{ChannelEstimator, ChannelModel, FitSettings};
use gleaner_policy::{ChannelOffset, K_MAX, Preference, View};
use gleaner_units::{Action, ActionMask};
use gleaner_world::{ScenarioKind, Stream};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// One recorded slot. Actions and mask are those of the view in which the policy observed the state.
pub(super) struct Experience {
    pub sample: Sample,
    pub mask: ActionMask,
    pub action: Action,
    /// ln pi(action) when it was taken.
    pub log_probability: f32,
    /// Whether the planner chose the action.
    pub is_prompted: bool,
    /// Reward of the slot, utility.
    pub reward: f32,
    /// The planner's state value before and after the slot, utility.
    pub planner_values: [f32; 2],
    /// The critic's state value: expected sum of the shaped rewards from here on, utility.
    pub value: f32,
    /// Whether the slot ended the mission.
    pub is_over: bool,
}

/// A flight in progress as the checkpoint stores it: its state is computed again from the actions.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct StoredFlight {
    pub mission: u64,
    pub actions: Vec<u8>,
    pub is_prompted: bool,
}

/// A flight in progress.
pub(super) struct RolloutFlight {
    pub mission: u64,
    /// The view in which the policy observes it.
    pub view: View,
    pub actions: Vec<u8>,
    pub flight: Flight,
    /// As on board: fits the channel to the reports, on the map. `None` where the map is missing, and in runs without worlds
    /// that differ, whose tokens are those of the nominal channel.
    pub estimator: Option<ChannelEstimator<K_MAX>>,
    pub prospect: Prospect,
    /// The planner's value of the current state, utility.
    pub planner_value: f32,
    /// Whether the planner chose the last action.
    pub is_prompted: bool,
    /// Random numbers of the prompts: a fixed number of words for each slot.
    pub prompt_rng: ChaCha8Rng,
}

/// Where missions come from.
pub(super) struct Missions {
    source: MissionSource,
    variety: Variety,
    /// Rate tables of the planner, by setting.
    rates: Vec<Rates>,
    has_return_base: bool,
    /// Whether the policy sees the channel that is estimated in flight.
    estimates: bool,
    constants: PpoSettings,
}

impl Missions {
    pub fn new(settings: &Settings, variety: Variety, constants: PpoSettings) -> Missions {
        Missions {
            source: settings.missions(),
            rates: variety.settings().map(|setting| Rates::new(setting.site.world().clone())).collect(),
            variety,
            has_return_base: settings.share_rb > 0.0,
            estimates: settings.share_mismatched > 0.0,
            constants,
        }
    }

    /// Starts the mission with this number. Parallel flights interleave the numbers: each continues with the mission
    /// [`PpoSettings::flights`] later.
    pub fn begin(&self, mission: u64) -> Result<RolloutFlight, TrainError> {
        let (index, setting) = self.variety.setting(mission);
        let site = &setting.site;
        let mut drawn = self.source.mission(site, mission)?;
        let (round, place) = (mission / self.constants.flights, mission % self.constants.flights);
        if place < self.constants.shortest && self.has_return_base {
            let scenario = site.scenario(ScenarioKind::ReturnBase);
            drawn.realization = site.realization(&scenario, drawn.seed)?;
            drawn.preference = Preference::ENERGY;
        }
        let flight = Flight::new(site.world(), &drawn.realization, drawn.seed, drawn.preference)?;
        let flight = setting.mismatch.prepare(flight, setting.map.as_ref(), drawn.seed);
        let flight = match &setting.table {
            Some(table) => flight.with_table(table),
            None => flight,
        };
        let estimates = self.estimates && setting.mismatch.map != MapError::Flat;
        let mut prospect = Prospect::new(self.rates[index].study(&drawn.realization), mission);
        let planner_value = prospect.value(&flight);
        Ok(RolloutFlight {
            mission,
            view: View::ALL[(round + place) as usize % View::ALL.len()],
            actions: Vec::new(),
            flight,
            estimator: estimates.then(|| ChannelEstimator::new(ChannelModel::NOMINAL, FitSettings::DEFAULT)),
            prospect,
            planner_value,
            is_prompted: false,
            prompt_rng: drawn.seed.repeat(u32::MAX - 1).rng(Stream::Choices),
        })
    }

    /// Computes a stored flight again.
    pub fn restore(&self, stored: StoredFlight) -> Result<RolloutFlight, TrainError> {
        let mut flight = self.begin(stored.mission)?;
        for action in stored.actions {
            flight.step(Action::from_index(usize::from(action)).unwrap_or(Action::Hover));
        }
        flight.is_prompted = stored.is_prompted;
        Ok(flight)
    }

    /// The mission after the one of `flight`.
    pub fn next(&self, flight: &RolloutFlight) -> Result<RolloutFlight, TrainError> {
        self.begin(flight.mission + self.constants.flights)
    }
}

impl RolloutFlight {
    /// The policy's input, in the view.
    pub fn observe(&self) -> Sample {
        let channel = self.estimator.as_ref().map_or(ChannelOffset::NONE, ChannelEstimator::for_tokens);
        tokens::normalise(&self.flight.tokens_with(channel)).seen(self.view)
    }

    /// The guard's mask, in the view.
    pub fn mask(&self) -> ActionMask {
        self.flight.mask().iter().fold(ActionMask::EMPTY, |mask, action| mask.with(self.view.action(action)))
    }

    /// The action that the view turns into `viewed`.
    pub fn unviewed(&self, viewed: Action) -> Action {
        Action::ALL.into_iter().find(|&action| self.view.action(action) == viewed).unwrap_or(viewed)
    }

    /// Flies one slot; returns its reward, utility.
    pub fn step(&mut self, action: Action) -> f32 {
        self.actions.push(action.index() as u8);
        if let Some(estimator) = &mut self.estimator {
            let flight = &self.flight;
            estimator.listen(flight.map(), flight.episode().uav(), flight.device_states());
        }
        let [data, energy] = self.flight.step(action);
        let w_data = self.flight.preference().w_data().min(W_DATA_MAX);
        self.planner_value = self.prospect.value(&self.flight);
        w_data * data + (1.0 - w_data) * energy
    }

    pub fn stored(&self) -> StoredFlight {
        StoredFlight { mission: self.mission, actions: self.actions.clone(), is_prompted: self.is_prompted }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::site::Site;

    #[test]
    fn in_a_weak_channel_the_policy_sees_the_estimated_one() {
        let settings = Settings { share_mismatched: 1.0, ..Settings::default() };
        let variety = Variety::new(&Site::default_site(), 0.0, settings.share_mismatched);
        let is_weak = |mission: &u64| {
            let mismatch = variety.setting(*mission).1.mismatch;
            mismatch.noise_db > 4.0 && mismatch.map == MapError::None
        };
        let mission = (0..500).find(is_weak).expect("one in twelve worlds is weak");
        let missions = Missions::new(&settings, variety, PpoSettings::DEFAULT);
        let mut flight = missions.begin(mission).unwrap();
        let nominal = |flight: &RolloutFlight| tokens::sample(&flight.flight).seen(flight.view);
        assert_eq!(flight.observe(), nominal(&flight), "nothing was heard yet");
        for _ in 0..12 {
            let away = flight.flight.mask().iter().find(|&action| action != Action::Hover);
            flight.step(away.unwrap());
        }
        assert_ne!(flight.observe(), nominal(&flight));
        let restored = missions.restore(flight.stored()).unwrap();
        assert_eq!(restored.observe(), flight.observe());
    }
}
