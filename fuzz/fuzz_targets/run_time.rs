#![no_main]
//! Hostile bytes for queries at run-time.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::world::run_time(data));
