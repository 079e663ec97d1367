//! libFuzzer target: see `cullmark_fuzz::glb`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| cullmark_fuzz::glb(data));
