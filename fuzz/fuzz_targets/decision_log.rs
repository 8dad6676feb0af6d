//! See ../bodies/decision_log.rs.
#![no_main]

#[path = "../bodies/decision_log.rs"]
mod body;

libfuzzer_sys::fuzz_target!(|data: &[u8]| body::run(data));
