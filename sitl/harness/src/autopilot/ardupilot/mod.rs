//! A simulated ArduCopter 4.6, after measurements on its own simulator.
//!
//! # What is reproduced
//! - **Streams**: unasked, a link carries heartbeats, texts, changed parameters, and origin and home once. Everything
//!   else needs `SET_MESSAGE_INTERVAL` or `REQUEST_DATA_STREAM` on that link, and then has exactly the requested rate.
//! - **Heartbeat**: 1 Hz, and at once on a mode change.
//! - **GUIDED**: a position target holds until it is replaced. Targets are never acknowledged. They are ignored outside
//!   GUIDED, when disarmed, and outside the fence. A target during the take-off climb replaces the take-off.
//! - **Modes**: a mode ends only by a command, the pilot or a failsafe. `DO_SET_MODE` GUIDED is accepted even during a
//!   failsafe: the companion must restrain itself.
//! - **Battery failsafe**: latched, once per level.
//! - **Estimator failsafe**: LAND one second after the estimator reports its position as untrusted (`FS_EKF_ACTION` 1;
//!   from ArduPilot's documentation, not measured).
//! - **NaN** in a target ends the simulation, as it ends ArduPilot's simulator ([`Truth::killed_by_nan`](super::Truth::killed_by_nan)).

mod modes;
mod requests;
mod stack;
mod targets;
mod telemetry;
#[cfg(test)]
mod tests;

use super::battery::Thresholds;
use super::guidance::Profile;
use super::motion::SpeedLimits;
use super::parameters::{Defaults, ParameterTable};
use super::vehicle::Vehicle;
use gleaner_units::Duration;
use mavlink::dialects::ardupilotmega::MavParamType::{
    MAV_PARAM_TYPE_INT8 as I8, MAV_PARAM_TYPE_INT16 as I16, MAV_PARAM_TYPE_INT32 as I32,
    MAV_PARAM_TYPE_REAL32 as F32,
};

/// Defaults of ArduCopter 4.6.
pub(super) const DEFAULTS: Defaults = &[
    ("SYSID_THISMAV", 1.0, I16),
    ("SYSID_MYGCS", 255.0, I16),
    ("WPNAV_SPEED", 1000.0, F32),
    ("WPNAV_SPEED_UP", 250.0, F32),
    ("WPNAV_SPEED_DN", 150.0, F32),
    ("WPNAV_ACCEL", 250.0, F32),
    ("WPNAV_RADIUS", 200.0, F32),
    ("LAND_SPEED", 50.0, I16),
    ("LAND_ALT_LOW", 1000.0, I16),
    ("RTL_ALT", 1500.0, I32),
    ("RTL_LOIT_TIME", 5000.0, I32),
    ("GUID_TIMEOUT", 3.0, F32),
    ("GUID_OPTIONS", 0.0, I32),
    ("DISARM_DELAY", 10.0, I8),
    ("ARMING_CHECK", 1.0, I32),
    ("FENCE_ENABLE", 0.0, I8),
    ("FENCE_TYPE", 7.0, I8),
    ("FENCE_RADIUS", 300.0, F32),
    ("FENCE_ALT_MAX", 100.0, F32),
    ("BATT_CAPACITY", 3300.0, I32),
    ("BATT_LOW_VOLT", 10.5, F32),
    ("BATT_LOW_TIMER", 10.0, I8),
    ("BATT_FS_LOW_ACT", 0.0, I8),
    ("BATT_CRT_VOLT", 0.0, F32),
    ("BATT_FS_CRT_ACT", 0.0, I8),
];

/// From `NAV_TAKEOFF` to leaving the ground: 29.0 s to 59 m were measured at 2.5 m/s.
const SPIN_UP: Duration = Duration::from_millis(3_300);

/// Parameters in the units that the simulation needs, kept beside the table so that a tick looks nothing up.
#[derive(Clone, Copy, Debug)]
struct Tuning {
    profile: Profile,
    thresholds: Thresholds,
    disarm_delay: Duration,
    fence: Option<Fence>,
}

#[derive(Clone, Copy, Debug)]
struct Fence {
    radius_m: Option<f64>,
    height_m: Option<f64>,
}

/// The simulated autopilot with its aircraft.
#[derive(Debug)]
pub(crate) struct ArduCopter {
    vehicle: Vehicle,
    tuning: Tuning,
    /// Horizontal speed in force, m/s.
    cruise_mps: f64,
    killed_by_nan: bool,
}

fn tuning(parameters: &ParameterTable) -> Tuning {
    let metres = |name| parameters.value(name) / 100.0;
    let seconds = |seconds: f64| Duration::from_secs_f32(seconds as f32);
    let kinds = parameters.value("FENCE_TYPE") as u32;
    Tuning {
        profile: Profile {
            limits: SpeedLimits {
                horizontal_mps: metres("WPNAV_SPEED"),
                up_mps: metres("WPNAV_SPEED_UP"),
                down_mps: metres("WPNAV_SPEED_DN"),
            },
            spin_up: SPIN_UP,
            target_timeout: seconds(parameters.value("GUID_TIMEOUT")),
            return_height_m: metres("RTL_ALT"),
            return_wait: seconds(parameters.value("RTL_LOIT_TIME") / 1000.0),
            land_slow_below_m: metres("LAND_ALT_LOW"),
            land_mps: metres("LAND_SPEED"),
            turns_to_course: true,
        },
        thresholds: Thresholds {
            low_v: parameters.value("BATT_LOW_VOLT") as f32,
            critical_v: parameters.value("BATT_CRT_VOLT") as f32,
            timer: seconds(parameters.value("BATT_LOW_TIMER")),
        },
        // Measured 10.4 s with the default of 10.
        disarm_delay: seconds(parameters.value("DISARM_DELAY") + 0.4),
        fence: (parameters.value("FENCE_ENABLE") != 0.0).then(|| Fence {
            radius_m: (kinds & 2 != 0).then(|| parameters.value("FENCE_RADIUS")),
            height_m: (kinds & 1 != 0).then(|| parameters.value("FENCE_ALT_MAX")),
        }),
    }
}
