//! The IMU: an ICM-42688-P through the published driver `icm426xx`.
//!
//! What that driver sets: ±16 g and ±2000 °/s; both sensors in low-noise mode at one rate; first-order filters of
//! half the rate behind anti-alias filters of 42 Hz (up to 100 samples per second), 84 Hz (200), 213 Hz (500),
//! 488 Hz (1000), 997 Hz (2000), 1962 Hz (4000), so that 25 and 50 samples per second are aliased; 20-bit FIFO
//! packets, one per data-ready signal; a full FIFO takes no more. Of the 20 bits the accelerometer fills 18, 1.2e-3
//! m/s², and the gyro 19, 1.33e-4 rad/s (data sheet DS-000347). The noise that the data sheet gives is 70 µg/√Hz
//! and 2.8 mdps/√Hz.
//!
//! What this adapter adds: the chip is checked before the bus is handed over, because the published driver keeps the
//! bus when its initialisation fails; the gyro's start-up is waited for; a backlog in the FIFO is passed over, because
//! a sample is dated by its signal; the temperature has the scale of 20-bit packets.

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;
use icm426xx::{Config, Error, ICM42688, OutputDataRate, Ready};

/// Read flag and address of WHO_AM_I, and what it holds.
const WHO_AM_I: u8 = 0x80 | 0x75;
const ICM_42688_P: u8 = 0x47;
/// SIGNAL_PATH_RESET and its bit that empties the FIFO.
const FLUSH_FIFO: [u8; 2] = [0x4b, 1 << 1];
/// The gyro has to be on for 45 ms before it is used or switched off again.
const START_UP_MS: u32 = 50;
/// Packets in a full FIFO: 2 KiB of 20 bytes.
pub const FIFO_PACKETS: u8 = 102;
/// Bytes of a packet.
const PACKET: u16 = 20;
/// What the published driver sends for a sample, and whoever reads one for it: read from INT_STATUS on, which is followed by
/// the FIFO's count and its oldest packet.
pub const READ: [u8; 24] = {
    let mut request = [0; 24];
    request[0] = 0x80 | 0x2d;
    request
};
/// INT_STATUS: the FIFO was full.
const FIFO_FULL: u8 = 1 << 1;

/// Returns whether the FIFO held more than the packet that was read, by what [`READ`] brought. A full one is left to the
/// driver, which empties it.
pub fn holds_more(read: &[u8]) -> bool {
    let [_, status, high, low, ..] = read else { return false };
    let count = u16::from_be_bytes([*high, *low]);
    status & FIFO_FULL == 0 && count > PACKET && count != u16::MAX
}

/// Tells what went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImuError<E> {
    /// The bus failed.
    Bus(E),
    /// Another chip answers.
    WrongId,
    /// The FIFO was full: samples were lost. It has been emptied.
    Overflow,
    /// A packet without both sensors: the chip has lost its settings, or nothing answers.
    Packet,
    /// Initialisation failed half-way or was never done; the device must be restarted.
    NotReady,
    /// No such rate.
    BadRate(u32),
}

/// One sample, in the IMU's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// Specific force, m/s².
    pub specific_force_mps2: [f32; 3],
    /// Angular rate, rad/s.
    pub angular_rate_radps: [f32; 3],
    /// Temperature of the chip, °C.
    pub temperature_c: f32,
}

enum Device<SPI> {
    Bus(SPI),
    Ready(ICM42688<SPI, Ready>),
    Lost,
}

/// The driver.
pub struct Imu<SPI> {
    device: Device<SPI>,
    errors: u32,
    overflows: u32,
    skipped: u32,
}

impl<SPI: SpiDevice> Imu<SPI> {
    /// A driver on this bus; nothing is sent yet.
    pub const fn new(spi: SPI) -> Self {
        Self { device: Device::Bus(spi), errors: 0, overflows: 0, skipped: 0 }
    }

    /// Reads that failed, overflows included, since this driver was made.
    pub const fn errors(&self) -> u32 {
        self.errors
    }

    /// Returns how often the FIFO was full.
    pub const fn overflows(&self) -> u32 {
        self.overflows
    }

    /// Samples passed over because a later one was already there.
    pub const fn skipped(&self) -> u32 {
        self.skipped
    }

    /// Resets the chip and sets it up: 25, 50, 100, 200, 500, 1000, 2000 or 4000 samples per second. May be repeated,
    /// except after a bus that failed half-way.
    ///
    /// # Errors
    /// No such rate, another chip, or the bus.
    pub fn bring_up(&mut self, delay: &mut impl DelayNs, rate_hz: u32) -> Result<(), ImuError<SPI::Error>> {
        let rate = output_data_rate(rate_hz).ok_or(ImuError::BadRate(rate_hz))?;
        let mut spi = match core::mem::replace(&mut self.device, Device::Lost) {
            Device::Bus(spi) => spi,
            Device::Ready(driver) => driver.release(),
            Device::Lost => return Err(ImuError::NotReady),
        };
        let mut answer = [WHO_AM_I, 0];
        let asked = spi.transfer_in_place(&mut answer);
        let [_, id] = answer;
        if asked.is_err() || id != ICM_42688_P {
            self.device = Device::Bus(spi);
            return asked.map_err(ImuError::Bus).and(Err(ImuError::WrongId));
        }
        let config = Config { rate, ..Config::default() };
        let mut driver = ICM42688::new(spi).initialize(&mut *delay, config).map_err(error)?;
        delay.delay_ms(START_UP_MS);
        let flushed = flush(&mut driver);
        self.device = Device::Ready(driver);
        flushed
    }

    /// Reads the sample that the chip has signalled: the newest in its FIFO; `None` if it holds none.
    ///
    /// # Errors
    /// The bus, an overflow, a packet that was not asked for (all counted), or a chip that was not set up.
    #[inline]
    pub fn read(&mut self) -> Result<Option<ImuSample>, ImuError<SPI::Error>> {
        let Device::Ready(driver) = &mut self.device else { return Err(ImuError::NotReady) };
        let result = newest(driver, &mut self.skipped);
        if let Err(error) = &result {
            self.errors = self.errors.saturating_add(1);
            if matches!(error, ImuError::Overflow) {
                self.overflows = self.overflows.saturating_add(1);
                // What is left is old.
                flush(driver)?;
            }
        }
        result
    }
}

/// The newest sample in the FIFO; older ones are counted.
fn newest<SPI: SpiDevice>(
    driver: &mut ICM42688<SPI, Ready>,
    skipped: &mut u32,
) -> Result<Option<ImuSample>, ImuError<SPI::Error>> {
    let mut newest = None;
    for _ in 0..FIFO_PACKETS {
        let Some((sample, more)) = driver.read_sample().map_err(error)? else { break };
        let (Some(a), Some(g)) = (sample.accel, sample.gyro) else { return Err(ImuError::Packet) };
        let sample = ImuSample {
            specific_force_mps2: a.into(),
            angular_rate_radps: g.into(),
            temperature_c: temperature_c(sample.temperature_celsius),
        };
        if newest.replace(sample).is_some() {
            *skipped = skipped.saturating_add(1);
        }
        if !more {
            break;
        }
    }
    Ok(newest)
}

/// The published driver takes the 16 temperature bits of a 20-bit packet as unsigned and scales them like the 8 bits
/// of the short packets, 2.07 per °C. Back to the bits (a half is added to round), and on by 132.48 per °C.
fn temperature_c(as_short_packet_c: f32) -> f32 {
    let bits = ((as_short_packet_c - 25.0) * 2.07 + 0.5) as u16;
    f32::from(bits.cast_signed()) / 132.48 + 25.0
}

/// Empties the FIFO; a write of its own, because the published one can panic on a wrong register bank.
fn flush<SPI: SpiDevice>(driver: &mut ICM42688<SPI, Ready>) -> Result<(), ImuError<SPI::Error>> {
    driver.ll().bus().write(&FLUSH_FIFO).map_err(ImuError::Bus)
}

fn error<E>(error: Error<E>) -> ImuError<E> {
    match error {
        Error::Bus(e) => ImuError::Bus(e),
        Error::WhoAmIMismatch(_) => ImuError::WrongId,
        Error::FifoOverflow => ImuError::Overflow,
    }
}

fn output_data_rate(rate_hz: u32) -> Option<OutputDataRate> {
    Some(match rate_hz {
        25 => OutputDataRate::Hz25,
        50 => OutputDataRate::Hz50,
        100 => OutputDataRate::Hz100,
        200 => OutputDataRate::Hz200,
        500 => OutputDataRate::Hz500,
        1000 => OutputDataRate::Hz1000,
        2000 => OutputDataRate::Hz2000,
        4000 => OutputDataRate::Hz4000,
        _ => return None,
    })
}

#[cfg(test)]
#[path = "imu_tests.rs"]
mod tests;
