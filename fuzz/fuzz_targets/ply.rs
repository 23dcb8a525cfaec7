#![no_main]
//! Hostile bytes for the PLY reader.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::ply(data));
