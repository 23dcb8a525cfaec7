#![no_main]
//! Hostile bytes for questions at run-time.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::world::run_time(data));
