#![no_main]
//! Hostile bytes for the STL reader.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::stl(data));
