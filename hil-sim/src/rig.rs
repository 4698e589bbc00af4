//! The whole rig: platform, body, sensors and converters under one clock.
//!
//! Lives here: [`RigConfig`] (what the rig is), [`Rig`] (the rig at work, event by event, through the
//! registers) and
//! [`Readings`] (the same physics as float readings at one rate, for Monte Carlo). May not live here: the
//! firmware, files. Before this: [`crate::devices`]; next: [`crate::runner`].
//!
//! The clock is virtual. In lock-step it moves only while a motion program runs, from one sensor event to the
//! next; free-running it follows the time it is given. Only what is in the converters' registers leaves the
//! rig.

mod config;
mod follow;
mod motion;
mod readings;
mod wiring;

pub use config::{EXCITATION_V, RigConfig, RigError};
pub use motion::MotionState;
pub use readings::{ReadingRow, ReadingStream, Readings};
pub use wiring::WiringFault;

use std::sync::{Arc, Mutex};

use config::Mechanics;
use motion::Platform;
use wiring::Wiring;

use crate::devices::{Ads131m08, Device, Icm42688};
use crate::links::JointState;
use crate::sensors::{Experiment, Fault, ImuChain, LoadCellChain};
use hexapod::{BodyParameters, FrameMotion};
use hexapod::{MotionProgram, Pose};

/// A rig that a runner and a platform controller share.
pub type SharedRig = Arc<Mutex<Rig>>;

/// The messages of the sensors' data-ready lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusEvent {
    /// Nothing.
    Idle,
    /// The load cell's converter has a conversion, captured at this time, ns.
    LoadCellReady(u64),
    /// The IMU has a sample, captured at this time, ns.
    ImuReady(u64),
    /// The second link's IMU has one.
    SecondImuReady(u64),
}

/// The true state; never given to the firmware.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Inertial parameters in S.
    pub body: BodyParameters,
    /// The random draw of the experiment.
    pub experiment: Experiment,
    /// Wrench offset that a perfect estimator finds when it believes the accelerometer's zero: an
    /// accelerometer that reads `b_a` too much (turned into S) takes `m b_a` off the forces and `mc × b_a`
    /// off the moments. N, N m.
    pub apparent_offset_n_nm: [f64; 6],
    /// Motion of S, in the earth's axes.
    pub sensor_motion: FrameMotion,
}

impl Truth {
    fn new(mechanics: &Mechanics, experiment: &Experiment, sensor_motion: FrameMotion) -> Self {
        Self {
            body: mechanics.body(),
            experiment: *experiment,
            apparent_offset_n_nm: mechanics.apparent_offset(experiment),
            sensor_motion,
        }
    }
}

/// Data-ready line of a converter with its own rate.
#[derive(Clone, Debug)]
struct Ticker {
    rate_hz: Option<f64>,
    origin_ns: f64,
    phase_ns: f64,
    ticks: u64,
}

impl Ticker {
    fn new(phase_s: f64) -> Self {
        Self { rate_hz: None, origin_ns: 0.0, phase_ns: phase_s * 1e9, ticks: 0 }
    }

    /// Starts afresh when the converter's registers have changed the rate.
    fn follow(&mut self, rate_hz: Option<f64>, now_ns: u64) {
        if self.rate_hz != rate_hz {
            (self.rate_hz, self.origin_ns, self.ticks) = (rate_hz, now_ns as f64, 0);
        }
    }

    fn next_ns(&self) -> Option<u64> {
        self.rate_hz.map(|rate| {
            (self.origin_ns + self.phase_ns + (self.ticks + 1) as f64 * 1e9 / rate).round() as u64
        })
    }
}

/// The rig at work.
#[derive(Debug)]
pub struct Rig {
    config: RigConfig,
    mechanics: Mechanics,
    platform: Platform,
    experiment: Experiment,
    load_cell: LoadCellChain,
    imu: ImuChain,
    second_imu: ImuChain,
    adc: Ads131m08,
    imu_device: Icm42688,
    second_device: Icm42688,
    adc_ticker: Ticker,
    imu_ticker: Ticker,
    second_ticker: Ticker,
    wiring: Wiring,
    now_ns: u64,
}

impl Rig {
    /// Returns a rig that has just been switched on, the plate at home, its clock at zero.
    ///
    /// # Errors
    /// A singular gauge calibration, or a mounting whose quaternion is zero.
    pub fn new(config: RigConfig) -> Result<Self, RigError> {
        let mechanics = Mechanics::new(&config)?;
        let experiment = config.sensors.draw(config.seed);
        Ok(Self {
            load_cell: LoadCellChain::new(&config.sensors, &experiment, config.seed),
            imu: ImuChain::new(&config.sensors, &experiment, config.seed),
            second_imu: ImuChain::second(&config.sensors, config.seed),
            platform: Platform::resting(&config.geometry.home()),
            adc_ticker: Ticker::new(0.0),
            imu_ticker: Ticker::new(config.imu_phase_s),
            // Neither with the load cell nor with the other IMU.
            second_ticker: Ticker::new(0.5 * config.imu_phase_s),
            adc: Ads131m08::new(),
            imu_device: Icm42688::new(),
            second_device: Icm42688::new(),
            wiring: Wiring::default(),
            now_ns: 0,
            mechanics,
            experiment,
            config,
        })
    }

    /// Makes a rig for runners and a platform controller to share.
    pub fn shared(self) -> SharedRig {
        Arc::new(Mutex::new(self))
    }

    /// Returns what the rig is.
    pub fn config(&self) -> &RigConfig {
        &self.config
    }

    /// Returns the rig's clock, ns.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Returns where the plate is.
    pub fn pose(&self) -> Pose {
        self.platform.coordinates(self.now_ns as f64).plate_state().pose()
    }

    /// Returns whether the plate moves.
    pub fn motion(&self) -> MotionState {
        self.platform.state()
    }

    /// Returns how many motions have begun since the rig was switched on: programs, moves, and streams of
    /// points from rest.
    pub fn motions_begun(&self) -> u64 {
        self.platform.begun()
    }

    /// Returns whether a program was started and has come to its end, or was stopped and has come to rest.
    pub fn is_done(&self) -> bool {
        self.platform.state() == MotionState::Done
    }

    /// Returns the time since the start of the program, s; stands still when it is over.
    pub fn program_time_s(&self) -> f64 {
        self.platform.elapsed_s(self.now_ns as f64)
    }

    /// Returns the duration of the loaded program, its approach included, s.
    pub fn program_duration_s(&self) -> f64 {
        self.platform.duration_s()
    }

    /// Takes a motion program and checks it against the legs. If it starts elsewhere than where the plate is,
    /// a move to its start is put before it.
    ///
    /// # Errors
    /// While the plate moves; a segment that makes no sense; a leg that would leave its reach or be too fast.
    pub fn load_program(&mut self, program: MotionProgram) -> Result<(), RigError> {
        self.platform.load(&program, &self.config.geometry)
    }

    /// Starts the loaded program.
    ///
    /// # Errors
    /// While the plate moves, or if nothing is loaded.
    pub fn start(&mut self) -> Result<(), RigError> {
        self.platform.start(self.now_ns as f64)
    }

    /// Brings the plate to rest within half a second on the path it is on, and leaves it there.
    pub fn stop(&mut self) {
        self.platform.stop(self.now_ns as f64);
    }

    /// Brings a plate that moves by set points to rest within a twentieth of a second, with the accelerations
    /// that this takes; one that follows a program stops as by [`Rig::stop`].
    pub fn stop_abruptly(&mut self) {
        self.platform.stop_abruptly(self.now_ns as f64);
    }

    /// Goes to a pose in the given time, s, from rest or from a motion by set points.
    ///
    /// # Errors
    /// While a program runs; a leg that would leave its reach or be too fast.
    pub fn move_to(&mut self, to: &Pose, duration_s: f64) -> Result<(), RigError> {
        self.platform.go(self.now_ns as f64, to, duration_s, &self.config.geometry)
    }

    /// Orders the plate to pass a pose at a time of the rig's clock, ns. Points come in order of time; the
    /// plate brakes at the last but one if no more come in time.
    ///
    /// # Errors
    /// While a program runs; a leg that would leave its reach or be too fast; a point after its time.
    pub fn pass_through(&mut self, pose: &Pose, at_ns: u64) -> Result<(), RigError> {
        self.platform.pass(self.now_ns as f64, at_ns as f64, pose, &self.config.geometry)
    }

    /// Returns whether the plate brakes, or has braked, because the points of [`Self::pass_through`] ceased.
    /// A stop ends that.
    pub fn is_starved(&self) -> bool {
        self.platform.starved(self.now_ns as f64)
    }

    /// Adds a sensor fault that acts from now on (its times are the rig's).
    pub fn add_fault(&mut self, fault: Fault) {
        self.load_cell.add_fault(fault.clone());
        self.imu.add_fault(fault);
    }

    /// Wires something wrongly from now on.
    pub fn wire(&mut self, fault: WiringFault) {
        self.wiring.add(fault);
    }

    /// Inverts one bit of a frame from the load cell's converter; see [`Ads131m08::flip_bit`].
    pub fn flip_load_cell_bit(&mut self, ahead: u64, bit: usize) {
        self.adc.flip_bit(ahead, bit);
    }

    /// Changes bits of a register of the load cell's converter; see [`Ads131m08::disturb`].
    pub fn disturb_load_cell_register(&mut self, address: usize, bits: u16) {
        self.adc.disturb(address, bits);
    }

    /// Gives a pulse to the load cell's converter on its SYNC pin.
    pub fn resynchronise_load_cell(&mut self) {
        self.adc.resynchronise();
    }

    /// Sets the frequency of the oscillator of the load cell's converter, Hz.
    pub fn set_load_cell_clock_hz(&mut self, clock_hz: f64) {
        self.adc.set_clock_hz(clock_hz);
    }

    /// Lets the load cell's converter hold two conversions; see [`Ads131m08::hold_two`].
    pub fn hold_two_conversions(&mut self) {
        self.adc.hold_two();
    }

    /// Returns the load cell's converter, to look at.
    pub fn load_cell_converter(&self) -> &Ads131m08 {
        &self.adc
    }

    /// Returns the IMU, for inspection.
    pub fn imu_device(&self) -> &Icm42688 {
        &self.imu_device
    }

    /// Returns the next data-ready event of the running program: the clock jumps to it. `Idle`, and the clock
    /// stands still, while no program runs.
    pub fn next_event(&mut self) -> BusEvent {
        match self.platform.end_ns() {
            Some(end_ns) => self.advance(end_ns),
            None => BusEvent::Idle,
        }
    }

    /// Returns the next data-ready event no later than `limit_ns`, whether or not a program runs; if there is
    /// none the clock is set to `limit_ns` and the answer is `Idle`.
    pub fn next_event_before(&mut self, limit_ns: u64) -> BusEvent {
        self.advance(limit_ns.max(self.now_ns))
    }

    /// Returns the time when the next conversion or sample is due, ns of the rig's clock, whether it is
    /// reported or not.
    pub fn next_due_ns(&mut self) -> Option<u64> {
        self.follow_rates();
        let tickers = [&self.adc_ticker, &self.imu_ticker, &self.second_ticker];
        tickers.into_iter().filter_map(Ticker::next_ns).min()
    }

    fn follow_rates(&mut self) {
        self.adc_ticker.follow(self.adc.rate_hz(), self.now_ns);
        self.imu_ticker.follow(self.imu_device.rate_hz(), self.now_ns);
        self.second_ticker.follow(self.second_device.rate_hz(), self.now_ns);
    }

    fn advance(&mut self, limit_ns: u64) -> BusEvent {
        loop {
            self.follow_rates();
            let (adc, imu) = (self.adc_ticker.next_ns(), self.imu_ticker.next_ns());
            let second = self.second_ticker.next_ns();
            let next_ns = [adc, imu, second].into_iter().flatten().min();
            let (adc_first, second_first) = (adc == next_ns, imu != next_ns);
            let Some(time_ns) = next_ns.filter(|t| *t <= limit_ns) else {
                self.now_ns = limit_ns;
                self.platform.settle(self.now_ns as f64);
                return BusEvent::Idle;
            };
            self.now_ns = time_ns;
            if adc_first {
                self.adc_ticker.ticks += 1;
                self.convert(time_ns);
                if self.wiring.tells(Device::LoadCell) {
                    return BusEvent::LoadCellReady(time_ns);
                }
                continue;
            }
            if second_first {
                self.second_ticker.ticks += 1;
                if self.sample_second_imu(time_ns) && self.wiring.tells(Device::SecondImu) {
                    return BusEvent::SecondImuReady(time_ns);
                }
                continue;
            }
            self.imu_ticker.ticks += 1;
            // Without an interrupt enabled the sample is in the FIFO, but nobody is informed.
            if self.sample_imu(time_ns) && self.wiring.tells(Device::Imu) {
                return BusEvent::ImuReady(time_ns);
            }
        }
    }

    fn convert(&mut self, time_ns: u64) {
        let model = &self.config.sensors.load_cell;
        let delay_s = model.delay_s + model.undeclared_delay_s + self.adc.group_delay_s();
        let plate = self.platform.coordinates(time_ns as f64 - 1e9 * delay_s).plate_state();
        let mut truth = self.mechanics.wrench(&plate);
        if let Some(joint) = self.second_joint(time_ns as f64 * 1e-9 - delay_s) {
            let second = self.mechanics.second_wrench(&plate, &joint);
            truth.iter_mut().zip(second).for_each(|(w, more)| *w += more);
        }
        let wrench = self.load_cell.read(time_ns as f64 * 1e-9, truth);
        let excitation = self.load_cell.excitation(time_ns as f64 * 1e-9);
        self.adc.convert(&self.mechanics.inputs_v(&wrench, excitation));
    }

    fn sample_imu(&mut self, time_ns: u64) -> bool {
        let model = &self.config.sensors.imu;
        let delay_s = model.delay_s + model.undeclared_delay_s;
        let plate = self.platform.coordinates(time_ns as f64 - 1e9 * delay_s).plate_state();
        let (accel, gyro) = self.mechanics.imu(&plate);
        let (accel, gyro) = self.imu.read(time_ns as f64 * 1e-9, accel, gyro);
        self.imu_device.sample(time_ns, accel, gyro, 25.0)
    }

    /// Returns the position of the second link's joint at a time of the clock; `None` without one.
    fn second_joint(&self, time_s: f64) -> Option<JointState> {
        let link = self.config.second.as_ref()?;
        if !link.with_program {
            return Some(link.swing.at(time_s));
        }
        Some(link.swing.eased(self.platform.elapsed_s(time_s * 1e9), self.platform.duration_s()))
    }

    fn sample_second_imu(&mut self, time_ns: u64) -> bool {
        let model = &self.config.sensors.imu;
        let delay_s = model.delay_s + model.undeclared_delay_s;
        let plate = self.platform.coordinates(time_ns as f64 - 1e9 * delay_s).plate_state();
        let joint = self.second_joint(time_ns as f64 * 1e-9 - delay_s);
        let Some((accel, gyro)) = joint.and_then(|joint| self.mechanics.second_imu(&plate, &joint)) else {
            return false;
        };
        let (accel, gyro) = self.second_imu.read(time_ns as f64 * 1e-9, accel, gyro);
        self.second_device.sample(time_ns, accel, gyro, 25.0)
    }

    /// Makes one SPI transaction, chip select low to high, full duplex in place.
    pub fn transfer(&mut self, device: Device, bytes: &mut [u8]) {
        self.select(device);
        for byte in bytes {
            *byte = self.exchange(device, *byte);
        }
        self.deselect(device);
    }

    /// Lowers chip select of a device: a transaction begins, byte by byte.
    pub fn select(&mut self, device: Device) {
        match self.present(device) {
            Some(Device::LoadCell) => self.adc.select(),
            Some(Device::Imu) => self.imu_device.select(),
            Some(Device::SecondImu) => self.second_device.select(),
            None => {}
        }
    }

    /// Exchanges a byte with a device that is selected.
    pub fn exchange(&mut self, device: Device, byte: u8) -> u8 {
        match self.present(device) {
            Some(Device::LoadCell) => self.adc.exchange(byte),
            Some(Device::Imu) => self.imu_device.exchange(byte),
            Some(Device::SecondImu) => self.second_device.exchange(byte),
            // Nobody drives the line: it stays low.
            None => 0,
        }
    }

    /// Raises chip select of a device.
    pub fn deselect(&mut self, device: Device) {
        match self.present(device) {
            Some(Device::LoadCell) => self.adc.deselect(),
            Some(Device::Imu) => self.imu_device.deselect(),
            Some(Device::SecondImu) => self.second_device.deselect(),
            None => {}
        }
    }

    /// Returns the device whose transactions these are, by the wiring.
    fn present(&self, device: Device) -> Option<Device> {
        self.wiring
            .selected(device)
            .filter(|device| *device != Device::SecondImu || self.config.second.is_some())
    }

    /// Returns the load cell's converter, to do something to.
    pub fn load_cell_converter_mut(&mut self) -> &mut Ads131m08 {
        &mut self.adc
    }

    /// Returns the IMU, to do something to.
    pub fn imu_device_mut(&mut self) -> &mut Icm42688 {
        &mut self.imu_device
    }

    /// Returns what is really the case now.
    pub fn truth(&self) -> Truth {
        let plate = self.platform.coordinates(self.now_ns as f64).plate_state();
        Truth::new(&self.mechanics, &self.experiment, self.mechanics.sensor_motion(&plate))
    }
}

#[cfg(test)]
#[path = "rig/rig_tests.rs"]
mod tests;
