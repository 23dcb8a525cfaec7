#![no_main]
//! Hostile bytes for the reader of implicit scenes.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::implicit(data));
