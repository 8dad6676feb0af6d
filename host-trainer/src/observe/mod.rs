//! Encodings: how a system observes a flight.

pub mod encoding;
pub mod maps;
pub mod paper_tokens;
pub mod tokens;
