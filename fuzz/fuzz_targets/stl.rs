#![no_main]
//! Hostile bytes for the stl reader.

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    enfilade_fuzz::check(enfilade_import::decode_stl(data, &enfilade_fuzz::options()));
});
