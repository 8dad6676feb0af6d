//! The link crate from outside: bytes in, bytes out.

mod authority;
mod autopilot;
mod conversation;
mod framing;
mod golden;
mod station;

use proptest::test_runner::{Config, RngSeed};

/// The same cases in every run.
fn seeded() -> Config {
    Config { rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..Config::default() }
}
