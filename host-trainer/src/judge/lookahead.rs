//! The look-ahead that flies, as a decider.

use crate::env::flight::Flight;
use crate::judge::evaluation::{Decider, DeciderError};
use gleaner_lookahead::{Budget, ChannelModel, FitSettings, LookAhead, Source};
use gleaner_policy::{DeviceState, K_MAX, Policy};
use gleaner_units::{Action, Sight};
use std::time::{Duration, Instant};

/// Decisions by [`Source`]: network, kept plan, device order, single move.
pub type SourceCounts = [u64; 4];

/// A policy with look-ahead. Its inputs are those on board: the map, the nominal channel, live SNR, positions and data.
pub struct LookingAhead<'a, P> {
    policy: &'a mut P,
    budget: Budget,
    settings: FitSettings,
    has_map: bool,
    flights: Vec<LookAhead<K_MAX>>,
    sources: SourceCounts,
    /// Of the network and of the look-ahead.
    times: [Vec<Duration>; 2],
}

impl<'a, P: Policy<Error: std::fmt::Display>> LookingAhead<'a, P> {
    /// Looks ahead with this budget per decision.
    #[must_use]
    pub fn new(policy: &'a mut P, budget: Budget) -> LookingAhead<'a, P> {
        let settings = FitSettings::DEFAULT;
        LookingAhead {
            policy,
            budget,
            settings,
            has_map: true,
            flights: Vec::new(),
            sources: [0; 4],
            times: Default::default(),
        }
    }

    /// Sets whether there is a map of buildings on board; without one the policy decides alone.
    #[must_use]
    pub const fn with_map(mut self, has_map: bool) -> LookingAhead<'a, P> {
        self.has_map = has_map;
        self
    }

    /// Changes the constants of the channel fit.
    #[must_use]
    pub const fn with_settings(mut self, settings: FitSettings) -> LookingAhead<'a, P> {
        self.settings = settings;
        self
    }

    /// How long the network and the look-ahead took, for each decision.
    #[must_use]
    pub fn into_times(self) -> [Vec<Duration>; 2] {
        self.times
    }

    /// How many decisions came from each source.
    #[must_use]
    pub const fn sources(&self) -> SourceCounts {
        self.sources
    }

    fn decide_one(&mut self, number: usize, flight: &Flight) -> Result<Action, DeciderError> {
        let devices: Vec<DeviceState> = flight.device_states().collect();
        while self.flights.len() <= number {
            self.flights.push(LookAhead::new(ChannelModel::NOMINAL, self.settings));
        }
        let lookahead = &mut self.flights[number];
        if flight.episode().slots() == 0 {
            let map = self.has_map.then(|| flight.map() as &dyn Sight);
            lookahead.begin(map, &devices, 0);
        }
        let begun = Instant::now();
        let tokens = flight.tokens_with(lookahead.for_tokens());
        let answer = self.policy.infer(&tokens).map_err(|error| DeciderError(error.to_string()))?;
        self.times[0].push(begun.elapsed());
        let begun = Instant::now();
        let choice = lookahead
            .propose(&flight.view(&devices), &answer.logits, flight.mask(), self.budget)
            .ok_or_else(|| DeciderError("no action is allowed".into()))?;
        self.times[1].push(begun.elapsed());
        let source = match choice.source {
            Source::Network => 0,
            Source::KeptPlan => 1,
            Source::DeviceOrder => 2,
            Source::SingleMove => 3,
        };
        self.sources[source] += 1;
        Ok(choice.action)
    }
}

impl<P: Policy<Error: std::fmt::Display>> Decider for LookingAhead<'_, P> {
    fn decide(&mut self, flights: &[&Flight]) -> Result<Vec<Action>, DeciderError> {
        flights.iter().enumerate().map(|(number, flight)| self.decide_one(number, flight)).collect()
    }

    fn decide_numbered(&mut self, flights: &[(usize, &Flight)]) -> Result<Vec<Action>, DeciderError> {
        flights.iter().map(|(number, flight)| self.decide_one(*number, flight)).collect()
    }
}
