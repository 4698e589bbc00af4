//! Any frames to the load cell's converter model, with conversions and bit flips between them.
//!
//! The first byte of each step says what happens, the rest is what it happens with.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigident_sim::devices::Ads131m08;

fuzz_target!(|bytes: &[u8]| {
    let mut converter = Ads131m08::new();
    let mut rest = bytes;
    while let [step, after @ ..] = rest {
        rest = after;
        match step % 4 {
            0 => converter.convert(&[f64::from(*step) / 128.0 - 1.0; 8]),
            1 => converter.flip_bit(u64::from(*step) % 3, usize::from(*step)),
            _ => {
                let (frame, after) = rest.split_at(rest.len().min(usize::from(step / 4)));
                rest = after;
                let mut frame = frame.to_vec();
                let before = converter.frames();
                converter.transfer(&mut frame);
                assert_eq!(converter.frames(), before + 1);
            }
        }
    }
});
