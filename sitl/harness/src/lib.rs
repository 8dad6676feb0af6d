//! Simulated autopilots, radio and city around the *unchanged* pilot, and the program `gleaner-sitl`.
//!
//! With the pilot in this process everything below the program runs on virtual time: a mission of ten minutes takes a
//! fraction of a second, and the same seed gives the same bytes. A pilot behind byte streams ([`Wired`]: a board, an
//! emulator, a companion computer) has its own clock, so the simulation then follows the wall clock ([`Pace`]).
//!
//! ```text
//!  Operator --bytes--> +--------------------- Simulation ----------------------+ --bytes--> Companion
//!  (ground station)    | Autopilot (ArduCopter or PX4): motion, battery, ports |   (the pilot as it flies)
//!           <--bytes-- | Modem: devices, channel, reports   Referee   Journal  | <--bytes--
//!                      +-------------------------------------------------------+
//! ```
//!
//! # Glossary
//! - **autopilot**: a simulated ArduCopter or PX4 with its aircraft ([`Autopilot`]).
//! - **ground truth**: the state of the simulation, which no wire carries ([`Truth`]).
//! - **modem**: the radio on board, which reports the devices' signals ([`Modem`]).
//! - **companion**: the computer that runs the pilot ([`Companion`]).
//! - **referee**: checks the pilot against ground truth and the bytes on the line ([`Referee`]).
//! - **violation**: a rule that the pilot broke ([`Violation`]); a good flight has none.
//! - **setup**: a mission that is ready to be simulated ([`MissionSetup`]).
//! - **operator**: the scripted ground station ([`Operator`]).
//! - **incident**: something that goes wrong during a flight ([`Incident`]); its kind is its **fault class**.
//! - **trial**: a mission with its incidents, drawn from a number ([`Trial`]).
//! - **speed-up**: aircraft seconds per second of the pilot's clock.
//!
//! # When you may trust it
//! The pilot inside [`fly`] is the crate `gleaner-pilot` as it runs on board, and it sees nothing but bytes and the
//! time. The simulated autopilots are tested against measurements of the real ones; the documentation of each lists
//! what it reproduces.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod autopilot;
mod city;
mod companion;
mod flight;
mod intruder;
mod journal;
mod line;
mod modem;
mod operator;
mod pace;
mod picture;
pub mod program;
mod radio_fault;
mod referee;
mod script;
mod setup;
mod simulation;
mod trial;
mod wire;
mod wired;

pub use autopilot::{
    AircraftFault, AircraftSettings, Autopilot, AutopilotKind, Commander, EnergyModel, LinkId, Pack, Truth,
    VehicleMode, Wind,
};
pub use city::ImportError;
pub use companion::{Companion, Computer};
pub use flight::{Ending, Figures, FlightError, FlightResult, FlightRun, STEP, fly, fly_without_record};
pub use intruder::Intrusion;
pub use journal::{Journal, Slot, TrackPoint};
pub use line::{Lane, LineFault};
pub use modem::{Modem, device_id};
pub use operator::{Operator, Orders, Switch};
pub use pace::Pace;
pub use picture::trajectory;
pub use radio_fault::RadioFault;
pub use referee::{Referee, Rule, Violation};
pub use script::{ComputerFault, FlightScript, Incident, IncidentKind};
pub use setup::{MissionPlan, MissionSetup, PlanError};
pub use simulation::Simulation;
pub use trial::Trial;
pub use wired::{Wired, fly_wired};
