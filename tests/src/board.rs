//! The board's image in an emulator, connected to the simulator.
//!
//! # Glossary
//! - **image**: the ELF file that is flashed; the emulator boots the same file.
//! - **lines**: the board's serial lines as loopback connections; the emulator connects.

mod cost;
mod emulator;
mod image;
mod toolchain;
mod watching;

pub use cost::LookAheadCost;
pub use emulator::{Emulator, Options, STACK_PAINT, StackUse};
pub use image::{Image, Section};
pub use watching::{Heard, heard, named_values};

use anyhow::{Context, Result, bail};
use gleaner_harness::Wired;
use gleaner_ports::Port;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

/// Longest time that an emulator may take to start.
const CONNECT_LIMIT: Duration = Duration::from_secs(30);

/// A running board and the simulator's ends of its lines.
pub struct Board {
    /// Autopilot and radio.
    pub wired: Wired,
    /// The emulator.
    pub emulator: Emulator,
}

impl Board {
    /// Boots the image.
    ///
    /// # Errors
    /// No suitable emulator (the message says what to install), or it does not connect.
    pub fn boot(image: &Image, options: &Options<'_>) -> Result<Board> {
        let (link, link_at) = listen()?;
        let (radio, radio_at) = listen()?;
        let mut wired = Wired::new(link, Some(radio));
        let mut emulator = Emulator::start(image, link_at, radio_at, options)?;
        let begun = Instant::now();
        while !wired.await_peer(Duration::from_millis(100))? {
            if begun.elapsed() > CONNECT_LIMIT || !emulator.is_running() {
                bail!("the emulator does not connect; it printed: {}", emulator.said());
            }
        }
        Ok(Board { wired, emulator })
    }
}

fn listen() -> Result<(Port, SocketAddr)> {
    let port = Port::open(&"tcpin:127.0.0.1:0".parse()?)?;
    let address = port.local_address().context("a listening port has an address")?;
    Ok((port, address))
}
