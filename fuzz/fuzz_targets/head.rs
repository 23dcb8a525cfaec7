#![no_main]
//! Hostile bytes for the reader of packed worlds' heads.

libfuzzer_sys::fuzz_target!(|data: &[u8]| enfilade_fuzz::packed::head(data));
