#![no_main]
//! Hostile bytes for all builders.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::bake::bake(data));
