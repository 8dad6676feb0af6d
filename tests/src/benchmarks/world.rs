//! Environment steps of the simulated world, with and without the policy's tokens.

use super::timing::{Contender, in_turns};
use anyhow::Result;
use gleaner_host_trainer::env::flight::{Flight, SharedTable};
use gleaner_host_trainer::judge::evaluation::realizations;
use gleaner_policy::Preference;
use gleaner_units::Action;
use gleaner_world::{Episode, Realization, ScenarioKind, Seed, World};
use std::fmt::Write;
use std::hint::black_box;
use std::sync::Arc;

const REALIZATIONS: u64 = 16;
const REPETITIONS: usize = 100;
const STEPS: usize = 500;
/// Steps of one counted call.
pub(super) const COUNTED_STEPS: u64 = 100;
/// Slots of a mission before its reset: fewer than the battery allows.
const MISSION_SLOTS: usize = 60;

/// Missions of RD with six devices, one after the other.
struct Missions {
    world: Arc<World>,
    drawn: Vec<(Seed, Realization)>,
    table: SharedTable,
    next: usize,
    slot: usize,
}

impl Missions {
    fn new() -> Result<Missions> {
        let world = Arc::new(World::default_world());
        let drawn = realizations(&world, &ScenarioKind::ReachDestination.scenario(), REALIZATIONS)?;
        anyhow::ensure!(!drawn.is_empty(), "no realization");
        Ok(Missions { world, drawn, table: SharedTable::default(), next: 0, slot: 0 })
    }

    fn mission(&mut self) -> &(Seed, Realization) {
        self.next = (self.next + 1) % self.drawn.len();
        &self.drawn[self.next]
    }

    fn episode(&mut self) -> Result<Episode> {
        let world = Arc::clone(&self.world);
        let (seed, realization) = self.mission();
        Ok(Episode::new(world, realization, *seed)?)
    }

    fn flight(&mut self) -> Result<Flight> {
        let world = Arc::clone(&self.world);
        let (seed, realization) = self.mission();
        let flight = Flight::new(&world, realization, *seed, Preference::DATA)?;
        Ok(flight.with_table(&self.table))
    }

    /// One step of the world alone.
    fn step_episode(&mut self, episode: &mut Episode) {
        self.slot += 1;
        if self.slot.is_multiple_of(MISSION_SLOTS) {
            let (seed, realization) = self.mission();
            let _ = episode.reset(realization, *seed);
        }
        // Two slots of hovering, then out and back.
        let action =
            if self.slot.is_multiple_of(2) { Action::Hover } else { Action::MOVES[self.slot / 2 % 4] };
        let _ = black_box(episode.step(action));
    }

    /// One step of an episode of the learner: observation, mask, step.
    fn step_flight(&mut self, flight: &mut Flight) {
        if flight.is_over()
            && let Ok(next) = self.flight()
        {
            *flight = next;
        }
        self.slot += 1;
        black_box(flight.tokens());
        let mask = flight.mask();
        if let Some(action) = mask.iter().nth(self.slot % mask.len().max(1)) {
            flight.step(action);
        }
    }
}

/// Steps of the world alone.
pub(super) fn count_world(calls: u64) -> Result<()> {
    let mut missions = Missions::new()?;
    let mut episode = missions.episode()?;
    (0..COUNTED_STEPS * calls).for_each(|_| missions.step_episode(&mut episode));
    Ok(())
}

/// Steps of the learner's episodes.
pub(super) fn count(calls: u64) -> Result<()> {
    let mut missions = Missions::new()?;
    let mut flight = missions.flight()?;
    (0..COUNTED_STEPS * calls).for_each(|_| missions.step_flight(&mut flight));
    Ok(())
}

/// Steps per second of RD with six devices on one thread.
pub(super) fn steps(page: &mut String) -> Result<()> {
    let [mut first, mut second] = [Missions::new()?, Missions::new()?];
    let mut episode = first.episode()?;
    let mut flight = second.flight()?;
    let mut contenders = [
        Contender::ours("world", STEPS, || first.step_episode(&mut episode)),
        Contender::ours("guard, tokens and world", STEPS, || second.step_flight(&mut flight)),
    ];
    let times = in_turns(&mut contenders, REPETITIONS)?;
    writeln!(page, "## World\n\nOne thread, RD, six devices, resets included.\n")?;
    writeln!(page, "| step | time | million steps/s |\n|---|---|---|")?;
    for (contender, times) in contenders.iter().zip(&times) {
        writeln!(page, "| {} | {} | {:.3} |", contender.name, times.text(), 1.0 / times.median())?;
    }
    Ok(())
}
