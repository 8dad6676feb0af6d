//! One mission on the grid, slot by slot.

use crate::field::{Device, Field};
use crate::{Realization, ScenarioError, Seed, Stream, World};
use gleaner_units::{Action, BatteryUnits, Cell};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use thiserror::Error;

/// A mission being flown on the grid.
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

/// What one slot brought and cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Index of the device that was served, if one was.
    pub served: Option<usize>,
    /// What it sent, data units.
    pub collected_units: f32,
    /// What the action took from the battery.
    pub energy: BatteryUnits,
    /// Whether the mission is over.
    pub done: bool,
}

/// Why an action could not be flown. The episode is as it was before.
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
        /// What it was told.
        action: Action,
    },
    /// The battery holds less than the action takes.
    #[error("the battery is empty at {at}, away from the terminal")]
    BatteryEmpty {
        /// Where the aircraft is.
        at: Cell,
    },
}

impl Episode {
    /// Puts the aircraft at the start and hears every device for the first time. `seed` names the shadowing.
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

    /// Like [`Episode::new`] in the same world, in the memory of this one.
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

    /// Flies one slot. In this order: the device that is heard best at the *present* cell is served, with the SNR that
    /// the observation shows; the aircraft hovers or moves; the battery pays; every device is heard anew at the
    /// new cell. A *move* into the terminal ends the mission; hovering there, as RB may at its start, does not.
    ///
    /// # Errors
    /// See [`StepError`]. Whether an action is wise is not checked.
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

    /// The vector reward of a step of this episode (paper, eq. 12): data in percent of what all devices held at the
    /// start, and minus the energy in battery units.
    #[must_use]
    pub fn reward(&self, step: &Step) -> [f32; 2] {
        let initial_units = self.field.initial_units();
        let percent = if initial_units > 0.0 { 100.0 * step.collected_units / initial_units } else { 0.0 };
        [percent, -step.energy.0]
    }

    /// The world that it is flown in.
    #[must_use]
    pub const fn world(&self) -> &Arc<World> {
        &self.world
    }

    /// The devices, in the realization's order, as heard at [`Episode::uav`] in the present slot.
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

    /// What the battery holds.
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
