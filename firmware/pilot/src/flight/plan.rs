//! Everything that must hold before the mission is engaged.

use crate::flight::ledger::{Ledger, charge, smaller};
use crate::{Inputs, Missing, Mission, Vehicle};
use gleaner_guard::Guard;
use gleaner_units::{BatteryUnits, Cell, GridFrame, Ned};

/// How far from `GLN_ALT` the aircraft may be. ArduCopter's take-off comes within 1 m; a target that is sent
/// during the climb would replace the take-off by a diagonal, so the climb must be over.
const ALTITUDE_TOLERANCE_M: f32 = 3.0;

/// What is settled when the mission is engaged, and holds until it ends: where the grid lies in the estimator's
/// frame, the altitude, the first cell and the account.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plan {
    pub(crate) frame: GridFrame,
    pub(crate) down_m: f32,
    pub(crate) cell: Cell,
    pub(crate) ledger: Ledger,
}

/// The plan if nothing is missing, else the first thing that is, in the order in which an operator sets them up.
pub(crate) fn check(mission: &Mission, guard: &Guard, inputs: &Inputs<'_>) -> Result<Plan, Missing> {
    let Inputs { vehicle, parameters, .. } = *inputs;
    if vehicle.mode.is_none() {
        return Err(Missing::Autopilot);
    }
    if vehicle.failsafe {
        return Err(Missing::FailsafeClear);
    }
    if inputs.engage_inhibited {
        return Err(Missing::Permission);
    }
    let origin = vehicle.origin.ok_or(Missing::Origin)?;
    let position = vehicle.position.filter(Ned::is_finite).ok_or(Missing::Position)?;
    if !vehicle.ready {
        return Err(Missing::Estimator);
    }
    let home_down_m = vehicle.home_down_m.ok_or(Missing::Home)?;
    let percent = vehicle.battery_percent.ok_or(Missing::Battery)?;
    let altitude = parameters.altitude();
    if altitude <= mission.heights.tallest() {
        return Err(Missing::SafeAltitude);
    }
    if !vehicle.armed {
        return Err(Missing::Armed);
    }
    if !vehicle.is_guided() {
        return Err(Missing::GuidedMode);
    }
    let down_m = home_down_m - altitude.0;
    let off_m = (position.down_m - down_m).abs();
    if off_m.is_nan() || off_m > ALTITUDE_TOLERANCE_M {
        return Err(Missing::Altitude);
    }
    let frame = GridFrame::new(mission.grid(), mission.corner, origin);
    let cell = frame.cell(&position).filter(|&cell| guard.distance(cell).is_some());
    let cell = cell.ok_or(Missing::InsideFence)?;
    let ledger = Ledger::open(percent, parameters.full_battery(), mission.budget);
    if !guard.is_feasible(cell, ledger.available(Some(percent), parameters.full_battery())) {
        return Err(Missing::EnoughBattery);
    }
    Ok(Plan { frame, down_m, cell, ledger })
}

/// What a flight from here could use: the measured charge within the mission's budget. For shadow mode, which
/// has no account because nothing that it decides is flown.
pub(crate) fn usable_battery(mission: &Mission, inputs: &Inputs<'_>) -> Option<BatteryUnits> {
    let percent = inputs.vehicle.battery_percent?;
    Some(smaller(charge(percent, inputs.parameters.full_battery()), mission.budget))
}

/// The cell under the aircraft and its offset from the centre, when both are known.
pub(crate) fn cell_under(mission: &Mission, vehicle: &Vehicle) -> Option<(Cell, f32)> {
    let frame = GridFrame::new(mission.grid(), mission.corner, vehicle.origin?);
    let position = vehicle.position?;
    let cell = frame.cell(&position)?;
    Some((cell, position.horizontal_distance(&frame.centre(cell, position.down_m)).0))
}
