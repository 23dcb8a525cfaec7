#![no_main]
//! Hostile bytes for the reader of MagicaVoxel.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::scene::vox(data));
