#![no_main]
//! Hostile bytes for the obj reader.

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    enfilade_fuzz::check(enfilade_import::decode_obj(data, &enfilade_fuzz::options()));
});
