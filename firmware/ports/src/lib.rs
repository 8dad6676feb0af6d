//! Ports to autopilots, radios and ground stations that never block: UDP, TCP and serial.
//!
//! For programs on a host. The crate moves bytes and decides nothing. [`end_requested`] reports the signals that
//! ask a program to end.
//!
//! # Glossary
//! - **endpoint**: the text that names a port, such as `udpin:0.0.0.0:14550`; see [`Endpoint`].
//! - **frame**: the argument of one [`Port::send`]. A frame is sent whole or not at all: one datagram on UDP, and
//!   never cut by a full buffer on TCP or serial.
//! - **peer**: the other side of a socket. [`Peers`] says which peers a listening UDP port serves.
//! - **up / down**: whether the port can move bytes now. A port that went down opens again by itself, see
//!   [`Port::maintain`].
//!
//! # Guarantees
//! - Only [`Port::open`] may block: it resolves the name and waits at most [`CONNECT_TIMEOUT`] for a TCP peer.
//!   All other calls return at once. [`wait`] blocks by design.
//! - An error from [`Port::open`] is final: a mistake of the caller or a missing device. A later fault is a
//!   [`State`], never an error. [`Port::maintain`] reports it once and repairs it if it can.
//! - "Up" means that the operating system accepts bytes. It does not mean that a peer receives them; on UDP only
//!   a heartbeat shows that.
//! - Bytes arrive in pieces of any size and may be damaged. On UDP one call returns one datagram.
//!
//! The crate reads no clock: [`Port::maintain`] takes `now`, and the operating system measures the time-out of
//! [`wait`].
#![deny(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod devices;
mod endpoint;
mod outbox;
mod port;
mod port_error;
mod resolver;
mod retry;
mod serial;
mod signals;
mod tcp;
mod transport;
mod udp;

pub use devices::{SerialDevice, serial_devices};
pub use endpoint::{DEFAULT_BAUD, Endpoint, EndpointError, EndpointFault, SocketName};
pub use outbox::OUTBOX_BYTES;
pub use port::{Port, PortStats, State, wait};
pub use port_error::PortError;
pub use retry::{RETRY_FIRST, RETRY_LONGEST};
pub use signals::end_requested;
pub use tcp::CONNECT_TIMEOUT;
pub use transport::{Down, PEER_SILENCE};
pub use udp::{MAX_PEERS, Peers};

/// A receive buffer of this size holds any datagram that MAVLink routers send. A longer datagram is cut.
pub const RECEIVE_BYTES: usize = 4096;
