#![no_main]
//! Hostile bytes for the file of choices.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::settings::choices(data));
