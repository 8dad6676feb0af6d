//! The time of a whole decision with look-ahead, against the time between two decisions.

use super::Times;
use crate::args::Bench;
use crate::error::StartError;
use crate::load;
use gleaner_guard::Guard;
use gleaner_pilot::{Budget, Deliberator, LookingAhead, Place};
use gleaner_policy::{DeviceState, Preference, Situation, Tokens};
use gleaner_units::{Action, BatteryUnits, Cell, CellSet, Db, Grid, HeightMap, Metres, Rays};
use std::time::{Duration, Instant};

/// Numbers of devices.
const DEVICES: [usize; 2] = [6, 12];
/// Decisions of one mission; the battery lasts longer.
const DECISIONS: usize = 40;
const BATTERY_UNITS: f32 = 100.0;
/// Data that a slot carries from the served device, data units.
const SLOT_UNITS: f32 = 900.0;
/// A decision is due once a cell: 20 m at 10 m/s.
const PERIOD: Duration = Duration::from_secs(2);
/// The share of the period that a decision may take. The pilot sends no setpoint meanwhile, and PX4 needs several a second.
const SHARE: u32 = 10;

/// Prints the time of the decisions of a mission with each number of devices; whether all medians are short enough.
///
/// # Errors
/// The model is refused.
pub(super) fn time(order: &Bench) -> Result<bool, StartError> {
    let limit = PERIOD / SHARE;
    println!(
        "\none decision with look-ahead, {} tours: observation, network, plan and guard; ms",
        Budget::LINUX.tours
    );
    println!("devices    median   longest");
    let mut slowest = Duration::ZERO;
    for devices in DEVICES {
        let engine = load::model(order.model.as_deref(), None)?;
        let mut times = mission(LookingAhead::new(engine, Budget::LINUX), devices);
        let [median, longest] = [0.5, 1.0].map(|share| times.quantile(share));
        println!("{devices:7}{:10.2}{:10.2}", median.as_secs_f64() * 1e3, longest.as_secs_f64() * 1e3);
        slowest = slowest.max(median);
    }
    let is_fast = slowest <= limit;
    println!(
        "{}: a decision is due every {} ms (20 m at 10 m/s) and may take {} ms{}",
        if is_fast { "fast enough" } else { "too slow" },
        PERIOD.as_millis(),
        limit.as_millis(),
        if is_fast { "" } else { ": set GLN_LOOKAHEAD to 0, or use a faster computer" }
    );
    Ok(is_fast)
}

/// A city of 40 x 30 cells with a building on each third cell.
fn city() -> Option<HeightMap> {
    let grid = Grid::new(40, 30, Metres(20.0)).ok()?;
    let mut heights = HeightMap::flat(grid);
    for (index, cell) in grid.cells().enumerate().step_by(3) {
        heights.set(cell, 10 + (index % 40) as u8);
    }
    Some(heights)
}

/// Flies a mission; the time of each decision.
fn mission<D: Deliberator>(mut deliberator: D, count: usize) -> Times {
    let mut times = Times::default();
    let Some(heights) = city() else { return times };
    let sight = Rays { heights: &heights, altitude_m: 60 };
    let terminal = Cell::new(36, 20);
    let Ok(guard) = Guard::new(&CellSet::full(heights.grid()), terminal, BatteryUnits(2.0)) else {
        return times;
    };
    let place = |index: i16| Cell::new((7 * index + 3) % 40, (11 * index + 5) % 30);
    let mut devices: Vec<DeviceState> = (0..=i16::MAX)
        .take(count)
        .map(|index| DeviceState {
            cell: place(index),
            remaining: 6_000.0,
            snr: Some(Db(f32::from(index) - 4.0)),
        })
        .collect();
    deliberator.begin(Some(&sight), devices.iter().copied(), 1);
    let (mut cell, mut battery) = (Cell::new(4, 6), BatteryUnits(BATTERY_UNITS));
    for _ in 0..DECISIONS {
        let begun = Instant::now();
        let situation = Situation {
            cell,
            battery,
            spare: guard.spare(cell, battery).unwrap_or(battery),
            terminal,
            preference: Preference::DATA,
            sight: &sight,
            channel: deliberator.channel_for_tokens(),
        };
        let (tokens, _) = Tokens::build(&situation, devices.iter().copied());
        let mask = guard.mask(cell, battery);
        let logits = deliberator.infer(&tokens).map_or([0.0; Action::COUNT], |answer| answer.logits);
        let at = Place { cell, battery, preference: Preference::DATA, guard: &guard, sight: &sight };
        let choice = deliberator.propose(&at, devices.iter().copied(), &logits, mask, true);
        times.0.push(begun.elapsed());
        let action = choice.map_or(Action::Hover, |(action, _)| action);
        battery = BatteryUnits(battery.0 - if action == Action::Hover { 0.5 } else { 1.0 });
        cell = cell.after(action);
        // The next device in turn sends in this slot.
        if let Some(served) =
            devices.iter_mut().max_by(|one, other| one.remaining.total_cmp(&other.remaining))
        {
            served.remaining = (served.remaining - SLOT_UNITS).max(0.0);
        }
        if cell == terminal {
            break;
        }
    }
    times
}
