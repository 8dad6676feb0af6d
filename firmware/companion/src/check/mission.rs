//! The mission against the guard, the battery, the buildings, and what the policy was trained for.

use super::Findings;
use crate::load::Loaded;
use gleaner_guard::Guard;
use gleaner_link::Parameters;
use gleaner_pilot::Mission;
use gleaner_policy::K_MAX;
use gleaner_units::BatteryUnits;

/// What the shipped policy was trained with (the paper's system model): cell side, altitude, grid and battery.
const TRAINED_CELL_M: f32 = 20.0;
const TRAINED_ALTITUDE_M: f32 = 60.0;
const TRAINED_GRID: (u16, u16) = (40, 30);
const TRAINED_UNITS: std::ops::RangeInclusive<f32> = 50.0..=120.0;

pub(super) fn describe(mission: &Mission) -> String {
    let grid = mission.grid();
    format!(
        "{} x {} cells of {} m, {} inside the fence, {} devices with {} data units, terminal {}",
        grid.width(),
        grid.height(),
        grid.cell().0,
        mission.fence.len(),
        mission.devices.len(),
        mission.initial_data(),
        mission.terminal,
    )
}

pub(super) fn check(findings: &mut Findings, loaded: &Loaded, parameters: &Parameters) {
    let mission = &loaded.mission;
    heights(findings, loaded);
    let guard = match mission.guard(parameters.reserve()) {
        Ok(guard) => guard,
        Err(error) => return findings.bad("way home", format!("{error}: correct the mission")),
    };
    way_home(findings, mission, parameters, &guard);
    battery(findings, mission, parameters);
    altitude(findings, mission, parameters);
    roofs(findings, mission);
    training(findings, mission, parameters);
}

/// Heights with decimals are not a fault: surveys have them.
fn heights(findings: &mut Findings, Loaded { mission, rounded }: &Loaded) {
    if *rounded > 0 {
        let cells = mission.grid().len();
        findings.good(
            "heights",
            format!("{rounded} of {cells} had decimals and were rounded up to whole metres"),
        );
    }
}

fn way_home(findings: &mut Findings, mission: &Mission, parameters: &Parameters, guard: &Guard) {
    let (budget, reserve) = (mission.budget.0, parameters.reserve().0);
    let cells = || mission.grid().cells().filter(|&cell| mission.fence.contains(cell));
    let cut_off = cells().filter(|&cell| guard.distance(cell).is_none()).count();
    let covered = cells().filter(|&cell| guard.is_feasible(cell, mission.budget)).count();
    if cut_off > 0 {
        findings.bad("way home", format!("{cut_off} cells inside the fence are cut off from the terminal: widen the fence, or exclude them"));
    } else if covered == 0 {
        findings.bad("way home", format!("{budget} battery units do not cover the shortest way home and {reserve} in reserve: raise battery_units or lower GLN_RESERVE"));
    } else {
        let of = mission.fence.len();
        findings.good(
            "way home",
            format!("{budget} battery units, {reserve} in reserve: may engage over {covered} of {of} cells"),
        );
    }
    for device in &mission.devices {
        if guard.distance(device.cell).is_none() {
            findings.warn(
                "fence",
                format!(
                    "device {} at {} is outside the fence: it is served from a distance only",
                    device.id, device.cell
                ),
            );
        }
    }
}

fn battery(findings: &mut Findings, mission: &Mission, parameters: &Parameters) {
    let (budget, full) = (mission.budget, parameters.full_battery());
    if full.0 < budget.0 {
        return findings.bad("battery", format!("the mission takes {} units, a full battery is {}: lower battery_units or correct GLN_BAT_UNITS", budget.0, full.0));
    }
    let used = percent(budget, full);
    let left = 100.0 - used;
    findings.good(
        "battery",
        format!("the mission takes {used:.0} % of a full battery of {} units, {left:.0} % are left at the terminal", full.0),
    );
    // A descent from 60 m took 12.7 % on a real ArduCopter.
    if left < LANDING_PERCENT {
        findings.warn(
            "battery",
            format!("{left:.0} % may not cover the landing: lower battery_units, or measure GLN_BAT_UNITS"),
        );
    }
}

/// What a descent takes, rounded up.
const LANDING_PERCENT: f32 = 15.0;

fn percent(part: BatteryUnits, whole: BatteryUnits) -> f32 {
    100.0 * part.0 / whole.0
}

fn altitude(findings: &mut Findings, mission: &Mission, parameters: &Parameters) {
    let (altitude, tallest) = (parameters.altitude().0, mission.heights.highest().0);
    if altitude <= tallest {
        findings.bad(
            "altitude",
            format!("{altitude} m is not above the highest roof of {tallest} m: raise GLN_ALT"),
        );
    } else {
        findings.good("altitude", format!("{altitude} m, highest roof {tallest} m"));
    }
}

/// The mission file states the height where the terminal is on a building; without that it is refused.
fn roofs(findings: &mut Findings, mission: &Mission) {
    let height = |cell| mission.heights.height(cell).map_or(0.0, |height| height.0);
    let roof = height(mission.terminal);
    if roof > 0.0 {
        findings.warn(
            "terminal",
            format!("{} is on a building of {roof} m: the aircraft lands on its roof", mission.terminal),
        );
    }
    for device in mission.devices.iter().filter(|device| height(device.cell) > 0.0) {
        findings.warn(
            "device",
            format!(
                "device {} at {} is on a building of {} m: the channel model assumes the ground",
                device.id,
                device.cell,
                height(device.cell)
            ),
        );
    }
}

/// The policy decides in these cases as well; how well was not measured.
fn training(findings: &mut Findings, mission: &Mission, parameters: &Parameters) {
    let grid = mission.grid();
    let (cell_m, size) = (grid.cell().0, (grid.width(), grid.height()));
    if cell_m != TRAINED_CELL_M {
        findings.warn("cell size", format!("{cell_m} m: the policy was trained at {TRAINED_CELL_M} m"));
    }
    if size != TRAINED_GRID {
        let (width, height) = TRAINED_GRID;
        findings.warn(
            "grid",
            format!("{} x {} cells: the policy was trained on {width} x {height}", size.0, size.1),
        );
    }
    if parameters.altitude().0 != TRAINED_ALTITUDE_M {
        findings.warn(
            "altitude",
            format!("{} m: the policy was trained at {TRAINED_ALTITUDE_M} m", parameters.altitude().0),
        );
    }
    if !TRAINED_UNITS.contains(&mission.budget.0) {
        let (low, high) = (TRAINED_UNITS.start(), TRAINED_UNITS.end());
        findings.warn(
            "battery",
            format!("{} units: the policy was trained with {low} to {high}", mission.budget.0),
        );
    }
    let devices = mission.devices.len();
    if devices > K_MAX {
        findings.warn(
            "devices",
            format!("{devices}: the policy sees {K_MAX} at a time, those with the highest SNR"),
        );
    }
}
