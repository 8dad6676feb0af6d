//! What the operator does differently on the two flight stacks.

use crate::autopilot::{AutopilotKind, VehicleMode};

/// Base mode of `DO_SET_MODE`: custom mode enabled.
const CUSTOM_MODE: f32 = 1.0;

/// Streams to ask for, with intervals in microseconds: positions, estimator, battery, power or home.
pub(super) const fn streams(kind: AutopilotKind) -> &'static [(f32, f32)] {
    match kind {
        AutopilotKind::ArduPilot => &[(33.0, 2e5), (193.0, 1e6), (147.0, 1e6), (1.0, 1e6)],
        AutopilotKind::Px4 => &[(33.0, 2e5), (230.0, 1e6), (242.0, 1e6), (147.0, 1e6)],
    }
}

/// Estimator flags that mean a trusted position. `ESTIMATOR_STATUS` has the bits of `EKF_STATUS_REPORT`; PX4 does not
/// set the relative ones with GNSS.
pub(super) const fn trusted_estimator(kind: AutopilotKind) -> u16 {
    match kind {
        AutopilotKind::ArduPilot => 0x33F,
        AutopilotKind::Px4 => 0x37,
    }
}

/// `NAV_TAKEOFF` parameter 7: above home for ArduPilot, above mean sea level for PX4.
pub(super) fn take_off_altitude_m(kind: AutopilotKind, height_m: f32, home_amsl_m: Option<f32>) -> f32 {
    match kind {
        AutopilotKind::ArduPilot => height_m,
        AutopilotKind::Px4 => home_amsl_m.unwrap_or(0.0) + height_m,
    }
}

/// `custom_mode` of GUIDED or OFFBOARD.
pub(super) fn guided(kind: AutopilotKind) -> u32 {
    VehicleMode::Guided.custom_mode(kind).unwrap_or(0)
}

/// Parameters 1, 2, 3 and 7 of `DO_SET_MODE` for GUIDED or OFFBOARD.
pub(super) fn select_guided(kind: AutopilotKind) -> [f32; 4] {
    let number = guided(kind);
    match kind {
        AutopilotKind::ArduPilot => [CUSTOM_MODE, number as f32, 0.0, 0.0],
        AutopilotKind::Px4 => [CUSTOM_MODE, (number >> 16 & 0xFF) as f32, (number >> 24) as f32, 0.0],
    }
}
