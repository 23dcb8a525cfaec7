#![no_main]
//! Hostile bytes for the decoder of worlds.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::world::world(data));
