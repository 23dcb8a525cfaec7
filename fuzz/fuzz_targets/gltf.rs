#![no_main]
//! Hostile bytes for the glTF reader.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::gltf(data));
