//! The script of a flight: preference, its changes, and incidents.

use crate::autopilot::{AircraftFault, VehicleMode};
use crate::intruder::Intrusion;
use crate::line::LineFault;
use crate::operator::Switch;
use crate::radio_fault::RadioFault;
use gleaner_units::{BatteryUnits, Duration};
use std::fmt;

/// Preference, switches and incidents of a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct FlightScript {
    /// Weight of data at the start.
    pub preference: f32,
    /// Changes of the preference, in order of time.
    pub switches: Vec<Switch>,
    /// Incidents, in order of time.
    pub incidents: Vec<Incident>,
}

impl FlightScript {
    /// One preference for the whole flight, no incidents.
    #[must_use]
    pub const fn plain(preference: f32) -> FlightScript {
        FlightScript { preference, switches: Vec::new(), incidents: Vec::new() }
    }
}

/// Something that goes wrong during a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incident {
    /// Time after the first decision.
    pub after: Duration,
    /// What goes wrong.
    pub kind: IncidentKind,
}

/// A fault of the companion computer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ComputerFault {
    /// The program does not run for this time, as after SIGSTOP. What arrives meanwhile waits in the socket.
    Stall(Duration),
    /// The program ends and is started again after this time.
    Restart(Duration),
}

/// The kinds of incidents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum IncidentKind {
    /// A fault of the aircraft or its autopilot, or an action of the human pilot.
    Aircraft(AircraftFault),
    /// The line between companion and autopilot fails for this time.
    Line(LineFault, Duration),
    /// The radio fails for this time.
    Radio(RadioFault, Duration),
    /// The companion computer fails.
    Computer(ComputerFault),
    /// Another participant joins the network for this time.
    Intrusion(Intrusion, Duration),
}

impl IncidentKind {
    /// The fault class, as in the sweep's table.
    #[must_use]
    pub const fn class(&self) -> &'static str {
        match self {
            IncidentKind::Aircraft(fault) => match fault {
                AircraftFault::PilotSelects(_) => "pilot takes over",
                AircraftFault::Fence(_) => "fence",
                AircraftFault::Voltage(_) => "low voltage",
                AircraftFault::ChargeLost(_) => "charge lost",
                AircraftFault::BatteryUnknown(_) => "battery unknown",
                AircraftFault::Consumption(_) => "consumption",
                AircraftFault::Wind(_) => "wind",
                AircraftFault::Reboot => "autopilot reboots",
                AircraftFault::EstimatorUntrusted(_) => "estimator fails",
                AircraftFault::OriginShift(_) => "origin shift",
                AircraftFault::PositionJump(..) => "position jump",
                AircraftFault::AltitudeLoss(_) => "altitude loss",
            },
            IncidentKind::Line(fault, _) => match fault {
                LineFault::Cut(None) => "line cut",
                LineFault::Cut(Some(_)) => "one-way cut",
                LineFault::Noise(_) => "line noise",
                LineFault::Delay(_) => "delay",
                LineFault::Duplication(_) => "duplication",
                LineFault::Reordering(_) => "reordering",
                LineFault::AcksLost => "lost ACK",
            },
            IncidentKind::Radio(fault, _) => match fault {
                RadioFault::Silent => "radio silent",
                RadioFault::Stale(_) => "radio stale",
                RadioFault::Repeated(_) => "radio repeated",
                RadioFault::LyingEmpty | RadioFault::LyingFull | RadioFault::LyingStrong => "radio lying",
                RadioFault::Unknown(_) => "radio unknown ids",
            },
            IncidentKind::Computer(ComputerFault::Stall(_)) => "loop stall",
            IncidentKind::Computer(ComputerFault::Restart(_)) => "restart in flight",
            IncidentKind::Intrusion(intrusion, _) => match intrusion {
                Intrusion::SecondVehicle => "second vehicle",
                Intrusion::OtherStation(_) => "second station",
                Intrusion::Hostile => "hostile packets",
                Intrusion::ParameterStorm => "parameter storm",
                Intrusion::Retransmission => "retransmission",
            },
        }
    }

    /// Battery units that the incident takes beyond what the decisions pay for: a reserve of this size brings the
    /// aircraft home.
    pub(crate) const fn cost(&self) -> BatteryUnits {
        match self {
            IncidentKind::Aircraft(AircraftFault::ChargeLost(units)) => *units,
            // Some slots of waiting, and from the far end of RD back to the start.
            IncidentKind::Aircraft(AircraftFault::Fence(_))
            | IncidentKind::Line(LineFault::Cut(_) | LineFault::Noise(_), _) => BatteryUnits(38.0),
            _ => BatteryUnits(0.0),
        }
    }

    /// The human pilot selects a mode.
    #[must_use]
    pub const fn pilot_selects(mode: VehicleMode) -> IncidentKind {
        IncidentKind::Aircraft(AircraftFault::PilotSelects(mode))
    }
}

impl fmt::Display for IncidentKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            IncidentKind::Aircraft(fault) => write_aircraft(f, fault),
            IncidentKind::Line(fault, lasts) => write!(f, "{fault}, for {}", Seconds(*lasts)),
            IncidentKind::Radio(fault, lasts) => write!(f, "{fault}, for {}", Seconds(*lasts)),
            IncidentKind::Computer(ComputerFault::Stall(lasts)) => {
                write!(f, "the companion program stops for {}", Seconds(*lasts))
            }
            IncidentKind::Computer(ComputerFault::Restart(after)) => {
                write!(f, "the companion program ends and starts again after {}", Seconds(*after))
            }
            IncidentKind::Intrusion(intrusion, lasts) => write!(f, "{intrusion}, for {}", Seconds(*lasts)),
        }
    }
}

struct Seconds(Duration);

impl fmt::Display for Seconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1} s", self.0.as_secs_f32())
    }
}

fn write_aircraft(f: &mut fmt::Formatter<'_>, fault: &AircraftFault) -> fmt::Result {
    match fault {
        AircraftFault::PilotSelects(mode) => write!(f, "the pilot selects {}", mode.name()),
        AircraftFault::Fence(radius_m) => write!(f, "a fence of {radius_m} m around home is enabled"),
        AircraftFault::Voltage(volts) => write!(f, "the voltage drops to {volts} V"),
        AircraftFault::ChargeLost(units) => write!(f, "the pack loses {} battery units", units.0),
        AircraftFault::BatteryUnknown(lasts) => {
            write!(f, "the battery percentage is unknown for {}", Seconds(*lasts))
        }
        AircraftFault::Consumption(factor) => write!(f, "flying takes {factor} times the nominal power"),
        AircraftFault::Wind(wind) => {
            let [north, east] = wind.velocity_mps;
            let gust = wind.gust_mps;
            write!(f, "wind of {north:.1} m/s north, {east:.1} m/s east, gusts of {gust:.1} m/s")
        }
        AircraftFault::Reboot => write!(f, "the autopilot reboots"),
        AircraftFault::EstimatorUntrusted(lasts) => {
            write!(f, "the estimator reports its position as untrusted for {}", Seconds(*lasts))
        }
        AircraftFault::OriginShift([north, east]) => {
            write!(f, "the estimator's origin moves {north:.0} m north, {east:.0} m east")
        }
        AircraftFault::PositionJump([north, east], lasts) => {
            write!(
                f,
                "the position estimate is off by {north:.0} m north, {east:.0} m east for {}",
                Seconds(*lasts)
            )
        }
        AircraftFault::AltitudeLoss(metres) => write!(f, "the aircraft sinks by {metres} m"),
    }
}
