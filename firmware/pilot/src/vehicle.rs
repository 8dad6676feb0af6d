//! What the machine knows of the autopilot, with ages already applied.

use gleaner_link::{Autopilot, Firmware, FlightMode, LandedState};
use gleaner_units::{Duration, GeoPoint, Instant, Ned};

/// Positions come at 10 Hz; two seconds without one are no jitter of the link.
const POSITION_AGE: Duration = Duration::from_secs(2);
/// PX4 sends its battery every two seconds unasked; a charge does not change much in ten.
const BATTERY_AGE: Duration = Duration::from_secs(10);

/// A snapshot of the autopilot.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Vehicle {
    /// Whose rules apply; `None` before the first heartbeat.
    pub firmware: Option<Firmware>,
    /// Mode of the last heartbeat; `None` when none came for five seconds.
    pub mode: Option<FlightMode>,
    /// When the last heartbeat arrived; `None` when none came for five seconds.
    pub heartbeat_at: Option<Instant>,
    /// Whether the motors are armed, as of the last heartbeat.
    pub armed: bool,
    /// Whether any failsafe is latched.
    pub failsafe: bool,
    /// Whether the autopilot reports that it stands on the ground.
    pub on_ground: bool,
    /// Whether the estimator trusts itself, the position is fresh (1 s) and the origin is known.
    pub ready: bool,
    /// Position in the estimator's frame, if reported within two seconds.
    pub position: Option<Ned>,
    /// The autopilot's clock at the last position, ms since it started.
    pub boot_ms: Option<u32>,
    /// Where the estimator's origin is.
    pub origin: Option<GeoPoint>,
    /// Home below the estimator's origin, m.
    pub home_down_m: Option<f32>,
    /// Battery left, whole percent, truncated.
    pub battery_percent: Option<u8>,
    /// Charge drawn from the battery since the autopilot started, mAh.
    pub battery_drawn_mah: Option<u32>,
}

impl Vehicle {
    /// The snapshot at `now`.
    #[must_use]
    pub fn observe(now: Instant, autopilot: &Autopilot) -> Vehicle {
        let origin = autopilot.origin();
        Vehicle {
            firmware: autopilot.firmware(),
            mode: autopilot.mode(),
            heartbeat_at: autopilot.heartbeat_at(),
            armed: autopilot.is_armed(),
            failsafe: autopilot.failsafe().is_some(),
            on_ground: autopilot.landed() == LandedState::OnGround,
            ready: autopilot.is_ready(now),
            position: autopilot.position(now, POSITION_AGE).map(|reported| reported.position),
            boot_ms: autopilot.boot_ms(),
            origin: origin.map(|origin| origin.point),
            // From the two altitudes: ArduPilot fills HOME_POSITION's local fields with zeros.
            home_down_m: origin.zip(autopilot.home()).map(|(origin, home)| {
                (f64::from(origin.altitude_amsl_mm) - f64::from(home.altitude_amsl_mm)) as f32 * 1e-3
            }),
            battery_percent: autopilot.battery_percent(now, BATTERY_AGE),
            battery_drawn_mah: autopilot.battery_drawn_mah(now, BATTERY_AGE),
        }
    }

    /// Whether heartbeats arrive and show a mode in which targets are obeyed.
    #[must_use]
    pub fn is_guided(&self) -> bool {
        self.mode.is_some_and(FlightMode::companion_may_steer)
    }

    /// Whether heartbeats arrive and show that the autopilot lands or returns by itself.
    #[must_use]
    pub const fn is_landing_or_returning(&self) -> bool {
        matches!(self.mode, Some(FlightMode::Land | FlightMode::Return))
    }

    /// Whether a heartbeat shows a mode in which someone else has the aircraft. Silence shows nothing.
    #[must_use]
    pub fn is_taken(&self) -> bool {
        self.mode.is_some_and(|mode| !mode.companion_may_steer())
    }
}
