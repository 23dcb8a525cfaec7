#![no_main]
//! Hostile bytes for the reader of scans in LAS and LAZ.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::las(data));
