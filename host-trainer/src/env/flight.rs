//! A mission on the grid with the guard on: what the learner flies.

use crate::net::Sample;
use crate::observe::tokens::{Observation, normalise};
use gleaner_guard::Guard;
use gleaner_policy::{DeviceState, Preference, Situation, Tokens};
use gleaner_units::{Action, ActionMask, BatteryUnits, Cell, CellSet};
use gleaner_world::{Episode, Realization, ScenarioError, Seed, Stream, World};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// The data that one slot brings, in percent of all there was, and minus its energy in battery units: the
/// vector reward (paper, eq. 14), in the units of the paper's figures.
pub type Reward = [f32; 2];

/// An episode that only takes actions inside the envelope, under one preference.
#[derive(Clone, Debug)]
pub struct Flight {
    episode: Episode,
    guard: Guard,
    preference: Preference,
    start: Cell,
    total: Reward,
    reports: Option<Reports>,
}

/// What has arrived of the devices' reports, where not all do.
#[derive(Clone, Debug)]
struct Reports {
    missing: f64,
    rng: ChaCha8Rng,
    /// By device: whether this slot's report arrived, and the data that was reported last.
    last: Vec<(bool, f32)>,
}

impl Reports {
    fn listen(&mut self, episode: &Episode) {
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
    /// Starts a mission, with no reserve: the paper's safety controller.
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
        Ok(Flight { episode, guard, preference, start: realization.start(), total: [0.0; 2], reports: None })
    }

    /// Loses this share of the reports, each by chance: the device is then not heard, and its data is that of the
    /// report before.
    #[must_use]
    pub fn with_reports_missing(mut self, share: f64, seed: Seed) -> Flight {
        if share > 0.0 {
            let last = self.episode.devices().iter().map(|device| (true, device.remaining_units)).collect();
            let mut reports =
                Reports { missing: share, rng: seed.repeat(u32::MAX).rng(Stream::Choices), last };
            reports.listen(&self.episode);
            self.reports = Some(reports);
        }
        self
    }

    /// What the policy sees now.
    #[must_use]
    pub fn tokens(&self) -> Tokens {
        let situation = Situation {
            cell: self.episode.uav(),
            battery: self.episode.battery(),
            spare: self.spare(),
            terminal: self.episode.terminal(),
            preference: self.preference,
            sight: self.episode.world().city(),
        };
        let devices = self.episode.devices().iter().enumerate().map(|(index, device)| {
            let (arrived, remaining) = match &self.reports {
                Some(reports) => reports.last[index],
                None => (true, device.remaining_units),
            };
            DeviceState { cell: device.cell, remaining, snr: arrived.then_some(device.snr) }
        });
        Tokens::build(&situation, devices).0
    }

    /// The same as the network's first layer sees it.
    #[must_use]
    pub fn sample(&self) -> Sample {
        normalise(&self.tokens())
    }

    /// The same for the replay memory.
    #[must_use]
    pub fn observe(&self) -> Observation {
        Observation::new(&self.tokens())
    }

    /// What the battery holds beyond the way to the terminal.
    #[must_use]
    pub fn spare(&self) -> BatteryUnits {
        let battery = self.episode.battery();
        self.guard.spare(self.episode.uav(), battery).unwrap_or(battery)
    }

    /// Where it began.
    #[must_use]
    pub const fn start(&self) -> Cell {
        self.start
    }

    /// What the guard allows now.
    #[must_use]
    pub fn mask(&self) -> ActionMask {
        self.guard.mask(self.episode.uav(), self.episode.battery())
    }

    /// Flies one slot.
    ///
    /// # Panics
    /// On an action outside [`Flight::mask`], or when the flight is over.
    pub fn step(&mut self, action: Action) -> Reward {
        assert!(self.mask().allows(action), "{action:?} is outside the envelope");
        let step = self.episode.step(action).expect("what the guard allows can be flown");
        let reward = self.episode.reward(&step);
        if let Some(reports) = &mut self.reports {
            reports.listen(&self.episode);
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

    /// The preference that it is flown under.
    #[must_use]
    pub const fn preference(&self) -> Preference {
        self.preference
    }

    /// The episode underneath.
    #[must_use]
    pub const fn episode(&self) -> &Episode {
        &self.episode
    }

    /// The envelope.
    #[must_use]
    pub const fn guard(&self) -> &Guard {
        &self.guard
    }
}
