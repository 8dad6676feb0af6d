//! See ../bodies/model_blob.rs.
#![no_main]

#[path = "../bodies/model_blob.rs"]
mod body;

libfuzzer_sys::fuzz_target!(|data: &[u8]| body::run(data));
