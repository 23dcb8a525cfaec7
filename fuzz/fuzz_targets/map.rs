#![no_main]
//! Hostile bytes for the map reader.

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    enfilade_fuzz::check(enfilade_import::decode_map(data, &enfilade_fuzz::options()));
});
