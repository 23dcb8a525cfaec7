#![no_main]
//! Hostile bytes for a search resumed from a checkpoint.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::sight::checkpoint(data));
