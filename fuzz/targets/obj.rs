//! libFuzzer target: see `cullmark_fuzz::obj`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| cullmark_fuzz::obj(data));
