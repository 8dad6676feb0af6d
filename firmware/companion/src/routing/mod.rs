//! Several MAVLink ports as one network: packets in, packets out, and which port gets what.
//!
//! ```text
//! autopilot port --+                  +--> pilot
//!                  +--> Packets --> Router
//! ground ports  ---+                  +--> the other ports
//! ```

mod links;
mod packets;
mod router;
mod signing;

pub use links::Links;
pub use packets::Packet;
pub use signing::{SignedPort, SigningError, read_key};
