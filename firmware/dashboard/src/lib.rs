//! The flight as a page: the city, the aircraft, the devices, the decisions and what they attended to.
//!
//! Two programs show the page: `gleaner run --http` and `gleaner-sitl serve` serve it live ([`Server`]);
//! `gleaner report` and `gleaner-sitl fly --html` write it as one file for a finished flight ([`render`]). Both show
//! the same [`Flight`].
//!
//! ```text
//!  decision loop --Event--> channel --> server thread --event stream--> browsers
//!  decision loop <--Order-- channel <-- server thread <--POST---------- browsers
//!  decision loop --Question--> channel --> forecast thread --Event--> channel --> server thread
//! ```
//! The server runs on a thread of its own. The decision loop hands it events through a bounded channel and never waits:
//! an event that finds the channel full is dropped and counted.
//!
//! # Access
//! On a loopback address every program of this computer may read and command. On any other address the server refuses to
//! start without tokens: one to look, one to command ([`Access`]). A token travels in the `Authorization` header, never
//! in a cookie, so no other site can use it. Requests whose `Host` or `Origin` does not belong to the page are refused,
//! bodies are at most 1 KiB, connections and viewers are counted and bounded, commands are limited in rate.
//!
//! # Commands
//! The page has no way to the aircraft of its own. An [`Order`] becomes a MAVLink command of a ground station
//! ([`GroundClient`]), passes the same checks as any other, and the page shows the acknowledgement. [`Dashboard`] joins
//! server and ground station.
//!
//! # Glossary
//! - **scene**: what is fixed before the flight: city, devices, terminal ([`Scene`]).
//! - **moment**: the aircraft and the devices at one time ([`Live`]).
//! - **station**: what the frames on the vehicle's link show ([`Station`]), where the pilot is in another process.
//! - **order**: what a viewer requested ([`Order`]).
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod access;
mod dashboard;
mod flight;
mod forecast;
mod ground;
mod order;
mod page;
mod recording;
mod scene;
mod server;
mod shown;
mod station;
mod tlog;
mod words;

pub use access::{Access, AccessError, Token};
pub use dashboard::{Dashboard, live};
pub use flight::{
    Decision, Device, DeviceState, Event, Flight, Grid, Live, Scene, Text, WhatIf, WhatIfOption,
};
pub use forecast::{Forecaster, Question};
pub use ground::GroundClient;
pub use order::{Command, Order, Request};
pub use page::render;
pub use recording::Recording;
pub use scene::scene;
pub use server::{Server, ServerError, http_address};
pub use shown::{explain, shown, shown_logged};
pub use station::{Heard, Station};
pub use tlog::telemetry_frames;
