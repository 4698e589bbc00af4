//! Fuzzes [`host_decoders::robot_model`].
#![no_main]

use rigident_fuzz::host_decoders;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| host_decoders::robot_model(bytes));
