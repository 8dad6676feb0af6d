//! A simulated PX4 1.18, after measurements on its own simulator (SIH quadrotor).
//!
//! # What is reproduced
//! - **Streams** come unasked on the companion link: position 30 Hz, attitude 100 Hz, power and landed state 5 Hz, GNSS
//!   8 Hz, battery and home 0.5 Hz. `SET_MESSAGE_INTERVAL` changes a rate. Texts go to the ground link only.
//! - **Heartbeat** at 1 Hz only: a mode change is seen up to a second late.
//! - **OFFBOARD** needs a stream of position targets. In the air without one, `DO_SET_MODE` is TEMPORARILY_REJECTED;
//!   disarmed it is ACCEPTED.
//! - **Loss of the stream** for `COM_OF_LOSS_T` leaves OFFBOARD for RTL (HOLD with `COM_OBL_RC_ACT` 5) with a
//!   failsafe. **When targets resume, it returns to OFFBOARD by itself.** After a mode change by the pilot it does not;
//!   `DO_SET_MODE` OFFBOARD is accepted then too.
//! - **Battery failsafe**: low 15 % warns, critical 7 % returns, emergency 5 % lands (`COM_LOW_BAT_ACT` 3).
//! - **NAV_TAKEOFF** takes the altitude above mean sea level, climbs in TAKEOFF and ends in HOLD.
//! - **DO_CHANGE_SPEED** is ACCEPTED and has no effect in OFFBOARD; `MPC_XY_VEL_MAX` has. The heading is kept.
//! - **Targets**: frame 9 is reported as unsupported and holds; NaN on an axis leaves the axis uncontrolled, and the
//!   aircraft drifts.
//! - **Integer parameters** travel as the raw bits of an int32 in the float field.
//! - **After landing** it stays in the mode in which it landed, disarmed; in OFFBOARD without a stream it refuses to
//!   arm.

mod modes;
mod requests;
mod stack;
mod targets;
mod telemetry;
#[cfg(test)]
mod tests;

use super::guidance::Profile;
use super::motion::SpeedLimits;
use super::parameters::{Defaults, ParameterTable};
use super::vehicle::Vehicle;
use gleaner_units::{Duration, Instant};
use mavlink::dialects::ardupilotmega::MavParamType::{
    MAV_PARAM_TYPE_INT32 as I32, MAV_PARAM_TYPE_REAL32 as F32,
};

/// Defaults of PX4 1.18 on its SIH quadrotor.
pub(super) const DEFAULTS: Defaults = &[
    ("MAV_SYS_ID", 1.0, I32),
    ("COM_OF_LOSS_T", 1.0, F32),
    ("COM_OBL_RC_ACT", 0.0, I32),
    ("COM_LOW_BAT_ACT", 3.0, I32),
    ("BAT_LOW_THR", 0.15, F32),
    ("BAT_CRIT_THR", 0.07, F32),
    ("BAT_EMERGEN_THR", 0.05, F32),
    ("MPC_XY_VEL_MAX", 12.0, F32),
    ("MPC_Z_VEL_MAX_UP", 3.1, F32),
    ("MPC_Z_VEL_MAX_DN", 1.5, F32),
    ("MPC_LAND_SPEED", 0.65, F32),
    ("MPC_LAND_ALT2", 12.0, F32),
    ("RTL_RETURN_ALT", 60.0, F32),
    ("RTL_LAND_DELAY", 0.0, F32),
    ("COM_DISARM_PRFLT", 10.0, F32),
    ("GF_ACTION", 2.0, I32),
    ("GF_MAX_HOR_DIST", 0.0, F32),
];

/// From the take-off command to leaving the ground: 30.3 s to 60 m were measured.
const SPIN_UP: Duration = Duration::from_millis(8_450);
/// Ground speed never exceeded 10.1 m/s on a leg of 200 m, with `MPC_XY_VEL_MAX` 12.
const FASTEST_LEG_MPS: f64 = 10.1;

/// Parameters in the units that the simulation needs, kept beside the table so that a tick looks nothing up.
#[derive(Clone, Copy, Debug)]
struct Tuning {
    profile: Profile,
    loss_time: Duration,
    loss_action: u32,
    battery_levels: [f64; 3],
    battery_action: u32,
    disarm_delay: Duration,
    fence_radius_m: f64,
}

/// The simulated autopilot with its aircraft.
#[derive(Debug)]
pub(crate) struct Px4 {
    vehicle: Vehicle,
    tuning: Tuning,
    /// The last position target of any kind, from the companion or from a ground station.
    target_at: Option<Instant>,
    /// OFFBOARD was left because the targets stopped: resuming targets bring it back.
    offboard_lost: bool,
    /// A failsafe is active, reported by the heartbeat.
    failsafe: bool,
}

fn tuning(parameters: &ParameterTable) -> Tuning {
    let seconds = |name| Duration::from_secs_f32(parameters.value(name) as f32);
    Tuning {
        profile: Profile {
            limits: SpeedLimits {
                horizontal_mps: parameters.value("MPC_XY_VEL_MAX").min(FASTEST_LEG_MPS),
                up_mps: parameters.value("MPC_Z_VEL_MAX_UP"),
                down_mps: parameters.value("MPC_Z_VEL_MAX_DN"),
            },
            spin_up: SPIN_UP,
            // A target older than COM_OF_LOSS_T ends OFFBOARD, so that its velocity never times out before.
            target_timeout: seconds("COM_OF_LOSS_T"),
            return_height_m: parameters.value("RTL_RETURN_ALT"),
            return_wait: seconds("RTL_LAND_DELAY"),
            land_slow_below_m: parameters.value("MPC_LAND_ALT2"),
            land_mps: parameters.value("MPC_LAND_SPEED"),
            turns_to_course: false,
        },
        loss_time: seconds("COM_OF_LOSS_T"),
        loss_action: parameters.value("COM_OBL_RC_ACT") as u32,
        battery_levels: ["BAT_LOW_THR", "BAT_CRIT_THR", "BAT_EMERGEN_THR"].map(|name| parameters.value(name)),
        battery_action: parameters.value("COM_LOW_BAT_ACT") as u32,
        disarm_delay: seconds("COM_DISARM_PRFLT"),
        fence_radius_m: parameters.value("GF_MAX_HOR_DIST"),
    }
}
