//! The IMU: an ICM-42688-P through the published driver `icm426xx`.
//!
//! That driver sets ±16 g and ±2000 °/s, the widest bandwidth of the filters, and 20-bit FIFO packets
//! (3e-4 m/s² and 6.7e-5 rad/s per code), one packet per data-ready signal. This adapter checks the chip before
//! handing the bus over, because the published driver keeps the bus when its initialisation fails.

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;
use icm426xx::{Config, Error, ICM42688, OutputDataRate, Ready};

/// Read flag and address of WHO_AM_I, and what it holds.
const WHO_AM_I: u8 = 0x80 | 0x75;
const ICM_42688_P: u8 = 0x47;

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImuError<E> {
    /// The bus failed.
    Bus(E),
    /// Another chip answers.
    WrongId,
    /// Samples were lost because they were not read in time.
    Overflow,
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
}

impl<SPI: SpiDevice> Imu<SPI> {
    /// A driver on this bus; nothing is sent yet.
    pub const fn new(spi: SPI) -> Self {
        Self { device: Device::Bus(spi) }
    }

    /// Resets the chip and sets it up: 25, 50, 100, 200, 500, 1000, 2000 or 4000 samples per second.
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
        let driver = ICM42688::new(spi).initialize(delay, config).map_err(error)?;
        self.device = Device::Ready(driver);
        Ok(())
    }

    /// Reads the sample that the chip has signalled; `None` if its FIFO holds none.
    ///
    /// # Errors
    /// The bus, an overflow, or a chip that was not set up.
    #[inline]
    pub fn read(&mut self) -> Result<Option<ImuSample>, ImuError<SPI::Error>> {
        let Device::Ready(driver) = &mut self.device else { return Err(ImuError::NotReady) };
        let Some((sample, _)) = driver.read_sample().map_err(error)? else { return Ok(None) };
        let (Some(a), Some(g)) = (sample.accel, sample.gyro) else { return Ok(None) };
        Ok(Some(ImuSample {
            specific_force_mps2: a.into(),
            angular_rate_radps: g.into(),
            temperature_c: sample.temperature_celsius,
        }))
    }
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
