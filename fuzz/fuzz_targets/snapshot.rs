//! The target `snapshot` for libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| palpate_fuzz::snapshot(bytes));
