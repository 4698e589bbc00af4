//! Drivers and application as one: what a board owns.

use core::ops::DerefMut;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, SpiDevice};
use rigident_shared::wire::{BadEnd, ClockSource, Reason, ResetReason, SensorFault, SettingName};

use crate::EventRoom;
use crate::Path;
use crate::app::{App, BringUpError, Sensor, SensorRates};
use crate::drivers::ads131m08::{AdcConfig, AdcError, Ads131m08};
use crate::drivers::frames::{FrameError, FrameSource};
use crate::drivers::imu::{Imu, ImuError};
#[cfg(feature = "storage")]
use crate::storage::{Duty, Store};

/// Gain of the converter: ±18.75 mV for bridges of a few mV/V.
const GAIN: u8 = 64;
/// The converter's channels that are gauges.
const GAUGES: u8 = 0b11_1111;

/// A sensor has a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// Tells which sensor.
    pub sensor: Sensor,
    /// Tells when the sample was captured, ns.
    pub capture_time_ns: u64,
}

/// The drivers with the application.
///
/// A board calls [`Instrument::on_event`] when a sensor signals a sample, [`Instrument::on_bytes`] with what
/// the host sent, [`Instrument::tick`] now and then, and sends what [`Instrument::poll_tx`] gives.
pub struct Instrument<P, ADC, IMU: ErrorType, FRAMES, D> {
    app: App<P>,
    adc: Ads131m08<ADC>,
    imu: Imu<IMU>,
    second: Imu<IMU>,
    frames: FrameSource<FRAMES>,
    delay: D,
    next_look_ns: u64,
}

/// A setting of each IMU is looked at this often, ns: all of them in two seconds.
const LOOK_EVERY_NS: u64 = 100_000_000;

/// Holds where the sensors are. Those that are not configured are left alone.
pub struct Buses<ADC, IMU, FRAMES> {
    /// The load cell's converter.
    pub load_cell: ADC,
    /// The IMU, and the second link's.
    pub imus: [IMU; 2],
    /// The source of frames.
    pub frames: FRAMES,
}

impl<P: DerefMut<Target = Path>, ADC: SpiDevice, IMU: SpiDevice, FRAMES: SpiDevice, D: DelayNs>
    Instrument<P, ADC, IMU, FRAMES, D>
{
    /// Makes an instrument on the named board, with room for the estimator, the sensors and something that
    /// waits. Nothing is sent to the sensors yet.
    pub fn new(board: &str, path: P, buses: Buses<ADC, IMU, FRAMES>, delay: D) -> Self {
        let Buses { load_cell, imus: [imu, second], frames } = buses;
        Self {
            app: App::new(board, path),
            adc: Ads131m08::new(load_cell),
            imu: Imu::new(imu),
            second: Imu::new(second),
            frames: FrameSource::new(frames),
            delay,
            next_look_ns: 0,
        }
    }

    /// Returns the application.
    pub fn app(&self) -> &App<P> {
        &self.app
    }

    /// Receives the room for events, whose memory a reset has left alone. [`Self::booted`] comes after it.
    pub fn keeps_events(&mut self, room: &'static EventRoom) {
        self.app.keeps_events(room);
    }

    /// Notes why the board started, and what its time comes from.
    pub fn booted(&mut self, reset: ResetReason, clock: ClockSource) {
        self.app.booted(reset, clock);
    }

    /// Counts samples that a sensor signalled and that the board could not keep.
    pub fn on_lost(&mut self, sensor: Sensor, count: u32) {
        self.app.on_lost(sensor, count);
    }

    /// Notes the chip's own number, and where the last program ended if it ended badly.
    pub fn is_chip(&mut self, unique_id: [u8; 12], ended: Option<BadEnd>) {
        self.app.is_chip(unique_id, ended);
    }

    /// Notes that the board starts anew when [`App::restart_is_due`].
    pub fn can_restart(&mut self) {
        self.app.can_restart();
    }

    /// Notes how deep the stack has been, and how large it is, bytes.
    pub fn stack_was(&mut self, deepest: u32, size: u32) {
        self.app.stack_was(deepest, size);
    }

    /// Counts transfers with sensors that did not end, or ended with an error.
    pub fn on_failed_transfers(&mut self, overdue: u32, failed: u32) {
        self.app.on_failed_transfers(overdue, failed);
    }

    /// Notes that the board can change the rate of its line, up to this one, baud.
    pub fn line_goes_up_to(&mut self, baud: u32) {
        self.app.line_goes_up_to(baud);
    }

    /// Counts times that the board had no room for bytes from the host.
    pub fn on_overruns(&mut self, count: u32) {
        self.app.on_overruns(count);
    }

    /// Takes bytes from the host. Brings the sensors up on command, which may take some tens of milliseconds.
    // In the frame of a board's main loop, whose room it shares: by itself it takes 8 kB of stack.
    #[inline(always)]
    pub fn on_bytes(&mut self, bytes: &[u8], now_ns: u64) {
        self.on_bytes_pausing(bytes, now_ns, || {});
    }

    /// Takes bytes from the host as [`Self::on_bytes`] does, for a board whose interrupts read samples:
    /// `pause` is called before the sensors are brought up, which no sample may come between. The board
    /// listens again to those that [`App::wanted`] names.
    #[inline(always)]
    pub fn on_bytes_pausing(&mut self, bytes: &[u8], now_ns: u64, mut pause: impl FnMut()) {
        for byte in bytes {
            if let Some(rates) = self.app.on_byte(*byte, now_ns) {
                pause();
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
        })?;
        let Some(rate_hz) = rates.second_imu_hz else { return Ok(()) };
        self.second.bring_up(&mut self.delay, rate_hz as u32).map_err(|error| match error {
            ImuError::BadRate(_) => BringUpError::Setting(SettingName::SecondImu),
            other => BringUpError::Fault(Reason::SecondImu(imu_fault(&other))),
        })
    }

    /// Reads the sample that a sensor has signalled, and does everything that follows from it. A sensor whose
    /// samples are not wanted, and which may not be set up, is left alone.
    pub fn on_event(&mut self, event: Event) {
        if !self.app.wants(event.sensor) {
            return self.app.tick(event.capture_time_ns);
        }
        match event.sensor {
            Sensor::LoadCell => match self.adc.read_frame() {
                Ok(frame) if frame.saturated & GAUGES != 0 => {
                    self.app.on_clipped(event.capture_time_ns, frame.saturated & GAUGES);
                }
                Ok(frame) => {
                    self.app.on_gauges(event.capture_time_ns, frame.gauges_v(GAIN), frame.excitation_v())
                }
                Err(error) => self.app.on_sensor_error(Sensor::LoadCell, adc_fault(&error)),
            },
            sensor @ (Sensor::Imu | Sensor::SecondImu) => self.read_imu(sensor, event.capture_time_ns),
            Sensor::Frames => {
                let Some((links, kind)) = self.app.frame_links() else { return };
                match self.frames.read(links, kind) {
                    Ok(frame) => self.app.on_frame(event.capture_time_ns, &frame),
                    Err(FrameError::Links(links)) => {
                        self.app.on_frame_of_links(event.capture_time_ns, links);
                    }
                    Err(FrameError::Damaged) => {
                        self.app.on_sensor_error(Sensor::Frames, SensorFault::Check);
                    }
                    Err(FrameError::Bus) => self.app.on_sensor_error(Sensor::Frames, SensorFault::Bus),
                }
            }
        }
        self.app.work();
    }

    #[inline(never)]
    fn read_imu(&mut self, sensor: Sensor, time_ns: u64) {
        let imu = if sensor == Sensor::Imu { &mut self.imu } else { &mut self.second };
        let skipped = imu.skipped();
        let read = imu.read();
        let late = imu.skipped().wrapping_sub(skipped);
        match read {
            Ok(Some(sample)) => {
                let (force, rate) = (sample.specific_force_mps2, sample.angular_rate_radps);
                if sensor == Sensor::Imu {
                    self.app.on_imu(time_ns, force, rate);
                } else {
                    self.app.on_second_imu(time_ns, force, rate);
                }
            }
            Ok(None) => {}
            Err(error) => self.app.on_sensor_error(sensor, imu_fault(&error)),
        }
        if late > 0 {
            self.app.on_late_imu(sensor, late as u16);
        }
    }

    /// Does what is to be done with the flash, if anything: a board that has one calls it whenever it has
    /// checked its queues. While samples are taken it takes as long as programming one record at most;
    /// nothing is erased then.
    #[cfg(feature = "storage")]
    pub fn tend<F: embedded_storage::nor_flash::NorFlash>(&mut self, store: &mut Store<F>) {
        match self.app.duty() {
            Duty::None => {}
            Duty::Look => self.app.look(store),
            Duty::Settings => self.app.keep_settings(store),
            Duty::Checkpoint(run) => self.app.keep_checkpoint(store, run),
            Duty::Resume(asked) => {
                let settings = store.settings(asked.run).ok();
                let rates = settings.as_ref().and_then(|settings| self.app.rates(settings));
                let sensors = rates.map_or(Ok(()), |rates| self.bring_up(rates));
                self.app.resume(store, asked, settings, sensors);
            }
        }
    }

    /// Does the same work as [`Self::tend`], for a board that stands still while a sector is erased: nothing
    /// that may erase is done before everything has been sent, and while bytes wait that the host has sent.
    /// `quiet`: neither is the case on the board's side.
    #[cfg(feature = "storage")]
    pub fn tend_when_quiet<F: embedded_storage::nor_flash::NorFlash>(
        &mut self,
        store: &mut Store<F>,
        quiet: bool,
    ) {
        let erases = matches!(self.app.duty(), Duty::Look | Duty::Settings | Duty::Resume(_));
        if !erases || (quiet && self.app.tx_pending() == 0) {
            self.tend(store);
        }
    }

    /// Moves the application's clock.
    pub fn tick(&mut self, now_ns: u64) {
        self.app.tick(now_ns);
        if now_ns >= self.next_look_ns {
            self.next_look_ns = now_ns.saturating_add(LOOK_EVERY_NS);
            self.look_at_settings();
        }
    }

    /// Looks whether IMUs that give samples are still set up as they were. The converter says so of itself.
    #[cold]
    #[inline(never)]
    fn look_at_settings(&mut self) {
        for (sensor, imu) in [(Sensor::Imu, &mut self.imu), (Sensor::SecondImu, &mut self.second)] {
            if self.app.wants(sensor)
                && let Err(error) = imu.look_at_a_setting()
            {
                self.app.on_sensor_error(sensor, imu_fault(&error));
            }
        }
    }

    /// Returns the number of bytes waiting to be sent.
    pub fn tx_pending(&self) -> usize {
        self.app.tx_pending()
    }

    /// Takes bytes to send. Returns their number.
    pub fn poll_tx(&mut self, out: &mut [u8]) -> usize {
        self.app.poll_tx(out)
    }
}

#[cold]
#[inline(never)]
fn adc_fault<E>(error: &AdcError<E>) -> SensorFault {
    match error {
        AdcError::Bus(_) => SensorFault::Bus,
        AdcError::Crc { .. } | AdcError::InputCrc => SensorFault::Check,
        AdcError::WrongId(_) => SensorFault::WrongId,
        AdcError::Verify { .. } => SensorFault::Verify,
        AdcError::DeviceReset => SensorFault::Restarted,
        AdcError::Registers => SensorFault::Verify,
        AdcError::Resynced => SensorFault::Resynced,
        AdcError::Stale => SensorFault::Stale,
        AdcError::BadRate(_) | AdcError::BadGain(_) => SensorFault::Rate,
    }
}

#[cold]
#[inline(never)]
fn imu_fault<E>(error: &ImuError<E>) -> SensorFault {
    match error {
        ImuError::WrongId => SensorFault::WrongId,
        ImuError::BadRate(_) => SensorFault::Rate,
        ImuError::Verify { .. } => SensorFault::Verify,
        _ => SensorFault::Bus,
    }
}
