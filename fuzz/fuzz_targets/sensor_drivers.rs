//! The drivers on a bus that answers anything, and the load cell's on one that flips single bits: each such
//! frame must be refused, and the next one taken again.
#![no_main]

use std::convert::Infallible;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use libfuzzer_sys::fuzz_target;
use rigident_firmware::drivers::ads131m08::{AdcConfig, Ads131m08};
use rigident_firmware::drivers::imu::Imu;
use rigident_sim::devices;

/// Bits of a frame that its CRC covers, and the CRC: nine words and two bytes of the tenth.
const CHECKED_BITS: usize = 9 * 24 + 16;
const ADC: AdcConfig = AdcConfig { rate_hz: 1000, gain: 64 };

fuzz_target!(|bytes: &[u8]| {
    let hostile = || Bus(|buffer: &mut [u8]| buffer.fill_with(scripted(bytes)));
    let mut adc = Ads131m08::new(hostile());
    let _ = adc.bring_up(&mut NoDelay, &ADC);
    let _ = adc.read_frame();
    let mut imu = Imu::new(hostile());
    let _ = imu.bring_up(&mut NoDelay, 1000);
    let _ = imu.read();

    let model = std::cell::RefCell::new(devices::Ads131m08::new());
    let mut adc = Ads131m08::new(Bus(|buffer: &mut [u8]| model.borrow_mut().transfer(buffer)));
    adc.bring_up(&mut NoDelay, &ADC).expect("the model is a whole converter");
    for (k, &byte) in bytes.iter().enumerate() {
        model.borrow_mut().convert(&[f64::from(byte) * 1e-5; 8]);
        let flips = k % 2 == 1;
        if flips {
            model.borrow_mut().flip_bit(0, (usize::from(byte) + k) % CHECKED_BITS);
        }
        assert_eq!(adc.read_frame().is_err(), flips);
    }
});

/// The input over and over, each call going on where the last one stopped.
fn scripted(bytes: &[u8]) -> impl FnMut() -> u8 {
    let mut script = bytes.iter().cycle();
    move || script.next().copied().unwrap_or(0)
}

struct NoDelay;

impl DelayNs for NoDelay {
    fn delay_ns(&mut self, _: u32) {}
}

/// A device that sees each transaction as one full-duplex transfer.
struct Bus<F>(F);

impl<F> ErrorType for Bus<F> {
    type Error = Infallible;
}

impl<F: FnMut(&mut [u8])> SpiDevice for Bus<F> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let mut line = Vec::new();
        for operation in operations.iter() {
            match operation {
                Operation::Read(read) => line.resize(line.len() + read.len(), 0),
                Operation::Write(written) => line.extend_from_slice(written),
                Operation::Transfer(read, written) => {
                    let end = line.len() + read.len().max(written.len());
                    line.extend_from_slice(written);
                    line.resize(end, 0);
                }
                Operation::TransferInPlace(both) => line.extend_from_slice(both),
                Operation::DelayNs(_) => {}
            }
        }
        (self.0)(&mut line);
        let mut line = line.as_slice();
        for operation in operations {
            match operation {
                Operation::Read(read) | Operation::TransferInPlace(read) => {
                    read.copy_from_slice(line.split_off(..read.len()).unwrap_or_default());
                }
                Operation::Write(written) => {
                    let _ = line.split_off(..written.len());
                }
                Operation::Transfer(read, written) => {
                    let all = line.split_off(..read.len().max(written.len())).unwrap_or_default();
                    read.copy_from_slice(&all[..read.len()]);
                }
                Operation::DelayNs(_) => {}
            }
        }
        Ok(())
    }
}
