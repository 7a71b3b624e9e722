#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| semismooth_fuzz::friction(data));
