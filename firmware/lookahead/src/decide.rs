//! The decision: the network proposes, the look-ahead improves, the guard's mask limits both.

use crate::estimator::{CONTRADICTION, log10_m};
use crate::fit::FitSettings;
use crate::{
    ChannelEstimator, ChannelFit, ChannelModel, Effort, Links, Onboard, Problem, Rates, State, Stop, Tour,
    Transmission,
};
use gleaner_guard::Guard;
use gleaner_policy::{ChannelOffset, DeviceState, Preference};
use gleaner_units::{Action, ActionMask, BatteryUnits, Cell, Sight};
use rand_core::SeedableRng;
use rand_xorshift::XorShiftRng;
use serde::{Deserialize, Serialize};

/// The largest weight of data that is planned with. With data alone, all tours that collect the same data would be equal,
/// and the search would not find the shorter one.
pub const W_DATA_MAX: f32 = 0.98;
/// Temperatures of a search from scratch, and of a search from the kept plan; percent of the data.
const FRESH: [f32; 2] = [1.0, 0.1];
const ONWARD: [f32; 2] = [0.5, 0.05];
/// While there is a kept plan, one tour in this many is searched from scratch.
const FRESH_SHARE: u32 = 4;
/// Utilities that differ by less are equal.
const TIE: f32 = 1e-4;
/// Log-likelihood ratio at which the map's line of sight is overridden. One report contributes at most [`CONTRADICTION`], so
/// that it takes two reports from one cell.
const OVERRIDE: f32 = 6.0;

/// The effort of one decision, in tours (see [`Effort::tours`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Budget {
    /// Tours per decision; with 0 the network decides alone.
    pub tours: u32,
}

impl Budget {
    /// The network decides alone.
    pub const NONE: Budget = Budget { tours: 0 };
    /// For a computer with an operating system.
    pub const LINUX: Budget = Budget { tours: 1_000 };
}

/// What the aircraft knows when it decides.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The cell that the aircraft is in.
    pub cell: Cell,
    /// Battery left.
    pub battery: BatteryUnits,
    /// The operator's preference.
    pub preference: Preference,
    /// Fence, terminal and reserve.
    pub guard: &'a Guard,
    /// The devices, in the order given to [`LookAhead::begin`].
    pub devices: &'a [DeviceState],
}

/// Where an action comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Source {
    /// The network, because there is no look-ahead in this slot or because no plan is better.
    Network,
    /// The plan of the slot before, unchanged.
    KeptPlan,
    /// A new plan, which visits cells in another order or at other places.
    DeviceOrder,
    /// A single action outside the kept plan, then the kept plan.
    SingleMove,
}

/// What the model expects of the rest of the mission.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// Data units still to be collected.
    pub data_units: f32,
    /// Battery units still to be used; the rest is left on arrival.
    pub energy: f32,
}

/// A decision and its explanation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// What to do.
    pub action: Action,
    /// Where the action comes from.
    pub source: Source,
    /// What the model expects after it; `None` without look-ahead.
    pub expected: Option<Expected>,
    /// Tours that were evaluated.
    pub tours: u32,
}

/// The state that look-ahead keeps from slot to slot, for up to `D` devices.
///
/// # Memory
/// About 5 kilobytes and 0.3 kilobytes a device.
#[derive(Clone, Debug)]
pub struct LookAhead<const D: usize> {
    estimator: ChannelEstimator<D>,
    links: Links<D>,
    rates: Rates,
    initial_units: f32,
    has_map: bool,
    tour: Option<Tour>,
    rng: XorShiftRng,
    /// By device: evidence that the map is wrong about the present cell.
    evidence: [f32; D],
    overrides: u32,
}

impl<const D: usize> LookAhead<D> {
    /// Look-ahead for this nominal channel, without a mission: the network decides.
    #[must_use]
    pub fn new(channel: ChannelModel, settings: FitSettings) -> LookAhead<D> {
        LookAhead {
            estimator: ChannelEstimator::new(channel, settings),
            links: Links::new(),
            rates: Rates::new(),
            initial_units: 0.0,
            has_map: false,
            tour: None,
            rng: XorShiftRng::seed_from_u64(0),
            evidence: [0.0; D],
            overrides: 0,
        }
    }

    /// Begins a mission: decides line of sight for all devices, and discards plan and channel fit. Without a map, or with
    /// more than `D` devices, the network decides alone. `seed` fixes the random draws of the search.
    ///
    /// # Cost
    /// One ray for each pair of a device and a cell.
    pub fn begin(&mut self, sight: Option<&dyn Sight>, devices: &[DeviceState], seed: u64) {
        self.estimator.begin();
        self.rates.clear();
        self.tour = None;
        self.evidence = [0.0; D];
        self.overrides = 0;
        self.rng = XorShiftRng::seed_from_u64(seed);
        self.initial_units = devices.iter().map(|device| device.remaining_units()).sum();
        self.has_map = sight.is_some() && devices.len() <= D;
        if let Some(sight) = sight.filter(|_| self.has_map) {
            self.links.survey(sight, devices.iter().map(|device| device.cell));
        }
    }

    /// The channel fit.
    #[must_use]
    pub const fn fit(&self) -> &ChannelFit {
        self.estimator.fit()
    }

    /// The channel for the network's tokens in the next slot: see [`ChannelFit::for_tokens`].
    #[must_use]
    pub fn for_tokens(&self) -> ChannelOffset {
        self.estimator.for_tokens()
    }

    /// How often live SNR has overridden the map's line of sight.
    #[must_use]
    pub const fn overrides(&self) -> u32 {
        self.overrides
    }

    /// The kept plan.
    #[must_use]
    pub const fn plan(&self) -> Option<&Tour> {
        self.tour.as_ref()
    }

    /// The action for this slot. To be called once a slot, with the network's logits and the guard's mask.
    ///
    /// # Cost
    /// `budget.tours` mean flights, and a few more.
    pub fn propose(
        &mut self,
        view: &View<'_>,
        logits: &[f32; Action::COUNT],
        mask: ActionMask,
        budget: Budget,
    ) -> Option<Choice> {
        self.listen(view);
        let network = mask.argmax(logits);
        let fallback = || {
            let homeward = || view.guard.homeward(view.cell).filter(|&action| mask.allows(action));
            let action = network.or_else(homeward).or_else(|| mask.iter().next())?;
            Some(Choice { action, source: Source::Network, expected: None, tours: 0 })
        };
        if budget.tours == 0 || !self.has_map || !self.estimator.is_trusted() {
            self.tour = None;
            return fallback();
        }
        let (channel, fit) = (self.estimator.channel(), self.estimator.fit());
        self.rates.update(channel, fit, self.links.grid(), self.links.altitude());
        self.plan_ahead(view, network, mask, budget).or_else(fallback)
    }

    fn plan_ahead(
        &mut self,
        view: &View<'_>,
        network: Option<Action>,
        mask: ActionMask,
        budget: Budget,
    ) -> Option<Choice> {
        let state = self.state(view);
        let model = Onboard {
            links: &self.links,
            rates: &self.rates,
            guard: view.guard,
            initial_units: self.initial_units,
        };
        let w_data = view.preference.w_data().min(W_DATA_MAX);
        let problem = Problem { model: &model, state: &state, w_data };
        let mut best = problem.plan(self.tour.take(), budget, &mut self.rng)?;
        best.step_aside(&problem, network, mask);
        if !mask.allows(best.action) {
            return None;
        }
        let expected = Expected {
            data_units: best.end.collected,
            energy: 0.5 * (state.hovers_left - best.end.hovers_left) as f32,
        };
        self.tour = Some(best.tour);
        self.spend(state.cell, best.action);
        Some(Choice {
            action: best.action,
            source: best.source,
            expected: Some(expected),
            tours: budget.tours,
        })
    }

    /// The utility of each allowed action followed by the kept plan, `w . (percent, -battery units)` of the rest of the mission;
    /// minus infinity for the others. `None` without a plan. To be called after [`LookAhead::propose`] in the same slot.
    #[must_use]
    pub fn utilities(&self, view: &View<'_>, mask: ActionMask) -> Option<[f32; Action::COUNT]> {
        let tour = self.tour.as_ref()?;
        let state = self.state(view);
        let model = self.model(view.guard);
        let w_data = view.preference.w_data().min(W_DATA_MAX);
        let problem = Problem { model: &model, state: &state, w_data };
        Some(Action::ALL.map(|action| {
            if mask.allows(action) {
                problem.utility(&problem.after(action, tour))
            } else {
                f32::NEG_INFINITY
            }
        }))
    }

    /// Takes the slot that is about to be flown off the kept plan: a hover at its first stop shortens the dwell.
    fn spend(&mut self, cell: Cell, action: Action) {
        let first = self.tour.as_mut().and_then(|tour| tour.stops.first_mut());
        if let Some(Stop { slots, .. }) = first.filter(|stop| stop.cell == cell && action == Action::Hover) {
            *slots = slots.saturating_sub(1);
        }
    }

    /// The present state, with the transmission that follows from live SNR in this slot.
    pub(crate) fn state(&self, view: &View<'_>) -> State<D> {
        let data = view.devices.iter().map(|device| device.remaining_units());
        let mut state = State::new(view.cell, view.battery, data);
        let heard = view.devices.iter().enumerate().filter_map(|(index, device)| {
            let snr_db = device.snr_db().filter(|snr_db| *snr_db >= self.estimator.channel().threshold_db)?;
            (device.remaining_units() > 0.0).then_some((index, snr_db))
        });
        let strongest = heard.reduce(|best, next| if next.1 > best.1 { next } else { best });
        state.present = strongest.map(|(device, snr_db)| Transmission {
            device,
            units: self.estimator.channel().units_per_slot(snr_db),
        });
        state
    }

    pub(crate) const fn has_map(&self) -> bool {
        self.has_map
    }

    /// The model of the mission as it is known now.
    pub(crate) const fn model<'a>(&'a self, guard: &'a Guard) -> Onboard<'a, D> {
        let LookAhead { links, rates, initial_units, .. } = self;
        Onboard { links, rates, guard, initial_units: *initial_units }
    }

    pub(crate) fn rng(&self) -> XorShiftRng {
        self.rng.clone()
    }

    /// Updates channel fit and line of sight from live SNR.
    fn listen(&mut self, view: &View<'_>) {
        if self.estimator.arrive(view.cell) {
            self.evidence = [0.0; D];
        }
        let Some(index) = self.links.grid().index(view.cell).filter(|_| self.has_map) else { return };
        self.estimator.advance();
        let (grid, altitude) = (self.links.grid(), self.links.altitude());
        for (device, heard) in view.devices.iter().enumerate() {
            let from_here = |&snr_db: &f32| self.estimator.is_from(device, snr_db, view.cell);
            let Some(snr_db) = heard.snr_db().filter(from_here) else { continue };
            let mapped = self.links.sees(device, index);
            let link = (mapped, log10_m(grid, altitude, heard.cell, view.cell));
            let doubt = self.estimator.doubt(link, snr_db);
            let Some(evidence) = self.evidence.get_mut(device) else { continue };
            *evidence = (*evidence + doubt.clamp(-CONTRADICTION, CONTRADICTION)).max(0.0);
            if *evidence >= OVERRIDE {
                *evidence = 0.0;
                self.overrides = self.overrides.saturating_add(1);
                self.links.correct(device, view.cell, !mapped);
                for action in Action::MOVES {
                    self.links.correct(device, view.cell.after(action), !mapped);
                }
            } else {
                self.estimator.take(link, snr_db, doubt);
            }
        }
    }
}

/// The best tour found, and the action it begins with.
struct Plan<const D: usize> {
    tour: Tour,
    action: Action,
    value: f32,
    end: State<D>,
    source: Source,
}

impl<const D: usize> Problem<'_, Onboard<'_, D>, D> {
    /// The best of the kept plan, a search from it and a search from scratch.
    fn plan(&self, kept: Option<Tour>, budget: Budget, rng: &mut XorShiftRng) -> Option<Plan<D>> {
        let fresh = if kept.is_some() { budget.tours / FRESH_SHARE } else { budget.tours };
        let mut best = self.anneal(Tour::HOME, Effort { tours: fresh, temperatures: FRESH }, rng);
        let mut source = Source::DeviceOrder;
        if let Some(mut tour) = kept {
            let value = self.evaluate(&mut tour);
            let effort = Effort { tours: budget.tours - fresh, temperatures: ONWARD };
            let onward = self.anneal(tour.clone(), effort, rng);
            if onward.0 >= best.0 {
                best = onward;
            }
            if value >= best.0 {
                (best, source) = ((value, tour), Source::KeptPlan);
            }
        }
        let (value, tour) = best;
        let mut end = *self.state;
        end.finish(self.model, &tour);
        end.first.map(|action| Plan { tour, action, value, end, source })
    }

    /// The end of the mission when this action is flown first, then the tour.
    fn after(&self, action: Action, tour: &Tour) -> State<D> {
        let mut end = *self.state;
        end.slot(self.model, action);
        if !end.over {
            end.finish(self.model, tour);
        }
        end
    }
}

impl<const D: usize> Plan<D> {
    /// Compares the plan with each single action followed by the plan. The network's action wins a tie.
    fn step_aside(
        &mut self,
        problem: &Problem<'_, Onboard<'_, D>, D>,
        network: Option<Action>,
        mask: ActionMask,
    ) {
        let planned = self.action;
        for aside in mask.iter().filter(|&aside| aside != planned) {
            let end = problem.after(aside, &self.tour);
            let value = problem.utility(&end);
            let is_network = network == Some(aside);
            if value > self.value + TIE || (is_network && value >= self.value - TIE) {
                let source = if is_network { Source::Network } else { Source::SingleMove };
                (self.value, self.action, self.end, self.source) = (value, aside, end, source);
            }
        }
    }
}
