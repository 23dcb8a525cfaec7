#![no_main]
//! Hostile bytes for the reader of volumes of samples.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::volume(data));
