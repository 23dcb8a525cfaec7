#![no_main]
//! Hostile bytes for the checker of evidence.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::sight::evidence(data));
