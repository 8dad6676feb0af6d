//! Byte streams to autopilots, radios and ground stations that never block: UDP, TCP and serial ports. And
//! [`asked_to_end`], for the loops around them.
//!
//! Host only: this crate opens sockets and devices for the programs. Nothing that flies decides here.
//!
//! # Glossary
//! - **endpoint**: the text that names a port, such as `udpin:0.0.0.0:14550`; see [`Endpoint`].
//! - **frame**: what the caller hands to [`Port::send`] in one piece. A frame travels whole or not at all: one
//!   datagram on UDP, never cut by a full buffer on TCP or serial.
//! - **up / down**: whether bytes can travel now. A port that went down opens again by itself, see
//!   [`Port::maintain`].
//!
//! # When you may trust this
//! - Only [`Port::open`] may block: it resolves the name and waits at most [`CONNECT_TIMEOUT`] for a TCP peer.
//!   Everything else returns at once; [`wait`] is the one place to spend time.
//! - An error at [`Port::open`] is the caller's mistake or a missing device, and is final. Whatever happens
//!   later is a [`State`], never an error: it is said once by [`Port::maintain`] and mended if possible.
//! - "Up" says that the operating system takes bytes, not that anybody hears them. On UDP it says nothing about
//!   the peer: watch heartbeats.
//! - Bytes arrive in any pieces and may be garbage; on UDP one call gives one datagram.
//!
//! No clock is read here: [`Port::maintain`] takes `now`, and [`wait`] takes a span that the operating system
//! measures.
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod endpoint;
mod outbox;
mod port;
mod retry;
mod serial;
mod signals;
mod tcp;
mod transport;
mod udp;

pub use endpoint::{DEFAULT_BAUD, Endpoint, EndpointError, EndpointFault, SocketName};
pub use outbox::OUTBOX_BYTES;
pub use port::{Port, PortError, State, wait};
pub use retry::{RETRY_FIRST, RETRY_LONGEST};
pub use signals::asked_to_end;
pub use tcp::CONNECT_TIMEOUT;
pub use transport::Down;
pub use udp::MAX_PEERS;

/// A receive buffer of this size takes any datagram that MAVLink routers send; a longer one is cut.
pub const RECEIVE_BYTES: usize = 4096;
