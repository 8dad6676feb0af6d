//! See ../bodies/parameter_store.rs.
#![no_main]

#[path = "../bodies/parameter_store.rs"]
mod body;

libfuzzer_sys::fuzz_target!(|data: &[u8]| body::run(data));
