//! Drivers and application as one: what a board owns.

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;
use rigident_shared::wire::{Reason, SensorFault, SettingName};

use crate::app::{App, BringUpError, Sensor, SensorRates};
use crate::drivers::ads131m08::{AdcConfig, AdcError, Ads131m08};
use crate::drivers::imu::{Imu, ImuError};

/// Gain of the converter: ±18.75 mV for bridges of a few mV/V.
const GAIN: u8 = 64;
/// The converter's channels that are gauges.
const GAUGES: u8 = 0b11_1111;

/// A sensor has a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// Which sensor.
    pub sensor: Sensor,
    /// When the sample was captured, ns.
    pub capture_time_ns: u64,
}

/// The drivers with the application.
///
/// A board calls [`Instrument::on_event`] when a sensor signals a sample, [`Instrument::on_bytes`] with what
/// the host sent, [`Instrument::tick`] now and then, and sends what [`Instrument::poll_tx`] gives.
pub struct Instrument<ADC, IMU, D> {
    app: App,
    adc: Ads131m08<ADC>,
    imu: Imu<IMU>,
    delay: D,
}

impl<ADC: SpiDevice, IMU: SpiDevice, D: DelayNs> Instrument<ADC, IMU, D> {
    /// On the named board, with the two sensors and something that waits. Nothing is sent to the sensors yet.
    pub fn new(board: &str, adc: ADC, imu: IMU, delay: D) -> Self {
        Self { app: App::new(board), adc: Ads131m08::new(adc), imu: Imu::new(imu), delay }
    }

    /// The application.
    pub fn app(&self) -> &App {
        &self.app
    }

    /// Takes bytes from the host. Brings the sensors up when told to, which may take some tens of milliseconds.
    pub fn on_bytes(&mut self, bytes: &[u8], now_ns: u64) {
        for byte in bytes {
            if let Some(rates) = self.app.on_byte(*byte, now_ns) {
                let result = self.bring_up(rates);
                self.app.sensors_up(result);
            }
        }
    }

    fn bring_up(&mut self, rates: SensorRates) -> Result<(), BringUpError> {
        let config = AdcConfig { rate_hz: rates.load_cell_hz as u32, gain: GAIN };
        self.adc.bring_up(&mut self.delay, &config).map_err(|error| match error {
            AdcError::BadRate(_) => BringUpError::Setting(SettingName::Rate),
            other => BringUpError::Fault(Reason::LoadCell(adc_fault(&other))),
        })?;
        self.imu.bring_up(&mut self.delay, rates.imu_hz as u32).map_err(|error| match error {
            ImuError::BadRate(_) => BringUpError::Setting(SettingName::ImuRate),
            other => BringUpError::Fault(Reason::Imu(imu_fault(&other))),
        })
    }

    /// Reads the sample that a sensor has signalled, and does everything that follows from it. While no samples
    /// are wanted the sensors, which may not be set up, are left alone.
    pub fn on_event(&mut self, event: Event) {
        if !self.app.listens() {
            return self.app.tick(event.capture_time_ns);
        }
        match event.sensor {
            Sensor::LoadCell => match self.adc.read_frame() {
                Ok(frame) if frame.saturated & GAUGES != 0 => {
                    self.app.on_clipped(event.capture_time_ns, frame.saturated & GAUGES);
                }
                Ok(frame) => self.app.on_gauges(event.capture_time_ns, frame.gauges_v(GAIN)),
                Err(error) => self.app.on_sensor_error(Sensor::LoadCell, adc_fault(&error)),
            },
            Sensor::Imu => {
                let skipped = self.imu.skipped();
                match self.imu.read() {
                    Ok(Some(sample)) => self.app.on_imu(
                        event.capture_time_ns,
                        sample.specific_force_mps2,
                        sample.angular_rate_radps,
                    ),
                    Ok(None) => {}
                    Err(error) => self.app.on_sensor_error(Sensor::Imu, imu_fault(&error)),
                }
                let late = self.imu.skipped().wrapping_sub(skipped);
                if late > 0 {
                    self.app.on_late_imu(late as u16);
                }
            }
        }
        self.app.work();
    }

    /// Moves the application's clock.
    pub fn tick(&mut self, now_ns: u64) {
        self.app.tick(now_ns);
    }

    /// Bytes waiting to be sent.
    pub fn tx_pending(&self) -> usize {
        self.app.tx_pending()
    }

    /// Takes bytes to send; how many.
    pub fn poll_tx(&mut self, out: &mut [u8]) -> usize {
        self.app.poll_tx(out)
    }
}

fn adc_fault<E>(error: &AdcError<E>) -> SensorFault {
    match error {
        AdcError::Bus(_) => SensorFault::Bus,
        AdcError::Crc { .. } | AdcError::InputCrc => SensorFault::Check,
        AdcError::WrongId(_) => SensorFault::WrongId,
        AdcError::Verify { .. } => SensorFault::Verify,
        AdcError::DeviceReset => SensorFault::Restarted,
        AdcError::BadRate(_) | AdcError::BadGain(_) => SensorFault::Rate,
    }
}

fn imu_fault<E>(error: &ImuError<E>) -> SensorFault {
    match error {
        ImuError::WrongId => SensorFault::WrongId,
        ImuError::BadRate(_) => SensorFault::Rate,
        _ => SensorFault::Bus,
    }
}
