//! libFuzzer target: see `cullmark_fuzz::toml`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| cullmark_fuzz::toml(data));
