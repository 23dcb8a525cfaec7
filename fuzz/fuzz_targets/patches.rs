#![no_main]
//! Hostile bytes for the reader of free-form patches in JSON.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::patches(data));
