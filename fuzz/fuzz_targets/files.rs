#![no_main]
//! Hostile bytes for names of files in a scene.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::files::files(data));
