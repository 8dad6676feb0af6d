//! Everything that must hold before the mission is engaged.

use crate::Missing;
use crate::RadioActivity;
use crate::flight::energy::Energy;
use crate::scene::Scene;
use gleaner_units::{BatteryUnits, Cell, GeoPoint, GridFrame, Instant, Ned};

/// How far from `GLN_ALT` the aircraft may be. ArduCopter's take-off comes within 1 m; a target that is sent
/// during the climb would replace the take-off by a diagonal, so the climb must be over.
const ALTITUDE_TOLERANCE_M: f32 = 3.0;

/// What is settled when the mission is engaged, and holds until it ends: where the grid lies in the estimator's
/// frame, the altitude, the first cell and the battery that it may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plan {
    pub(crate) frame: GridFrame,
    pub(crate) origin: GeoPoint,
    pub(crate) down_m: f32,
    pub(crate) cell: Cell,
    pub(crate) battery: BatteryUnits,
}

/// The plan if nothing is missing, else the first thing that is, in the order in which an operator sets them up.
/// `requested_at`: when the operator requested it.
pub(crate) fn check(scene: &Scene<'_>, energy: &Energy, requested_at: Instant) -> Result<Plan, Missing> {
    let (vehicle, parameters) = (scene.vehicle(), scene.inputs.parameters);
    if vehicle.mode.is_none() {
        return Err(Missing::Autopilot);
    }
    if scene.inputs.engage_inhibited {
        return Err(Missing::Permission);
    }
    let origin = vehicle.origin.ok_or(Missing::Origin)?;
    let position = vehicle.position.filter(Ned::is_finite).ok_or(Missing::Position)?;
    if !vehicle.ready {
        return Err(Missing::Estimator);
    }
    let home_down_m = vehicle.home_down_m.ok_or(Missing::Home)?;
    let percent = vehicle.battery_percent.ok_or(Missing::Battery)?;
    if scene.inputs.radio == RadioActivity::default() {
        return Err(Missing::Radio);
    }
    let altitude = parameters.altitude();
    if altitude.0 - ALTITUDE_TOLERANCE_M < scene.mission.heights.highest().0 {
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
    let frame = GridFrame::new(scene.mission.grid(), scene.mission.pose, origin);
    let cell = frame.cell(&position).filter(|&cell| scene.guard.distance(cell).is_some());
    let cell = cell.ok_or(Missing::InsideFence)?;
    let battery = energy.offered(scene, percent);
    if !scene.guard.is_feasible(cell, battery) {
        return Err(Missing::EnoughBattery);
    }
    if !scene.is_ours_since(requested_at) {
        return Err(Missing::Heartbeat);
    }
    Ok(Plan { frame, origin, down_m, cell, battery })
}
