#![no_main]
//! Hostile bytes for the readers of portal files and text PVS.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::prt(data));
