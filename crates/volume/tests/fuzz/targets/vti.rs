#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| sheetsplat_volume_fuzz::run("vti", bytes));
