//! The model against the published driver, which knows the data sheet and not the model.

use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use icm426xx::{Config, ICM42688, OutputDataRate, Timestamp};

use super::*;

/// A bus with only the model on it.
#[derive(Clone, Default)]
struct Bus(Rc<RefCell<Icm42688>>);

impl ErrorType for Bus {
    type Error = Infallible;
}

impl SpiDevice for Bus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        // Chip select stays low for the whole transaction: gather, exchange once, hand out.
        let mut wire = Vec::new();
        for operation in operations.iter() {
            match operation {
                Operation::Read(into) => wire.resize(wire.len() + into.len(), 0),
                Operation::Write(from) => wire.extend_from_slice(from),
                Operation::Transfer(_, from) => wire.extend_from_slice(from),
                Operation::TransferInPlace(both) => wire.extend_from_slice(both),
                Operation::DelayNs(_) => {}
            }
        }
        self.0.borrow_mut().transfer(&mut wire);
        let mut wire = wire.into_iter();
        for operation in operations.iter_mut() {
            match operation {
                Operation::Read(into) | Operation::Transfer(into, _) | Operation::TransferInPlace(into) => {
                    into.iter_mut().for_each(|b| *b = wire.next().unwrap());
                }
                Operation::Write(from) => drop(wire.by_ref().take(from.len()).count()),
                Operation::DelayNs(_) => {}
            }
        }
        Ok(())
    }
}

struct NoDelay;
impl DelayNs for NoDelay {
    fn delay_ns(&mut self, _: u32) {}
}

fn ready(rate: OutputDataRate) -> (Bus, ICM42688<Bus, icm426xx::Ready>) {
    let bus = Bus::default();
    let config = Config { rate, timestamps_are_absolute: true, ..Config::default() };
    let driver = ICM42688::new(bus.clone()).initialize(NoDelay, config).unwrap();
    (bus, driver)
}

#[test]
fn the_published_driver_initialises_it_and_sets_the_rate_it_asked_for() {
    for (rate, hz) in
        [(OutputDataRate::Hz1000, 1000.0), (OutputDataRate::Hz500, 500.0), (OutputDataRate::Hz200, 200.0)]
    {
        let (bus, _) = ready(rate);
        assert_eq!(bus.0.borrow().rate_hz(), Some(hz));
    }
    assert_eq!(Bus::default().0.borrow().rate_hz(), None);
}

#[test]
fn the_published_driver_reads_the_sample_back() {
    let (bus, mut driver) = ready(OutputDataRate::Hz1000);
    let accel = [1.2345, -9.80665, 25.0];
    let gyro = [0.5, -1.25, 3.0];
    assert!(bus.0.borrow_mut().sample(4_000_000, accel, gyro, 25.0));
    let (sample, more) = driver.read_sample().unwrap().unwrap();
    assert!(!more);
    let (a, g) = (sample.accel.unwrap(), sample.gyro.unwrap());
    for (got, want) in [a.0, a.1, a.2].into_iter().zip(accel) {
        // Half a step of 18 bits over ±16 g, plus the rounding of f32.
        assert!((f64::from(got) - want).abs() < 16.0 * 9.80665 / 131_072.0 / 2.0 + 4e-6, "{got} {want}");
    }
    for (got, want) in [g.0, g.1, g.2].into_iter().zip(gyro) {
        assert!(
            (f64::from(got) - want).abs() < 2000_f64.to_radians() / 262_144.0 / 2.0 + 4e-7,
            "{got} {want}"
        );
    }
    assert_eq!(sample.timestamp, Timestamp::OdrTimestamp(250));
    assert!((sample.temperature_celsius - 25.0).abs() < 1.0);
}

#[test]
fn the_fifo_is_first_in_first_out_and_says_when_it_is_empty() {
    let (bus, mut driver) = ready(OutputDataRate::Hz1000);
    assert!(driver.read_sample().unwrap().is_none());
    for k in 0..5 {
        bus.0.borrow_mut().sample(k * 1_000_000, [k as f64, 0.0, 0.0], [0.0; 3], 25.0);
    }
    assert_eq!(driver.read_fifo_count().unwrap(), 100);
    for k in 0..5 {
        let (sample, more) = driver.read_sample().unwrap().unwrap();
        assert!((sample.accel.unwrap().0 - k as f32).abs() < 1e-3);
        assert_eq!(more, k < 4);
    }
    assert!(driver.read_sample().unwrap().is_none());
}

#[test]
fn an_overflowing_fifo_is_reported_once_and_can_be_flushed() {
    let (bus, mut driver) = ready(OutputDataRate::Hz1000);
    for k in 0..200 {
        bus.0.borrow_mut().sample(k * 1_000_000, [0.0; 3], [0.0; 3], 25.0);
    }
    assert!(matches!(driver.read_sample(), Err(icm426xx::Error::FifoOverflow)));
    driver.reset_fifo().unwrap();
    assert_eq!(driver.read_fifo_count().unwrap(), 0);
    assert!(driver.read_sample().unwrap().is_none());
}

#[test]
fn data_registers_hold_sixteen_bit_words_at_the_selected_full_scale() {
    let mut imu = Icm42688::new();
    // ±2 g, ±250 °/s, both in low-noise mode.
    imu.transfer(&mut [ACCEL_CONFIG0, 0x66]);
    imu.transfer(&mut [GYRO_CONFIG0, 0x66]);
    imu.transfer(&mut [PWR_MGMT0, 0x0F]);
    imu.sample(
        0,
        [STANDARD_GRAVITY_MPS2, 0.0, -3.0 * STANDARD_GRAVITY_MPS2],
        [125_f64.to_radians(), 0.0, 0.0],
        30.0,
    );
    let mut data = [0; 15];
    data[0] = TEMP_DATA1 | 0x80;
    imu.transfer(&mut data);
    let words: Vec<i16> = data[1..].chunks(2).map(|b| i16::from_be_bytes([b[0], b[1]])).collect();
    assert_eq!(words, [662, 16384, 0, -32767, 16384, 0, 0]);
}

#[test]
fn identity_survives_writes_and_a_soft_reset_turns_the_sensors_off() {
    let (bus, _) = ready(OutputDataRate::Hz1000);
    let mut imu = bus.0.borrow_mut();
    imu.transfer(&mut [WHO_AM_I, 0x00]);
    let mut who = [WHO_AM_I | 0x80, 0];
    imu.transfer(&mut who);
    assert_eq!(who[1], 0x47);
    imu.transfer(&mut [DEVICE_CONFIG, 1]);
    assert_eq!(imu.rate_hz(), None);
}
