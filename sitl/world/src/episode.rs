//! One mission on the grid, slot by slot.

use crate::field::{Device, Field};
use crate::{Realization, ScenarioError, Seed, Stream, World};
use gleaner_units::{Action, BatteryUnits, Cell};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use thiserror::Error;

/// A mission in progress.
#[derive(Clone, Debug)]
pub struct Episode {
    world: Arc<World>,
    field: Field,
    uav: Cell,
    terminal: Cell,
    battery: BatteryUnits,
    rng: ChaCha8Rng,
    slots: u32,
    done: bool,
}

/// The outcome of one slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Index of the served device, if any.
    pub served: Option<usize>,
    /// Data sent, data units.
    pub collected_units: f32,
    /// Energy of the action.
    pub energy: BatteryUnits,
    /// Whether the mission is over.
    pub done: bool,
}

/// Why an action is impossible. The episode is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum StepError {
    /// The mission is over.
    #[error("the mission is over: reset the episode")]
    Over,
    /// The move leaves the grid.
    #[error("moving {} from {from} leaves the city", action.name())]
    OffGrid {
        /// Where the aircraft is.
        from: Cell,
        /// The action.
        action: Action,
    },
    /// The battery holds less than the action needs.
    #[error("the battery is empty at {at}, away from the terminal")]
    BatteryEmpty {
        /// Where the aircraft is.
        at: Cell,
    },
}

impl Episode {
    /// Starts a mission and draws the SNR of its first slot. `seed` determines the shadowing.
    ///
    /// # Errors
    /// [`ScenarioError::DeviceNotOpen`] if the realization was drawn for another city.
    pub fn new(world: Arc<World>, realization: &Realization, seed: Seed) -> Result<Episode, ScenarioError> {
        let field = Field::new(&world, realization)?;
        let mut episode = Episode {
            world,
            field,
            uav: realization.start(),
            terminal: realization.terminal(),
            battery: realization.battery(),
            rng: seed.rng(Stream::Slots),
            slots: 0,
            done: false,
        };
        episode.listen();
        Ok(episode)
    }

    /// As [`Episode::new`] in the same world, reusing the memory of this episode.
    ///
    /// # Errors
    /// Those of [`Episode::new`]; the episode is then over.
    pub fn reset(&mut self, realization: &Realization, seed: Seed) -> Result<(), ScenarioError> {
        self.done = true;
        self.field.reset(&self.world, realization)?;
        self.uav = realization.start();
        self.terminal = realization.terminal();
        self.battery = realization.battery();
        self.rng = seed.rng(Stream::Slots);
        self.slots = 0;
        self.done = false;
        self.listen();
        Ok(())
    }

    /// Flies one slot, in this order:
    /// 1. The reachable device with the highest SNR at the *present* cell sends, at the SNR of the present observation.
    /// 2. The aircraft hovers or moves, and the battery loses the energy of the action.
    /// 3. The SNR of every device is drawn for the new cell.
    ///
    /// A *move* into the terminal ends the mission. Hovering there, as is possible at the start of RB, does not.
    ///
    /// # Errors
    /// See [`StepError`]. Safety is not checked.
    ///
    /// # Cost
    /// No allocation; well under a microsecond with 6 devices.
    pub fn step(&mut self, action: Action) -> Result<Step, StepError> {
        if self.done {
            return Err(StepError::Over);
        }
        let Some(next) = self.world.city().grid().step(self.uav, action) else {
            return Err(StepError::OffGrid { from: self.uav, action });
        };
        let energy = action.cost();
        if self.battery < energy {
            return Err(StepError::BatteryEmpty { at: self.uav });
        }
        let serving = self.field.serve(&self.world);
        self.uav = next;
        self.battery = self.battery - energy;
        self.slots += 1;
        self.done = action != Action::Hover && next == self.terminal;
        self.listen();
        Ok(Step {
            served: serving.map(|serving| serving.device),
            collected_units: serving.map_or(0.0, |serving| serving.collected_units),
            energy,
            done: self.done,
        })
    }

    /// The vector reward of a step of this episode (paper, eq. 12): data in percent of the initial data of all devices, and
    /// minus the energy in battery units.
    #[must_use]
    pub fn reward(&self, step: &Step) -> [f32; 2] {
        let initial_units = self.field.initial_units();
        let percent = if initial_units > 0.0 { 100.0 * step.collected_units / initial_units } else { 0.0 };
        [percent, -step.energy.0]
    }

    /// The world.
    #[must_use]
    pub const fn world(&self) -> &Arc<World> {
        &self.world
    }

    /// The devices, in the realization's order, with their SNR at [`Episode::uav`] in the present slot.
    #[must_use]
    pub fn devices(&self) -> &[Device] {
        self.field.devices()
    }

    /// The devices with their totals.
    #[must_use]
    pub const fn field(&self) -> &Field {
        &self.field
    }

    /// Where the aircraft is.
    #[must_use]
    pub const fn uav(&self) -> Cell {
        self.uav
    }

    /// A move into this cell ends the mission.
    #[must_use]
    pub const fn terminal(&self) -> Cell {
        self.terminal
    }

    /// Energy in the battery.
    #[must_use]
    pub const fn battery(&self) -> BatteryUnits {
        self.battery
    }

    /// Slots flown so far.
    #[must_use]
    pub const fn slots(&self) -> u32 {
        self.slots
    }

    /// Whether the mission is over.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        self.done
    }

    fn listen(&mut self) {
        self.field.listen(&self.world, self.uav, &mut self.rng);
    }
}
