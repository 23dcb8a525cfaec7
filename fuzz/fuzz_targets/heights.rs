#![no_main]
//! Hostile bytes for the reader of height maps.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::heights(data));
