#![no_main]
//! Hostile bytes for the map reader.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::map(data));
