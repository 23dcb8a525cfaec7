#![no_main]
//! Hostile bytes for the reader of skeletons.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::packed::skeleton(data));
