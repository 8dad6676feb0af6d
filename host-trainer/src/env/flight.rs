//! A mission on the grid under the safety envelope: an episode of the learner.

use gleaner_guard::Guard;
use gleaner_lookahead::View;
use gleaner_policy::{ChannelOffset, DeviceState, Preference, Situation, TokenTable, Tokens};
use gleaner_units::{Action, ActionMask, BatteryUnits, Cell, CellSet};
use gleaner_world::{City, Episode, Realization, ScenarioError, Seed, Stream, World};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::sync::{Arc, Mutex, PoisonError};

/// The vector reward of one slot (paper, eq. 14): collected data in percent of the initial data, and minus the energy
/// in battery units.
pub type Reward = [f32; 2];

/// An episode that only takes actions inside the safety envelope, under one preference.
#[derive(Clone, Debug)]
pub struct Flight {
    episode: Episode,
    guard: Guard,
    preference: Preference,
    start: Cell,
    total: Reward,
    reports: Option<Reports>,
    map: Option<Arc<City>>,
    table: Option<SharedTable>,
}

/// What each device can send to each cell of one city, computed once for all flights in it. The tokens are the same with and
/// without a table, bit for bit.
#[derive(Clone, Debug, Default)]
pub struct SharedTable(Arc<Mutex<TokenTable>>);

/// The reports received from the devices, when some are lost.
#[derive(Clone, Debug)]
struct Reports {
    missing: f64,
    rng: ChaCha8Rng,
    /// By device: whether the report of this slot arrived, and the remaining data of the last report.
    last: Vec<(bool, f32)>,
}

impl Reports {
    fn receive(&mut self, episode: &Episode) {
        for (last, device) in self.last.iter_mut().zip(episode.devices()) {
            *last = if self.rng.random_bool(self.missing) {
                (false, last.1)
            } else {
                (true, device.remaining_units)
            };
        }
    }
}

impl Flight {
    /// Starts a mission without a reserve, as the paper's safety controller does.
    ///
    /// # Errors
    /// The realization does not belong to this world.
    ///
    /// # Panics
    /// When the terminal has no neighbour inside the map; scenarios have.
    pub fn new(
        world: &Arc<World>,
        realization: &Realization,
        seed: Seed,
        preference: Preference,
    ) -> Result<Flight, ScenarioError> {
        let episode = Episode::new(Arc::clone(world), realization, seed)?;
        let map = CellSet::full(world.city().grid());
        let guard = Guard::new(&map, realization.terminal(), BatteryUnits(0.0))
            .expect("the terminal of a scenario lies inside a map of more than one cell");
        Ok(Flight {
            episode,
            guard,
            preference,
            start: realization.start(),
            total: [0.0; 2],
            reports: None,
            map: None,
            table: None,
        })
    }

    /// Drops each report with this probability. A device without a report counts as not heard, and its remaining data
    /// stays that of the last report.
    #[must_use]
    pub fn with_reports_missing(mut self, share: f64, seed: Seed) -> Flight {
        if share > 0.0 {
            let last = self.episode.devices().iter().map(|device| (true, device.remaining_units)).collect();
            let mut reports =
                Reports { missing: share, rng: seed.repeat(u32::MAX).rng(Stream::Choices), last };
            reports.receive(&self.episode);
            self.reports = Some(reports);
        }
        self
    }

    /// Looks up coverage in this table, which belongs to the city of this flight.
    #[must_use]
    pub fn with_table(mut self, table: &SharedTable) -> Flight {
        self.table = Some(table.clone());
        self
    }

    /// Gives the policy this city map in place of the true one: another building map on board.
    ///
    /// # Panics
    /// When its grid is another one.
    #[must_use]
    pub fn with_map(mut self, map: Arc<City>) -> Flight {
        assert_eq!(map.grid(), self.episode.world().city().grid(), "the map must cover the city");
        self.map = Some(map);
        // It belongs to the true map.
        self.table = None;
        self
    }

    /// The city map that the policy has.
    #[must_use]
    pub fn map(&self) -> &City {
        self.map.as_deref().unwrap_or_else(|| self.episode.world().city())
    }

    /// Whether the policy has the same map in both flights.
    #[must_use]
    pub fn shares_map(&self, other: &Flight) -> bool {
        match (&self.map, &other.map) {
            (None, None) => Arc::ptr_eq(self.episode.world(), other.episode.world()),
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            _ => false,
        }
    }

    /// Whether a device's report of this slot was received, and its remaining data by its last report, data units.
    ///
    /// # Panics
    /// When there is no such device.
    #[must_use]
    pub fn report(&self, device: usize) -> (bool, f32) {
        match &self.reports {
            Some(reports) => reports.last[device],
            None => (true, self.episode.devices()[device].remaining_units),
        }
    }

    /// The devices as reported to the aircraft.
    pub fn device_states(&self) -> impl Iterator<Item = DeviceState> {
        self.episode.devices().iter().enumerate().map(|(index, device)| {
            let (arrived, remaining) = self.report(index);
            DeviceState { cell: device.cell, remaining, snr: arrived.then_some(device.snr) }
        })
    }

    /// What the look-ahead is told in the current slot. `devices`: from [`Flight::device_states`].
    #[must_use]
    pub fn view<'a>(&'a self, devices: &'a [DeviceState]) -> View<'a> {
        View {
            cell: self.episode.uav(),
            battery: self.episode.battery(),
            preference: self.preference,
            guard: &self.guard,
            devices,
        }
    }

    /// The policy's observation of the current slot.
    #[must_use]
    pub fn tokens(&self) -> Tokens {
        self.tokens_with(ChannelOffset::NONE)
    }

    /// As [`Flight::tokens`], with yield map and vantages of another than the nominal channel.
    #[must_use]
    pub fn tokens_with(&self, channel: ChannelOffset) -> Tokens {
        let situation = Situation {
            cell: self.episode.uav(),
            battery: self.episode.battery(),
            spare: self.spare(),
            terminal: self.episode.terminal(),
            preference: self.preference,
            sight: self.map(),
            channel,
        };
        match &self.table {
            Some(SharedTable(table)) => {
                // A table is whole after each insertion, also when a thread has panicked in between.
                let mut table = table.lock().unwrap_or_else(PoisonError::into_inner);
                table.build(&situation, self.device_states()).0
            }
            None => Tokens::build(&situation, self.device_states()).0,
        }
    }

    /// Battery beyond what the way to the terminal needs.
    #[must_use]
    pub fn spare(&self) -> BatteryUnits {
        let battery = self.episode.battery();
        self.guard.spare(self.episode.uav(), battery).unwrap_or(battery)
    }

    /// The start cell.
    #[must_use]
    pub const fn start(&self) -> Cell {
        self.start
    }

    /// The actions that the guard allows now.
    #[must_use]
    pub fn mask(&self) -> ActionMask {
        self.guard.mask(self.episode.uav(), self.episode.battery())
    }

    /// Flies one slot.
    ///
    /// # Panics
    /// On an action outside [`Flight::mask`], or when the flight is over.
    pub fn step(&mut self, action: Action) -> Reward {
        assert!(self.mask().allows(action), "{action:?} is outside the safety envelope");
        let step = self.episode.step(action).expect("an allowed action can be flown");
        let reward = self.episode.reward(&step);
        if let Some(reports) = &mut self.reports {
            reports.receive(&self.episode);
        }
        for (total, part) in self.total.iter_mut().zip(reward) {
            *total += part;
        }
        reward
    }

    /// Whether the terminal was reached.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.episode.is_done()
    }

    /// The sum of the rewards so far: percent of data, minus battery units.
    #[must_use]
    pub const fn total(&self) -> Reward {
        self.total
    }

    /// The preference of the mission.
    #[must_use]
    pub const fn preference(&self) -> Preference {
        self.preference
    }

    /// The state of the world.
    #[must_use]
    pub const fn episode(&self) -> &Episode {
        &self.episode
    }

    /// The safety envelope.
    #[must_use]
    pub const fn guard(&self) -> &Guard {
        &self.guard
    }
}
