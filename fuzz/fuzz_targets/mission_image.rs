//! See ../bodies/mission_image.rs.
#![no_main]

#[path = "../bodies/mission_image.rs"]
mod body;

libfuzzer_sys::fuzz_target!(|data: &[u8]| body::run(data));
