#![no_main]
//! Hostile bytes for the reader of scans in E57.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::e57(data));
