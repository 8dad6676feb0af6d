//! Environment steps of the simulated world, with and without the policy's tokens.

use super::timing::{Contender, in_turns};
use anyhow::{Context, Result};
use gleaner_host_trainer::env::flight::Flight;
use gleaner_host_trainer::judge::evaluation::realizations;
use gleaner_policy::Preference;
use gleaner_units::Action;
use gleaner_world::{Episode, ScenarioKind, World};
use std::fmt::Write;
use std::hint::black_box;
use std::sync::Arc;

const REALIZATIONS: u64 = 16;
const REPETITIONS: usize = 100;
const STEPS: usize = 500;
/// Slots of a mission before its reset: fewer than the battery allows.
const MISSION_SLOTS: usize = 60;

/// Steps per second of RD with six devices on one thread.
pub(super) fn steps(page: &mut String) -> Result<()> {
    let world = Arc::new(World::default_world());
    let drawn = realizations(&world, &ScenarioKind::ReachDestination.scenario(), REALIZATIONS)?;
    let (seed, realization) = drawn.first().context("no realization")?;
    let mut episode = Episode::new(Arc::clone(&world), realization, *seed)?;
    let (mut slot, mut missions) = (0_usize, drawn.iter().cycle());
    let mut flown = drawn.iter().cycle();
    let begin = |(seed, realization): &(gleaner_world::Seed, gleaner_world::Realization)| {
        Flight::new(&world, realization, *seed, Preference::DATA)
    };
    let mut flight = begin(&drawn[0])?;
    let mut turn = 0_usize;
    let mut contenders: [Contender<'_>; 2] = [
        (
            "world",
            Box::new(|| {
                slot += 1;
                if slot.is_multiple_of(MISSION_SLOTS)
                    && let Some((seed, realization)) = missions.next()
                {
                    let _ = episode.reset(realization, *seed);
                }
                // Two slots of hovering, then out and back.
                let action = if slot.is_multiple_of(2) { Action::Hover } else { Action::MOVES[slot / 2 % 4] };
                let _ = black_box(episode.step(action));
            }),
        ),
        (
            "guard, tokens and world",
            Box::new(|| {
                if flight.is_over()
                    && let Some(Ok(next)) = flown.next().map(begin)
                {
                    flight = next;
                }
                turn += 1;
                black_box(flight.tokens());
                let mask = flight.mask();
                let allowed = u32::from(mask.len() as u8).max(1);
                if let Some(action) = mask.iter().nth(turn % allowed as usize) {
                    flight.step(action);
                }
            }),
        ),
    ];
    let times = in_turns(&mut contenders, REPETITIONS, STEPS);
    writeln!(page, "## World\n\nOne thread, RD, six devices, resets included.\n")?;
    writeln!(page, "| step | time | million steps/s |\n|---|---|---|")?;
    for ((name, _), times) in contenders.iter().zip(&times) {
        writeln!(page, "| {name} | {} | {:.3} |", times.text(), 1.0 / times.median())?;
    }
    Ok(())
}
