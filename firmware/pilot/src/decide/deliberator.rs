//! What decides: a network alone, or a network with look-ahead.

use gleaner_guard::Guard;
use gleaner_lookahead::{
    Budget, ChannelEstimate, ChannelEstimator, ChannelModel, Expected, FitSettings, LookAhead, Source, View,
};
use gleaner_policy::{ChannelOffset, DeviceState, Inference, Policy, Preference, Tokens};
use gleaner_units::{Action, ActionMask, BatteryUnits, Cell, Duration, Instant, Sight};
use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::MAX_DEVICES;

/// The aircraft's situation when a decision is due.
#[derive(Clone, Copy)]
pub struct Place<'a> {
    /// The cell that the aircraft is in.
    pub cell: Cell,
    /// Battery left.
    pub battery: BatteryUnits,
    /// The operator's preference.
    pub preference: Preference,
    /// Fence, terminal and reserve.
    pub guard: &'a Guard,
    /// Line of sight over the mission's buildings.
    pub sight: &'a dyn Sight,
}

/// How the look-ahead came to an action.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LookAheadRecord {
    /// Where the action comes from.
    pub source: Source,
    /// What the model expects of the rest of the mission; `None` where the network decided alone.
    pub expected: Option<Expected>,
    /// Tours that a decision may take; 0 while look-ahead is switched off.
    pub budget: u32,
    /// Tours that were evaluated; 0 where the network decided alone.
    pub tours: u32,
    /// Seed of the random draws of this mission.
    pub seed: u32,
    /// Decisions since the look-ahead began this mission. With `seed` it makes a replay possible.
    pub slot: u16,
    /// The channel as estimated from the reports so far.
    pub channel: ChannelEstimate,
}

/// What the machine decides with. Each [`Policy`] is one that decides alone; [`ChannelAware`] estimates the channel for its
/// tokens; [`LookingAhead`] does so and plans.
///
/// The result must depend on the arguments and on earlier calls only, so that a decision log can be replayed.
pub trait Deliberator {
    /// Whether there is a look-ahead. Without one `GLN_LOOKAHEAD` stays 0.
    const LOOKS_AHEAD: bool;

    /// Evaluates the network; `None` when the engine failed.
    fn infer(&mut self, tokens: &Tokens) -> Option<Inference>;

    /// A mission begins. `sight` is `None` without a map of buildings; `devices` hold the data of the start.
    fn begin(&mut self, sight: Option<&dyn Sight>, devices: impl Iterator<Item = DeviceState>, seed: u32);

    /// The action for this slot, inside `mask`; `None` leaves it to the network. To be called once a slot, also while
    /// look-ahead is switched off (`is_on`), because the channel is estimated from every slot.
    fn propose(
        &mut self,
        place: &Place<'_>,
        devices: impl Iterator<Item = DeviceState>,
        logits: &[f32; Action::COUNT],
        mask: ActionMask,
        is_on: bool,
    ) -> Option<(Action, LookAheadRecord)>;

    /// The channel for yield map and vantages of the next slot.
    fn channel_for_tokens(&self) -> ChannelOffset;

    /// The channel as estimated in this mission; `None` before the first decision and where it is not estimated.
    fn channel(&self) -> Option<ChannelEstimate>;
}

impl<P: Policy> Deliberator for P {
    const LOOKS_AHEAD: bool = false;

    fn infer(&mut self, tokens: &Tokens) -> Option<Inference> {
        Policy::infer(self, tokens).ok()
    }

    fn begin(&mut self, _: Option<&dyn Sight>, _: impl Iterator<Item = DeviceState>, _: u32) {}

    fn propose(
        &mut self,
        _: &Place<'_>,
        _: impl Iterator<Item = DeviceState>,
        _: &[f32; Action::COUNT],
        _: ActionMask,
        _: bool,
    ) -> Option<(Action, LookAheadRecord)> {
        None
    }

    fn channel_for_tokens(&self) -> ChannelOffset {
        ChannelOffset::NONE
    }

    fn channel(&self) -> Option<ChannelEstimate> {
        None
    }
}

/// A network alone, with yield map and vantages of the channel as estimated in flight.
#[derive(Clone, Debug)]
pub struct ChannelAware<P> {
    policy: P,
    estimator: ChannelEstimator<MAX_DEVICES>,
    /// Whether the mission has a map; without one every link would count as unobstructed.
    has_map: bool,
}

impl<P> ChannelAware<P> {
    /// The nominal channel is the prior.
    #[must_use]
    pub const fn new(policy: P) -> ChannelAware<P> {
        let estimator = ChannelEstimator::new(ChannelModel::NOMINAL, FitSettings::DEFAULT);
        ChannelAware { policy, estimator, has_map: false }
    }

    /// The network.
    #[must_use]
    pub const fn network(&self) -> &P {
        &self.policy
    }
}

impl<P: Policy> Deliberator for ChannelAware<P> {
    const LOOKS_AHEAD: bool = false;

    fn infer(&mut self, tokens: &Tokens) -> Option<Inference> {
        self.policy.infer(tokens).ok()
    }

    fn begin(&mut self, sight: Option<&dyn Sight>, _: impl Iterator<Item = DeviceState>, _: u32) {
        self.estimator.begin();
        self.has_map = sight.is_some();
    }

    fn propose(
        &mut self,
        place: &Place<'_>,
        devices: impl Iterator<Item = DeviceState>,
        _: &[f32; Action::COUNT],
        _: ActionMask,
        _: bool,
    ) -> Option<(Action, LookAheadRecord)> {
        if self.has_map {
            self.estimator.listen(place.sight, place.cell, devices);
        }
        None
    }

    fn channel_for_tokens(&self) -> ChannelOffset {
        self.estimator.for_tokens()
    }

    fn channel(&self) -> Option<ChannelEstimate> {
        self.estimator.estimate()
    }
}

/// A network with look-ahead, for missions of up to [`MAX_DEVICES`] devices: 27 kilobytes beside the network.
#[derive(Clone, Debug)]
pub struct LookingAhead<P> {
    policy: P,
    lookahead: LookAhead<MAX_DEVICES>,
    devices: Vec<DeviceState, MAX_DEVICES>,
    budget: Budget,
    seed: u32,
    slot: u16,
    clock: Option<fn() -> Instant>,
    took: core::cell::Cell<Option<Duration>>,
}

impl<P> LookingAhead<P> {
    /// Looks ahead with the nominal channel as prior and this budget per decision.
    #[must_use]
    pub fn new(policy: P, budget: Budget) -> LookingAhead<P> {
        let lookahead = LookAhead::new(ChannelModel::NOMINAL, FitSettings::DEFAULT);
        let (devices, took) = (Vec::new(), core::cell::Cell::new(None));
        LookingAhead { policy, lookahead, devices, budget, seed: 0, slot: 0, clock: None, took }
    }

    /// Measures the time of each decision with this clock. The time is reported, never used.
    #[must_use]
    pub const fn with_clock(mut self, clock: fn() -> Instant) -> LookingAhead<P> {
        self.clock = Some(clock);
        self
    }

    /// How long network and look-ahead took for the last decision. `None` after it was taken, before the first decision, and
    /// without a clock.
    pub fn take_time(&self) -> Option<Duration> {
        self.took.take()
    }

    fn now(&self) -> Option<Instant> {
        self.clock.map(|clock| clock())
    }

    /// The network.
    #[must_use]
    pub const fn network(&self) -> &P {
        &self.policy
    }

    /// Changes the budget of the decisions to come.
    pub const fn set_budget(&mut self, budget: Budget) {
        self.budget = budget;
    }

    /// The planner, for example for [`LookAhead::what_if`].
    #[must_use]
    pub const fn planner(&self) -> &LookAhead<MAX_DEVICES> {
        &self.lookahead
    }
}

impl<P: Policy> Deliberator for LookingAhead<P> {
    const LOOKS_AHEAD: bool = true;

    fn infer(&mut self, tokens: &Tokens) -> Option<Inference> {
        let begun = self.now();
        let inference = self.policy.infer(tokens).ok();
        self.took.set(begun.zip(self.now()).map(|(begun, now)| now.since(begun)));
        inference
    }

    fn begin(&mut self, sight: Option<&dyn Sight>, devices: impl Iterator<Item = DeviceState>, seed: u32) {
        // A mission holds no more devices than this.
        self.devices = devices.take(MAX_DEVICES).collect();
        self.lookahead.begin(sight, &self.devices, seed.into());
        (self.seed, self.slot) = (seed, 0);
    }

    fn propose(
        &mut self,
        place: &Place<'_>,
        devices: impl Iterator<Item = DeviceState>,
        logits: &[f32; Action::COUNT],
        mask: ActionMask,
        is_on: bool,
    ) -> Option<(Action, LookAheadRecord)> {
        self.devices = devices.take(MAX_DEVICES).collect();
        let &Place { cell, battery, preference, guard, .. } = place;
        let view = View { cell, battery, preference, guard, devices: &self.devices };
        let budget = if is_on { self.budget } else { Budget::NONE };
        let begun = self.now();
        let choice = self.lookahead.propose(&view, logits, mask, budget);
        let planned = begun.zip(self.now()).map(|(begun, now)| now.since(begun));
        if let (Some(network), Some(planned)) = (self.took.get(), planned) {
            self.took.set(Some(network + planned));
        }
        let slot = self.slot;
        self.slot = slot.saturating_add(1);
        let choice = choice?;
        let record = LookAheadRecord {
            source: choice.source,
            expected: choice.expected,
            budget: budget.tours,
            tours: choice.tours,
            seed: self.seed,
            slot,
            channel: self.lookahead.fit().estimate(),
        };
        Some((choice.action, record))
    }

    fn channel_for_tokens(&self) -> ChannelOffset {
        self.lookahead.for_tokens()
    }

    fn channel(&self) -> Option<ChannelEstimate> {
        (self.slot > 0).then(|| self.lookahead.fit().estimate())
    }
}
