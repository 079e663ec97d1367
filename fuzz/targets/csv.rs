//! libFuzzer target: see `cullmark_fuzz::csv`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| cullmark_fuzz::csv(data));
