//! Simulated autopilot, radio and city around the *unchanged* pilot, and the program `gleaner-sitl`.
//!
//! With the pilot in this process everything below the program runs on virtual time: a mission of ten minutes takes a
//! fraction of a second, and the same seed gives the same bytes. A pilot behind byte streams ([`Wired`]: a board, an
//! emulator, a companion computer) keeps its own clock, so the world keeps pace with the wall ([`Pace`]).
//!
//! ```text
//!  Operator --bytes--> +--------------------- Simulation ----------------------+ --bytes--> Onboard
//!  (ground station)    | Copter: autopilot, motion, battery, routing           |   (the pilot as it flies)
//!           <--bytes-- | Modem: devices, channel, reports   Referee   Journal  | <--bytes--
//!                      +-------------------------------------------------------+
//! ```
//!
//! # Glossary
//! - **copter**: the simulated autopilot with its aircraft ([`Copter`]).
//! - **truth**: what is really so, which no wire carries ([`Truth`]).
//! - **modem**: the radio on board, which reports how each device is heard ([`Modem`]).
//! - **referee**: checks what the pilot does against the truth, on its own ([`Referee`]).
//! - **violation**: a rule that the pilot broke; a good flight has none.
//! - **staged**: a mission laid out, before anything moves ([`Staged`]).
//! - **operator**: the scripted ground station ([`Operator`]).
//! - **incident**: something that happens to the aircraft during a flight.
//! - **trial**: a mission with its incidents, drawn from a number ([`Trial`]).
//! - **haste**: how many seconds the aircraft lives while its pilot's clock counts one.
//!
//! # When you may trust it
//! The pilot inside [`fly`] is the crate `gleaner-pilot` as it runs on board, and it sees nothing but bytes and the
//! time. The simulated autopilot is held against flights of the real one in `autopilot`'s tests. What it does not
//! imitate is listed there.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod aboard;
mod autopilot;
mod flight;
mod journal;
mod mission;
mod modem;
mod operator;
mod pace;
mod picture;
pub mod program;
mod referee;
mod simulation;
mod trial;
mod wire;
mod wired;
mod wires;

pub use aboard::Aboard;
pub use autopilot::{Copter, CopterMode, CopterSettings, LinkId, Pack, Truth};
pub use flight::{Ending, Figures, Flight, FlightError, Flown, Incident, IncidentKind, STEP, Wishes, fly};
pub use journal::{Journal, Slot, TrackPoint};
pub use mission::{MissionPlan, PlanError, Staged};
pub use modem::{Modem, device_id};
pub use operator::{Operator, Orders, Switch};
pub use pace::Pace;
pub use picture::trajectory;
pub use referee::{Breach, Referee, Violation};
pub use simulation::Simulation;
pub use trial::Trial;
pub use wired::{Wired, fly_wired};
pub use wires::WireFault;
