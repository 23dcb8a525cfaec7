#![no_main]
//! Hostile bytes for the reader of clouds of points with a station.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::scan(data));
