//! Fuzzes [`host_decoders::settings_text`].
#![no_main]

use rigident_fuzz::host_decoders;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| host_decoders::settings_text(bytes));
