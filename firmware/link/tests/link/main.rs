//! The link crate from outside: bytes in, bytes out.

mod authority;
mod autopilot;
mod conversation;
mod framing;
mod golden;
mod identity;
mod protocols;
mod signing;
mod station;

use proptest::test_runner::{Config, RngSeed};

/// Fixed seed for property tests.
fn seeded() -> Config {
    Config { rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..Config::default() }
}
