//! Missions and their flights: what the trainer flies.

pub mod flight;
pub mod greedy;
pub mod variety;
