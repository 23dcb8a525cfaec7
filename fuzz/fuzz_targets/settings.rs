#![no_main]
//! Hostile bytes for the settings file.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::settings::settings(data));
