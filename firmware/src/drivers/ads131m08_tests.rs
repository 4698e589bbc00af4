//! The driver against a converter written for these tests: its own frames, its own CRC bit by bit.

extern crate std;

use core::cell::RefCell;
use core::convert::Infallible;
use std::rc::Rc;
use std::vec::Vec;

use embedded_hal::spi::{ErrorType, Operation};

use super::*;

const CONFIG: AdcConfig = AdcConfig { rate_hz: 1000, gain: 64 };
const FRAME_BITS: usize = 240;

/// Divides the polynomials, one bit at a time.
fn crc_ccitt(bytes: &[u8]) -> u16 {
    let mut remainder = 0xffff_u16;
    for bit in bytes.iter().flat_map(|byte| (0..8).rev().map(move |i| byte >> i & 1 == 1)) {
        let carry = (remainder >> 15 == 1) != bit;
        remainder <<= 1;
        if carry {
            remainder ^= 0x1021;
        }
    }
    remainder
}

struct Converter {
    registers: [u16; 64],
    /// A register that keeps its value whatever is written.
    stuck: Option<usize>,
    codes: [i32; 8],
    /// First word of the next frame; without one it is the status.
    answer: Option<u16>,
    crc_error: bool,
    /// F_RESYNC and REG_MAP, until a status is sent.
    flags: u16,
    /// DRDYn of the next status.
    fresh: u16,
    received: Vec<[u8; 30]>,
    /// Bit of the next frame to invert, on its way out or in.
    flip_out: Option<usize>,
    flip_in: Option<(usize, usize)>,
}

impl Converter {
    fn new() -> Self {
        let mut converter = Self {
            registers: [0; 64],
            stuck: None,
            codes: [0; 8],
            answer: Some(0xff28),
            crc_error: false,
            flags: 0,
            fresh: 0xff,
            received: Vec::new(),
            flip_out: None,
            flip_in: None,
        };
        converter.reset();
        converter
    }

    fn reset(&mut self) {
        self.registers = [0; 64];
        (self.registers[0], self.registers[2], self.registers[3]) = (0x2801, 0x0510, 0xff0e);
        self.crc_error = false;
    }

    fn status(&self) -> u16 {
        self.registers[2] & 0x0700 | u16::from(self.crc_error) << 12 | self.flags | self.fresh
    }

    fn output(&mut self) -> [u8; 30] {
        let first = self.answer.take().unwrap_or_else(|| {
            let status = self.status();
            (self.crc_error, self.flags) = (false, 0);
            status
        });
        let mut frame = [0; 30];
        frame[..2].copy_from_slice(&first.to_be_bytes());
        for (slot, code) in frame[3..27].chunks_exact_mut(3).zip(self.codes) {
            slot.copy_from_slice(&code.to_be_bytes()[1..]);
        }
        let check = crc_ccitt(&frame[..27]);
        frame[27..29].copy_from_slice(&check.to_be_bytes());
        if let Some(bit) = self.flip_out.take() {
            frame[bit / 8] ^= 0x80 >> (bit % 8);
        }
        frame
    }

    fn execute(&mut self, mut input: [u8; 30]) {
        if let Some((frame, bit)) = self.flip_in
            && frame == self.received.len()
        {
            input[bit / 8] ^= 0x80 >> (bit % 8);
        }
        self.received.push(input);
        let word = |i: usize| u16::from_be_bytes([input[3 * i], input[3 * i + 1]]);
        let (command, address) = (word(0), usize::from(word(0) >> 7 & 63));
        let writes = command >> 13 == 0b011;
        let covered = if writes { 2 } else { 1 };
        if self.registers[2] >> 12 & 1 == 1 && word(covered) != crc_ccitt(&input[..3 * covered]) {
            self.crc_error = true;
            if writes {
                self.registers[address] = word(1);
                self.flags |= (self.registers[2] & 1 << 13) | 1 << 14;
            }
            return;
        }
        match command >> 13 {
            0b101 => self.answer = Some(self.registers[address]),
            0b011 => {
                if self.stuck != Some(address) {
                    self.registers[address] = word(1);
                    // A write changes the registers' CRC and restarts the filters.
                    self.flags |= (self.registers[2] & 1 << 13) | 1 << 14;
                }
                self.answer = Some(0b010 << 13 | command & 0x1fff);
            }
            _ if command == 0x0011 => {
                self.reset();
                self.answer = Some(0xff28);
            }
            _ => {}
        }
    }
}

#[derive(Clone)]
struct Bus(Rc<RefCell<Converter>>);

impl ErrorType for Bus {
    type Error = Infallible;
}

impl SpiDevice for Bus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let [Operation::TransferInPlace(bytes)] = operations else { panic!("not one whole frame") };
        let input: [u8; 30] = (&**bytes).try_into().expect("a frame is 30 bytes");
        let mut converter = self.0.borrow_mut();
        bytes.copy_from_slice(&converter.output());
        converter.execute(input);
        Ok(())
    }
}

struct NoWait;

impl DelayNs for NoWait {
    fn delay_ns(&mut self, _: u32) {}
}

fn fresh() -> (Ads131m08<Bus>, Rc<RefCell<Converter>>) {
    let converter = Rc::new(RefCell::new(Converter::new()));
    (Ads131m08::new(Bus(converter.clone())), converter)
}

fn running() -> (Ads131m08<Bus>, Rc<RefCell<Converter>>) {
    let (mut driver, converter) = fresh();
    driver.bring_up(&mut NoWait, &CONFIG).unwrap();
    (driver, converter)
}

#[test]
fn both_crcs_give_the_catalogued_check_value() {
    assert_eq!(CRC16.checksum(b"123456789"), 0x29b1);
    assert_eq!(crc_ccitt(b"123456789"), 0x29b1);
}

#[test]
fn bring_up_leaves_the_registers_of_the_data_sheet_for_every_rate_and_gain() {
    for (rate_hz, oversampling) in [(250, 7), (500, 6), (1000, 5), (2000, 4), (4000, 3)] {
        for (exponent, gain) in [1_u8, 2, 4, 8, 16, 32, 64, 128].into_iter().enumerate() {
            let (mut driver, converter) = fresh();
            driver.bring_up(&mut NoWait, &AdcConfig { rate_hz, gain }).unwrap();
            let registers = converter.borrow().registers;
            assert_eq!(registers[2], 0x3110, "CRC of registers and both ways, 24 bits, timeout, reset noted");
            assert_eq!(registers[3], 0xff02 | oversampling << 2);
            assert_eq!(registers[4], 0x1111 * exponent as u16);
            assert_eq!(registers[5], 0x0011 * exponent as u16, "the excitation is not amplified");
            assert_eq!(driver.crc_errors(), 0);
        }
    }
}

#[test]
fn bring_up_may_be_repeated_and_heeds_nothing_from_before_the_reset() {
    let (mut driver, converter) = running();
    converter.borrow_mut().flip_out = Some(100);
    driver.bring_up(&mut NoWait, &AdcConfig { rate_hz: 250, gain: 1 }).unwrap();
    assert_eq!((converter.borrow().registers[3], driver.crc_errors()), (0xff1e, 0));
}

#[test]
fn rates_and_gains_that_do_not_exist_are_refused_before_the_bus_is_touched() {
    let (mut driver, converter) = fresh();
    for rate_hz in [0, 1, 125, 999, 8000, u32::MAX] {
        let refused = driver.bring_up(&mut NoWait, &AdcConfig { rate_hz, gain: 1 });
        assert_eq!(refused, Err(AdcError::BadRate(rate_hz)));
    }
    for gain in [0, 3, 129, 255] {
        let refused = driver.bring_up(&mut NoWait, &AdcConfig { rate_hz: 1000, gain });
        assert_eq!(refused, Err(AdcError::BadGain(gain)));
    }
    assert!(converter.borrow().received.is_empty());
}

#[test]
fn every_command_carries_the_crc_of_its_words_and_zeros_to_the_end() {
    let (mut driver, converter) = running();
    driver.read_frame().unwrap();
    for frame in &converter.borrow().received {
        let covered = if frame[0] >> 5 == 0b011 { 6 } else { 3 };
        assert_eq!(frame[covered..covered + 2], crc_ccitt(&frame[..covered]).to_be_bytes());
        assert!(frame[2] == 0 && frame[covered + 2..].iter().all(|byte| *byte == 0));
    }
}

#[test]
fn registers_are_read_from_the_frame_after_the_one_that_asks() {
    let (mut driver, converter) = running();
    converter.borrow_mut().registers[0x30] = 0xa55a;
    let asked_before = converter.borrow().received.len();
    assert_eq!(driver.read_register(0x30), Ok(0xa55a));
    let received = &converter.borrow().received[asked_before..];
    assert_eq!(received.len(), 2);
    assert_eq!(
        (received[0][..2].to_vec(), received[1][..2].to_vec()),
        (std::vec![0xb8, 0x00], std::vec![0, 0])
    );
}

#[test]
fn codes_keep_their_sign_and_the_ends_of_the_range_are_reported() {
    let codes = [0, 1, -1, 8_388_606, -8_388_607, 8_388_607, -8_388_608, -4_194_304];
    let (mut driver, converter) = running();
    converter.borrow_mut().codes = codes;
    let frame = driver.read_frame().unwrap();
    assert_eq!(frame, AdcFrame { codes, status: 0x01ff, saturated: 0b0110_0000 });
    // 1.2 V / 64 / 2^23 is not a binary fraction: one rounding of the factor, one of the product.
    for (volts, code) in frame.gauges_v(64).into_iter().zip(codes) {
        let exact = f64::from(code) * 1.2 / 64.0 / 8_388_608.0;
        assert!((f64::from(volts) - exact).abs() <= exact.abs() * 2.0 * f64::from(f32::EPSILON));
    }
}

#[test]
fn a_flipped_bit_anywhere_in_a_frame_is_an_error_counted_once() {
    let (mut driver, converter) = running();
    converter.borrow_mut().codes = [-5, 7, 0, 8_388_607, -8_388_608, 1, 2, 3];
    let whole = driver.read_frame().unwrap();
    for bit in 0..FRAME_BITS {
        converter.borrow_mut().flip_out = Some(bit);
        let error = driver.read_frame().unwrap_err();
        assert!(matches!(error, AdcError::Crc { expected, got } if expected != got), "bit {bit}: {error:?}");
        assert_eq!(driver.crc_errors(), bit as u32 + 1);
        assert_eq!(driver.read_frame(), Ok(whole), "after bit {bit}");
    }
}

#[test]
fn a_flipped_bit_in_a_command_or_its_crc_is_reported_by_the_next_frame() {
    for bit in 0..40 {
        let (mut driver, converter) = running();
        let now = converter.borrow().received.len();
        converter.borrow_mut().flip_in = Some((now, bit));
        driver.read_frame().unwrap();
        assert_eq!(driver.read_frame(), Err(AdcError::InputCrc), "bit {bit}");
        driver.read_frame().unwrap();
        assert_eq!(driver.crc_errors(), 0);
    }
}

#[test]
fn a_flipped_bit_in_a_write_never_passes_bring_up() {
    // CLOCK, GAIN1 and GAIN2 follow MODE, three frames each, after reset, NULL and two for the ID.
    for write in [7, 10, 13] {
        for bit in (0..64).filter(|bit| bit % 24 < 16) {
            let (mut driver, converter) = fresh();
            converter.borrow_mut().flip_in = Some((write, bit));
            let error = driver.bring_up(&mut NoWait, &CONFIG).unwrap_err();
            assert_eq!(error, AdcError::InputCrc, "frame {write}, bit {bit}");
        }
    }
}

#[test]
fn a_register_that_does_not_hold_is_named() {
    for (register, value) in [(2, 0x3110), (3, 0xff16), (4, 0x6666), (5, 0x0066)] {
        let (mut driver, converter) = fresh();
        converter.borrow_mut().stuck = Some(register);
        let kept = [0, 0, 0x0510, 0xff0e, 0, 0][register];
        let error = driver.bring_up(&mut NoWait, &CONFIG).unwrap_err();
        assert_eq!(error, AdcError::Verify { register: register as u8, wrote: value, read: kept });
    }
}

/// Every frame is examined for faults of its sample that only the status shows.
#[test]
fn a_status_that_speaks_against_its_sample_is_named_and_the_next_sample_is_good() {
    let (mut driver, converter) = running();
    let good = driver.read_frame().unwrap();
    for (flags, expected) in [(1 << 13, AdcError::Registers), (1 << 14, AdcError::Resynced)] {
        converter.borrow_mut().flags = flags;
        assert_eq!(driver.read_frame(), Err(expected));
        assert_eq!(driver.read_frame(), Ok(good));
    }
    // DRDY fell by itself: the conversion is that of before, on all channels or on one.
    for fresh in [0x00, 0xfe, 0x7f] {
        converter.borrow_mut().fresh = fresh;
        assert_eq!(driver.read_frame(), Err(AdcError::Stale));
        converter.borrow_mut().fresh = 0xff;
        assert_eq!(driver.read_frame(), Ok(good));
    }
    assert_eq!(driver.crc_errors(), 0);
}

#[test]
fn the_excitation_is_the_seventh_channel_at_gain_one() {
    let (mut driver, converter) = running();
    converter.borrow_mut().codes = [0, 0, 0, 0, 0, 0, 6_990_506, 0];
    let volts = driver.read_frame().unwrap().excitation_v();
    assert!((f64::from(volts) - 6_990_506.0 * 1.2 / 8_388_608.0).abs() < 1e-6, "{volts}");
}

/// A bus on which the same byte comes back for ever.
struct Dead(u8);

impl ErrorType for Dead {
    type Error = Infallible;
}

impl SpiDevice for Dead {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        for operation in operations {
            if let Operation::TransferInPlace(bytes) = operation {
                bytes.fill(self.0);
            }
        }
        Ok(())
    }
}

#[test]
fn another_chip_and_no_chip_are_named_and_never_give_a_sample() {
    // The reset of this fake always answers 0xff28; its ID register tells otherwise.
    struct OtherId(Bus);
    impl ErrorType for OtherId {
        type Error = Infallible;
    }
    impl SpiDevice for OtherId {
        fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
            self.0.transaction(operations)?;
            self.0.0.borrow_mut().registers[0] = 0x2401;
            Ok(())
        }
    }
    let mut driver = Ads131m08::new(OtherId(Bus(Rc::new(RefCell::new(Converter::new())))));
    assert_eq!(driver.bring_up(&mut NoWait, &CONFIG), Err(AdcError::WrongId(0x2401)));

    for level in [0x00, 0xff] {
        let mut driver = Ads131m08::new(Dead(level));
        let answer = u16::from_be_bytes([level; 2]);
        assert_eq!(driver.bring_up(&mut NoWait, &CONFIG), Err(AdcError::WrongId(answer)));
        assert!(matches!(driver.read_frame(), Err(AdcError::Crc { .. })));
        assert_eq!(driver.crc_errors(), 1);
    }
}

#[test]
fn a_converter_that_restarted_by_itself_gives_no_sample() {
    let (mut driver, converter) = running();
    converter.borrow_mut().reset();
    // First its announcement, then a status with the flag still up.
    converter.borrow_mut().answer = Some(0xff28);
    assert_eq!(driver.read_frame(), Err(AdcError::DeviceReset));
    assert_eq!(driver.read_frame(), Err(AdcError::DeviceReset));
    assert_eq!(driver.crc_errors(), 0);
}
