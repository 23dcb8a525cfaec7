#![no_main]
//! Hostile bytes for the search that goes on from a checkpoint.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::sight::checkpoint(data));
