//! Faults of the aircraft and its autopilot that a trial can inject.

use super::VehicleMode;
use gleaner_units::{BatteryUnits, Duration};

/// Steady wind with gusts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wind {
    /// Velocity of the air, m/s north and east.
    pub velocity_mps: [f32; 2],
    /// Standard deviation of the gusts on each axis, m/s.
    pub gust_mps: f32,
}

/// A fault of the aircraft, its sensors or its autopilot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AircraftFault {
    /// The supply fails for a moment: the motors stop, the aircraft drops, the autopilot boots again.
    Reboot,
    /// The pack's voltage changes to this, volts.
    Voltage(f32),
    /// The pack loses charge.
    ChargeLost(BatteryUnits),
    /// The battery percentage is unknown for this time: the autopilot reports -1.
    BatteryUnknown(Duration),
    /// Flying takes this many times the nominal power.
    Consumption(f32),
    /// The wind changes.
    Wind(Wind),
    /// The estimator reports its position as untrusted for this time.
    EstimatorUntrusted(Duration),
    /// The estimator's origin moves by metres north and east: from now on, the same local coordinates are another
    /// place.
    OriginShift([f32; 2]),
    /// The position estimate is off by these metres north and east for this time, as after a GNSS jump.
    PositionJump([f32; 2], Duration),
    /// The aircraft sinks by this height, m, before its controller recovers.
    AltitudeLoss(f32),
    /// A circular fence of the autopilot around home is enabled, radius in metres.
    Fence(f32),
    /// The human pilot turns the mode switch.
    PilotSelects(VehicleMode),
}
