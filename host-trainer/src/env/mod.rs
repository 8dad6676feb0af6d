//! Missions and flights: the environment of the trainer.

pub mod distribution;
pub mod flight;
pub mod greedy;
pub mod mismatch;
pub mod mission;
pub mod site;
pub mod variety;
