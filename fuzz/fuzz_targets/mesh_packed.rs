//! The target `mesh_packed` for libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| palpate_fuzz::mesh_packed(bytes));
