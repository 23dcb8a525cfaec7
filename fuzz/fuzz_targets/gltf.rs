#![no_main]
//! Hostile bytes for the gltf reader.

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    enfilade_fuzz::check(enfilade_import::decode_gltf(
        data,
        &enfilade_fuzz::options(),
    ));
});
