//! The pilot from outside, in virtual time.

mod authority;
mod authority_onboard;
mod bench;
mod explorer;
mod facts;
mod flight;
mod invariants;
mod lookahead;
mod mission;
#[cfg(feature = "std")]
mod mission_file;
mod onboard;
mod real_autopilots;
mod rig;
mod start;
mod take_over;
mod trouble;
