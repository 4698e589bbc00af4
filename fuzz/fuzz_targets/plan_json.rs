//! Fuzzes [`host_decoders::plan_json`].
#![no_main]

use rigident_fuzz::host_decoders;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| host_decoders::plan_json(bytes));
