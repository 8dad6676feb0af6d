//! What the autopilot says, in our words. Wire scaling is undone before it gets here.

use gleaner_units::{BatteryUnits, GeoPoint, Instant, Ned};

/// Whose rules apply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Autopilot {
    /// ArduCopter: position targets are remembered for ever.
    ArduPilot,
    /// PX4: position targets must stream, also before OFFBOARD.
    Px4,
}

/// The flight mode, as far as the pilot must tell them apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// GUIDED or OFFBOARD: the autopilot follows our targets.
    Guided,
    /// The autopilot lands.
    Land,
    /// The autopilot returns to its home.
    Return,
    /// Anything else: the human pilot has the aircraft.
    Other,
}

/// The latest of everything the autopilot said. A value with an [`Instant`] ages; the others hold until told
/// otherwise. Absent is `None`.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Vehicle {
    /// From the heartbeat.
    pub autopilot: Option<Autopilot>,
    /// When the last heartbeat came.
    pub heard: Option<Instant>,
    /// Flight mode of the last heartbeat.
    pub mode: Option<Mode>,
    /// Whether the motors are armed.
    pub armed: bool,
    /// Whether any failsafe is latched (`system_status` critical or worse, or battery `charge_state` low or worse).
    pub failsafe: bool,
    /// Whether the autopilot says that it stands on the ground.
    pub landed: Option<bool>,
    /// Position in the estimator's frame.
    pub position: Option<(Instant, Ned)>,
    /// Whether the estimator trusts its position.
    pub estimator_healthy: Option<(Instant, bool)>,
    /// The estimator's origin.
    pub origin: Option<GeoPoint>,
    /// Home (the take-off point) in the estimator's frame.
    pub home: Option<Ned>,
    /// Battery left, whole percent, truncated.
    pub battery_percent: Option<(Instant, u8)>,
}

impl Vehicle {
    /// Battery units that the autopilot's percentage certainly still holds, `percent / 100 * full`.
    #[must_use]
    pub fn battery(&self, full: BatteryUnits) -> Option<BatteryUnits> {
        self.battery_percent.map(|(_, percent)| full * (f32::from(percent.min(100)) / 100.0))
    }
}
