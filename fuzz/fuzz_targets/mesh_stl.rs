//! The target `mesh_stl` for libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| palpate_fuzz::mesh_stl(bytes));
