//! MAVLink 2 message signing (MAVLink guide, "Message Signing").
//!
//! A signature proves that the sender has the key, and that the frame is no replay. It hides nothing. Signing is a
//! property of one port: a wire to the autopilot may be unsigned while a radio link must be signed.
//!
//! # Using it
//! One [`Signing`] per port. Incoming: give every [`crate::Frame`] of the port's decoder to [`Signing::check`] and
//! pass it on only after `Ok`. Outgoing: give every frame to [`Signing::sign`]. Some times a minute, store
//! [`Signing::state`] and give it back after a restart; see [`SigningState`] for what is lost otherwise.
//!
//! `SETUP_SIGNING` carries a key in clear text. It is never accepted, and a router must not forward it:
//! [`may_forward`].

mod key;
mod state;
mod stream;

pub use key::{SigningKey, SigningTime};
pub use state::{SigningState, StateError};
pub use stream::{SignedFrameBytes, Signing, SigningFault, SigningStats, may_forward};
