#![no_main]
//! Hostile bytes for plan and page of a world.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::world::report(data));
