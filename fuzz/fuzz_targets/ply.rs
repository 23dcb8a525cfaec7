#![no_main]
//! Hostile bytes for the ply reader.

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    enfilade_fuzz::check(enfilade_import::decode_ply(data, &enfilade_fuzz::options()));
});
