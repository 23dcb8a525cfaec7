#![no_main]
//! Hostile bytes for the search, on a portal file.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::sight::pvs(data));
