//! Simulated autopilots: an ArduCopter 4.6 and a PX4 1.18, as a companion computer and a ground station see them.
//!
//! Both sit behind the trait [`Autopilot`] and share the airframe (motion, battery, wind, estimator errors), the
//! MAVLink ports with their routing and streams, and the parameter table. What differs between the two, such as
//! modes, refusals, failsafes and what is sent unasked, is in [`ardupilot`] and [`px4`]. Each of these modules lists
//! the measured behaviour that it reproduces.
//!
//! # Not simulated
//! Attitude, sensors, missions, geofence breach actions, sticks. The human pilot is simulated by
//! [`Autopilot::pilot_selects`], with centred sticks.
//!
//! # Time
//! All times inside an autopilot are its own clock, zero at its boot. [`Autopilot::step`] advances it; the argument
//! counts from the first boot.

mod airframe;
pub(crate) mod ardupilot;
mod battery;
mod fault;
mod guidance;
mod messages;
mod mode;
mod motion;
mod parameters;
mod ports;
pub(crate) mod px4;
mod requests;
mod simulated;
mod stack;
mod streams;
mod targets;
mod telemetry;
#[cfg(test)]
mod testbench;
mod vehicle;

pub use battery::{EnergyModel, Pack};
pub use fault::{AircraftFault, Wind};
pub use mode::VehicleMode;

use gleaner_units::{BatteryUnits, GeoPoint, Instant, Ned};
use std::fmt;
use std::str::FromStr;

/// Which flight stack is simulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum AutopilotKind {
    /// ArduCopter 4.6.3.
    #[default]
    ArduPilot,
    /// PX4 1.18.
    Px4,
}

impl AutopilotKind {
    /// Both kinds.
    pub const ALL: [AutopilotKind; 2] = [AutopilotKind::ArduPilot, AutopilotKind::Px4];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            AutopilotKind::ArduPilot => "ardupilot",
            AutopilotKind::Px4 => "px4",
        }
    }

    /// A simulated autopilot of this kind at boot, on the ground.
    #[must_use]
    pub fn boot(self, settings: AircraftSettings) -> Box<dyn Autopilot> {
        match self {
            AutopilotKind::ArduPilot => Box::new(simulated::power_on::<ardupilot::ArduCopter>(settings)),
            AutopilotKind::Px4 => Box::new(simulated::power_on::<px4::Px4>(settings)),
        }
    }
}

impl fmt::Display for AutopilotKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for AutopilotKind {
    type Err = String;

    fn from_str(name: &str) -> Result<AutopilotKind, String> {
        let kind = AutopilotKind::ALL.into_iter().find(|kind| kind.name() == name);
        kind.ok_or_else(|| format!("unknown autopilot {name}: use ardupilot or px4"))
    }
}

/// One of the autopilot's MAVLink ports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LinkId(pub(crate) usize);

impl LinkId {
    /// The companion computer's port.
    pub const COMPANION: LinkId = LinkId(0);
    /// The ground station's port.
    pub const GROUND: LinkId = LinkId(1);
    /// The harness's own port, for the scripted operator when the ground port belongs to a real ground station.
    pub const CREW: LinkId = LinkId(2);
    /// All ports.
    pub const ALL: [LinkId; 3] = [LinkId::COMPANION, LinkId::GROUND, LinkId::CREW];

    /// What commands through this port.
    pub(crate) fn commander(self) -> Commander {
        if self == LinkId::COMPANION { Commander::Companion } else { Commander::Operator }
    }
}

/// Constants of the simulated aircraft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AircraftSettings {
    /// MAVLink system id.
    pub system_id: u8,
    /// Geographic position of the estimator's origin.
    pub origin: GeoPoint,
    /// Where the aircraft stands at boot, in the estimator's frame; down is the ground's.
    pub stand: Ned,
    /// Battery.
    pub pack: Pack,
    /// Standard deviation of the slow wander of the position estimate on each axis, m; 0 for none.
    pub wander_m: f32,
    /// Seed of the wander and of the gusts.
    pub seed: u64,
}

/// What put the autopilot into its present mode or gave it its present target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Commander {
    /// The program on the companion port.
    Companion,
    /// The human pilot or a ground station.
    Operator,
    /// The autopilot itself: a failsafe, or the end of a take-off.
    Autopilot,
}

/// Ground truth for the referee. None of it is sent over MAVLink.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// True position, in the estimator's frame as it was at boot.
    pub position: Ned,
    /// Ground speed, m/s.
    pub ground_speed_mps: f32,
    /// Height above the take-off point, m.
    pub height_m: f32,
    /// Whether the motors are armed.
    pub armed: bool,
    /// Whether the aircraft stands on the ground.
    pub on_ground: bool,
    /// Flight mode.
    pub mode: VehicleMode,
    /// Who selected the mode.
    pub mode_by: Commander,
    /// Who sent the position target in force; `None` without one.
    pub target_by: Option<Commander>,
    /// Battery left.
    pub battery: BatteryUnits,
    /// A non-finite position target ended the simulated autopilot, as it ends ArduPilot's own simulator.
    pub killed_by_nan: bool,
    /// Whether the autopilot sends anything: not while it boots.
    pub is_up: bool,
    /// Position targets that were ignored: wrong mode, not flying, or outside the fence.
    pub ignored_targets: u32,
}

/// A simulated autopilot with its aircraft: bytes in, bytes out, on virtual time.
pub trait Autopilot: fmt::Debug + Send {
    /// Advances time to `now`, in ticks of 20 ms.
    fn step(&mut self, now: Instant);

    /// Bytes that arrive on a link, in any pieces. They take effect at once.
    fn receive(&mut self, link: LinkId, bytes: &[u8]);

    /// The frames that left on a link since the last call, in order.
    fn transmit(&mut self, link: LinkId) -> Vec<Vec<u8>>;

    /// The human pilot turns the mode switch.
    fn pilot_selects(&mut self, mode: VehicleMode);

    /// Injects a fault.
    fn inject(&mut self, fault: AircraftFault);

    /// Sets one of the autopilot's own parameters, as a ground crew does before the flight. Whether it exists.
    fn set_parameter(&mut self, name: &str, value: f32) -> bool;

    /// Ground truth.
    fn truth(&self) -> Truth;

    /// Constants of the aircraft.
    fn settings(&self) -> &AircraftSettings;
}
