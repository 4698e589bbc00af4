//! Fuzzes [`host_decoders::recording_table`].
#![no_main]

use rigident_fuzz::host_decoders;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| host_decoders::recording_table(bytes));
