//! The adapter against a chip written for these tests: registers in banks, packets put together by hand.

extern crate std;

use core::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::vec::Vec;

use embedded_hal::spi::{ErrorKind, ErrorType, Operation};

use super::*;

struct Chip {
    banks: [[u8; 128]; 5],
    fifo: VecDeque<[u8; 20]>,
    full: bool,
    broken: bool,
    /// The transfer with this number, counted from the next, brings nothing but ones; `fails`: and an error.
    bad: Option<(u32, bool)>,
    /// A register, by bank and address, in which these bits are flipped after they are written.
    flips: Option<(usize, u8, u8)>,
    waited_ns: u64,
}

impl Chip {
    fn new() -> Self {
        let mut banks = [[0; 128]; 5];
        banks[0][0x75] = 0x47;
        Self {
            banks,
            fifo: VecDeque::new(),
            full: false,
            broken: false,
            bad: None,
            flips: None,
            waited_ns: 0,
        }
    }

    fn write(&mut self, address: u8, value: u8) {
        let bank = if address == 0x76 { 0 } else { usize::from(self.banks[0][0x76]) };
        let flipped =
            self.flips.filter(|(b, a, _)| (*b, *a) == (bank, address)).map_or(0, |(_, _, bits)| bits);
        self.banks[bank][usize::from(address)] = value ^ flipped;
        if bank == 0 && address == 0x11 && value & 1 != 0 {
            let id = self.banks[0][0x75];
            self.banks = [[0; 128]; 5];
            self.banks[0][0x75] = id;
        }
        if bank == 0 && address == 0x4b && value & 2 != 0 {
            self.fifo.clear();
        }
    }

    fn read(&mut self, address: u8, answer: &mut [u8]) {
        let bank = usize::from(self.banks[0][0x76]);
        if bank == 0 && address == 0x2d && answer.len() == 23 {
            let count = 20 * self.fifo.len() as u16;
            answer[0] = u8::from(core::mem::take(&mut self.full)) << 1;
            answer[1..3].copy_from_slice(&count.to_be_bytes());
            answer[3..].copy_from_slice(&self.fifo.pop_front().unwrap_or([0x80; 20]));
        } else {
            answer.copy_from_slice(&self.banks[bank][usize::from(address)..][..answer.len()]);
        }
    }
}

#[derive(Clone)]
struct Bus(Rc<RefCell<Chip>>);

impl ErrorType for Bus {
    type Error = ErrorKind;
}

impl SpiDevice for Bus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        let mut chip = self.0.borrow_mut();
        if chip.broken {
            return Err(ErrorKind::Other);
        }
        if let Some((ahead, fails)) = chip.bad {
            chip.bad = ahead.checked_sub(1).map(|ahead| (ahead, fails));
            if ahead == 0 {
                if let [Operation::TransferInPlace(bytes)] = operations {
                    bytes.fill(0xff);
                }
                return if fails { Err(ErrorKind::Other) } else { Ok(()) };
            }
        }
        match operations {
            [Operation::Write([address, value])] => chip.write(*address, *value),
            [Operation::TransferInPlace([address, answer @ ..])] if *address & 0x80 != 0 => {
                chip.read(*address & 0x7f, answer);
            }
            _ => panic!("neither one read nor one write"),
        }
        Ok(())
    }
}

struct Clock(Rc<RefCell<Chip>>);

impl DelayNs for Clock {
    fn delay_ns(&mut self, ns: u32) {
        self.0.borrow_mut().waited_ns += u64::from(ns);
    }
}

/// Returns a packet of 20-bit codes, as the data sheet lays it out.
fn packet(accel: [i32; 3], gyro: [i32; 3], temperature: i16) -> [u8; 20] {
    let mut bytes = Vec::from([0x78]);
    for code in accel.iter().chain(&gyro) {
        bytes.extend_from_slice(&((code >> 4) as u16).to_be_bytes());
    }
    bytes.extend_from_slice(&temperature.to_be_bytes());
    bytes.extend_from_slice(&[0, 0]);
    bytes.extend(accel.iter().zip(gyro).map(|(a, g)| ((a & 15) << 4 | g & 15) as u8));
    bytes.try_into().unwrap()
}

fn fresh() -> (Imu<Bus>, Rc<RefCell<Chip>>) {
    let chip = Rc::new(RefCell::new(Chip::new()));
    (Imu::new(Bus(chip.clone())), chip)
}

fn running() -> (Imu<Bus>, Rc<RefCell<Chip>>) {
    let (mut imu, chip) = fresh();
    imu.bring_up(&mut Clock(chip.clone()), 1000).unwrap();
    (imu, chip)
}

#[test]
fn bring_up_sets_the_documented_registers() {
    for (rate_hz, code) in [(200, 7), (500, 15), (1000, 6), (2000, 5)] {
        let (mut imu, chip) = fresh();
        // Old samples must not outlive it.
        chip.borrow_mut().fifo.push_back([0x78; 20]);
        imu.bring_up(&mut Clock(chip.clone()), rate_hz).unwrap();
        let chip = chip.borrow();
        assert_eq!(chip.banks[0][0x4f], code, "±2000 °/s");
        assert_eq!(chip.banks[0][0x50], code, "±16 g");
        assert_eq!(chip.banks[0][0x4e] & 0x0f, 0x0f, "low noise");
        assert_eq!(chip.banks[0][0x52], 0, "half the rate");
        assert_eq!(chip.banks[0][0x5f] & 0x1f, 0x17, "20-bit packets of both sensors");
        assert_eq!(chip.banks[0][0x16] >> 7, 1, "a full FIFO takes no more");
        assert_eq!((chip.banks[0][0x60], chip.banks[0][0x65] & 4), (20, 4), "a signal per packet");
        assert!(chip.fifo.is_empty());
        assert!(chip.waited_ns >= 45_000_000);
    }
}

#[test]
fn a_setting_that_changes_while_samples_come_is_found() {
    let looks = |imu: &mut Imu<Bus>| (0..20).find_map(|_| imu.look_at_a_setting().err());
    let (mut imu, chip) = running();
    assert_eq!(looks(&mut imu), None);
    // Rate and range of both, their filters, power, the signal, the FIFO and its packets, the bank.
    for (address, bits) in [
        (0x4f, 0x02),
        (0x50, 0x80),
        (0x52, 0x10),
        (0x4e, 0x04),
        (0x14, 0x04),
        (0x16, 0x80),
        (0x5f, 0x10),
        (0x60, 0x01),
        (0x4c, 0x10),
        (0x76, 0x01),
    ] {
        chip.borrow_mut().banks[0][address] ^= bits;
        let found = looks(&mut imu);
        assert!(matches!(found, Some(ImuError::Verify { .. })), "{address:#x}: {found:?}");
        chip.borrow_mut().banks[0][address] ^= bits;
        assert_eq!(looks(&mut imu), None);
    }
    // A transfer that suffers is no setting that has changed.
    chip.borrow_mut().bad = Some((0, false));
    assert_eq!(looks(&mut imu), None);
}

#[test]
fn anti_alias_filters_are_those_of_the_documentation() {
    // Data sheet, table of 3 dB bandwidths: DELT, DELTSQR, BITSHIFT for 84, 213, 488 and 997 Hz.
    for (rate_hz, delt, squared, shift) in
        [(200, 2, 4, 13), (500, 5, 25, 10), (1000, 11, 122, 8), (2000, 21, 440, 6)]
    {
        let (mut imu, chip) = fresh();
        imu.bring_up(&mut Clock(chip.clone()), rate_hz).unwrap();
        let banks = chip.borrow().banks;
        let gyro = (banks[1][0x0c] & 0x3f, banks[1][0x0d], banks[1][0x0e]);
        let accel = (banks[2][0x03] >> 1 & 0x3f, banks[2][0x04], banks[2][0x05]);
        assert_eq!(gyro, (delt, squared as u8, shift << 4 | (squared >> 8) as u8));
        assert_eq!(accel, gyro);
    }
}

#[test]
fn packets_become_si_values_with_their_sign() {
    let (mut imu, chip) = running();
    let (accel, gyro) = ([32_768, -4, -524_284], [262_144, -2, 524_286]);
    for (bits, celsius) in [(0, 25.0), (1325, 25.0 + 1325.0 / 132.48), (-3312, 0.0)] {
        chip.borrow_mut().fifo.push_back(packet(accel, gyro, bits));
        let sample = imu.read().unwrap().unwrap();
        for axis in 0..3 {
            let force = f64::from(accel[axis]) / 524_288.0 * 16.0 * 9.80665;
            let rate = f64::from(gyro[axis]) / 524_288.0 * 2000_f64.to_radians();
            // Codes are exact in f32; the scale carries three roundings, the product one.
            let bound = 4.0 * f64::from(f32::EPSILON);
            assert!((f64::from(sample.specific_force_mps2[axis]) / force - 1.0).abs() <= bound);
            assert!((f64::from(sample.angular_rate_radps[axis]) / rate - 1.0).abs() <= bound);
        }
        assert!((sample.temperature_c - celsius).abs() < 1e-5, "{} {celsius}", sample.temperature_c);
    }
    assert_eq!(imu.read(), Ok(None));
    assert_eq!((imu.errors(), imu.overflows(), imu.skipped()), (0, 0, 0));
}

#[test]
fn every_temperature_word_survives_the_published_scale() {
    for bits in i16::MIN..=i16::MAX {
        let published = f32::from(bits.cast_unsigned()) / 2.07 + 25.0;
        assert_eq!(temperature_c(published), f32::from(bits) / 132.48 + 25.0);
    }
}

#[test]
fn a_backlog_gives_the_newest_sample_and_is_counted() {
    let (mut imu, chip) = running();
    for k in 1..=5 {
        chip.borrow_mut().fifo.push_back(packet([4 * k; 3], [2 * k; 3], 0));
    }
    let newest = imu.read().unwrap().unwrap();
    chip.borrow_mut().fifo.push_back(packet([20; 3], [10; 3], 0));
    assert_eq!(imu.read(), Ok(Some(newest)));
    assert_eq!((imu.skipped(), imu.errors()), (4, 0));
}

#[test]
fn an_overflow_is_named_counted_and_leaves_no_old_samples() {
    let (mut imu, chip) = running();
    for _ in 0..FIFO_PACKETS {
        chip.borrow_mut().fifo.push_back(packet([4; 3], [2; 3], 0));
    }
    chip.borrow_mut().full = true;
    assert_eq!(imu.read(), Err(ImuError::Overflow));
    assert_eq!(imu.read(), Ok(None));
    chip.borrow_mut().fifo.push_back(packet([8; 3], [2; 3], 0));
    let next = imu.read().unwrap().unwrap();
    assert!((next.specific_force_mps2[0] - 8.0 / 524_288.0 * 156.9064).abs() < 1e-9);
    assert_eq!((imu.errors(), imu.overflows(), imu.skipped()), (1, 1, 0));
}

#[test]
fn a_dead_line_is_an_error_and_not_a_missing_sample() {
    let (mut imu, chip) = running();
    chip.borrow_mut().fifo.push_back([0; 20]);
    assert_eq!(imu.read(), Err(ImuError::Packet));
    chip.borrow_mut().fifo.push_back([0xff; 20]);
    chip.borrow_mut().full = true;
    assert_eq!(imu.read(), Err(ImuError::Overflow));
    chip.borrow_mut().broken = true;
    assert_eq!(imu.read(), Err(ImuError::Bus(ErrorKind::Other)));
    assert_eq!((imu.errors(), imu.overflows()), (3, 1));
}

#[test]
fn a_chip_that_is_not_there_can_be_tried_again() {
    let (mut imu, chip) = fresh();
    let mut clock = Clock(chip.clone());
    assert_eq!(imu.read(), Err(ImuError::NotReady));
    assert_eq!(imu.bring_up(&mut clock, 999), Err(ImuError::BadRate(999)));
    chip.borrow_mut().banks[0][0x75] = 0x68;
    assert_eq!(imu.bring_up(&mut clock, 1000), Err(ImuError::WrongId));
    chip.borrow_mut().broken = true;
    assert_eq!(imu.bring_up(&mut clock, 1000), Err(ImuError::Bus(ErrorKind::Other)));
    chip.borrow_mut().broken = false;
    chip.borrow_mut().banks[0][0x75] = 0x47;
    assert_eq!(imu.bring_up(&mut clock, 1000), Ok(()));
    assert_eq!(imu.bring_up(&mut clock, 500), Ok(()));
}

/// One transfer that suffers, whichever it is of the some hundred of a bring-up, must not end the device.
#[test]
fn a_bad_transfer_anywhere_in_a_bring_up_leaves_a_chip_that_is_set_up_or_can_be_tried_again() {
    let mut heals = 0;
    for fails in [false, true] {
        for ahead in 0..130 {
            let (mut imu, chip) = fresh();
            let mut clock = Clock(chip.clone());
            chip.borrow_mut().bad = Some((ahead, fails));
            if imu.bring_up(&mut clock, 1000).is_ok() {
                heals += 1;
            }
            chip.borrow_mut().bad = None;
            assert_eq!(imu.bring_up(&mut clock, 1000), Ok(()), "transfer {ahead}, fails: {fails}");
            chip.borrow_mut().fifo.push_back(packet([4; 3], [2; 3], 0));
            assert!(imu.read().unwrap().is_some());
        }
    }
    assert_eq!(heals, 2 * 130, "another try heals it at once");
}

/// A bit of a setting that is flipped on its way is another range, rate or filter.
#[test]
fn every_flipped_bit_of_a_setting_is_found_and_named() {
    let mut flips = 0;
    for rate_hz in [200, 1000] {
        for (bank, address, mask, wrote) in written(output_data_rate(rate_hz).unwrap()) {
            if [WHO_AM_I & !0x80, BANK_SELECT].contains(&address) {
                continue;
            }
            for bit in (0..8).map(|k| 1 << k).filter(|bit| mask & bit != 0) {
                let (mut imu, chip) = fresh();
                chip.borrow_mut().flips = Some((usize::from(bank), address, bit));
                let error = imu.bring_up(&mut Clock(chip.clone()), rate_hz).unwrap_err();
                let expected = ImuError::Verify { register: (bank, address), wrote, read: wrote ^ bit };
                assert_eq!(error, expected, "bit {bit:#x}");
                assert_eq!(imu.read(), Err(ImuError::NotReady), "no sample of another range");
                chip.borrow_mut().flips = None;
                assert_eq!(imu.bring_up(&mut Clock(chip.clone()), rate_hz), Ok(()));
                flips += 1;
            }
        }
    }
    assert!(flips > 150, "{flips}");
}
