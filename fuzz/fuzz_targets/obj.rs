#![no_main]
//! Hostile bytes for the OBJ reader.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::obj(data));
