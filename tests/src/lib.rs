//! Judges the whole house end to end; what several of the tests in `tests/` need lies here.
//!
//! # Glossary
//! - **judge**: a program that is not ours and says whether ours is right.

pub mod board;
pub mod observations;
pub mod programs;
pub mod python;
pub mod sources;
