//! End-to-end tests of the whole workspace. This library holds what several files in `tests/` use.
//!
//! # Glossary
//! - **judge**: a program by other authors that decides whether Gleaner's output is right.

pub mod benchmarks;
pub mod board;
pub mod observations;
pub mod programs;
pub mod python;
pub mod serving;
pub mod sources;
