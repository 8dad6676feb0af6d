//! The services of a MAVLink component, each with its own state. [`crate::Component`] connects them.

pub mod autopilot;
pub mod commands;
pub mod identity;
pub mod parameters;
pub mod requests;
pub mod steering;
pub mod streams;
pub mod texts;
