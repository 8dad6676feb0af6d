//! See ../bodies/mavlink_stream.rs.
#![no_main]

#[path = "../bodies/mavlink_stream.rs"]
mod body;

libfuzzer_sys::fuzz_target!(|data: &[u8]| body::run(data));
