//! The application: its states, its commands, its telemetry. No I/O and no clock of its own.
//!
//! ```text
//!          Configure            Start             Hold, HostQuiet, StopRule
//!   Idle ────────────▶ Configured ────▶ Running ────────────▶ Holding
//!    ▲                     ▲               ▲                    │ │
//!    │ Reset (any state)   └── Configure ──┼────────────────────┘ │
//!    │                                     └──────── Start ───────┘
//!   Fault ◀── a sensor that does not answer as it should (any state but Idle)
//! ```

use heapless::Vec;
use rigident_shared::alignment::ImuReading;
use rigident_shared::calibration::Reading;
use rigident_shared::estimator::Outcome;
use rigident_shared::screening::Rejection;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};
use rigident_shared::wire::{
    Command, CounterReport, DecodeError, Decoder, ErrorCode, EstimateReport, Identity, InjectBatch, Kind,
    PROTOCOL_VERSION, ReadingMessage, Reason, Reply, SCHEMA_HASH, STREAM_BATCH, SensorFault, SettingName,
    Settings, Source, StateName, Telemetry,
};

use crate::answer::{FactorSnapshot, Solved, solve};
use crate::link::Link;
use crate::sample_path::{SamplePath, Words, sample_path};
use crate::settings::{Configuration, setting_of};

/// Announced this often until the host says hello, ns.
const ANNOUNCE_EVERY_NS: u64 = 500_000_000;
/// Sent this often while nothing else is, ns.
const HEARTBEAT_EVERY_NS: u64 = 1_000_000_000;
/// So many damaged frames of a sensor in a row are a fault.
const BAD_FRAMES_TO_FAULT: u16 = 10;

/// Version of the firmware.
const VERSION: [u8; 3] = [
    decimal(env!("CARGO_PKG_VERSION_MAJOR")),
    decimal(env!("CARGO_PKG_VERSION_MINOR")),
    decimal(env!("CARGO_PKG_VERSION_PATCH")),
];

/// CRC-32 of the sources of `firmware` and `shared`.
pub const FIRMWARE_HASH: u32 = match u32::from_str_radix(env!("RIGIDENT_FIRMWARE_HASH"), 16) {
    Ok(hash) => hash,
    Err(_) => 0,
};

const fn decimal(text: &str) -> u8 {
    match u8::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => 0,
    }
}

/// Rates at which the sensors are to be brought up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorRates {
    /// Of the load cell's converter, 1/s.
    pub load_cell_hz: f32,
    /// Of the IMU, 1/s.
    pub imu_hz: f32,
}

/// Why sensors did not come up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BringUpError {
    /// The rate asked for is not one the sensor has.
    Setting(SettingName),
    /// The sensor is broken.
    Fault(Reason),
}

/// Which sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    /// The load cell's converter.
    LoadCell,
    /// The IMU.
    Imu,
}

/// A command waiting for the sensors to come up.
struct PendingConfigure {
    sequence: u16,
    settings: Settings,
    command_payload: Vec<u8, 1024>,
}

/// The application.
pub struct App {
    board: [u8; 16],
    state: StateName,
    reason: Reason,
    settings: Option<Settings>,
    path: Option<SamplePath>,
    link: Link,
    decoder: Decoder,
    pending: Option<PendingConfigure>,
    greeted: bool,
    state_unsent: bool,
    now_ns: u64,
    last_heard_ns: u64,
    last_announced_ns: Option<u64>,
    last_heartbeat_ns: u64,
    batch: Vec<ReadingMessage, STREAM_BATCH>,
    batch_first: u32,
    injected_next: u32,
    last_reading: ReadingMessage,
    blocks_since_estimate: u16,
    estimate_due: bool,
    snapshot: Option<FactorSnapshot>,
    load_cell_crc_errors: u32,
    imu_errors: u32,
    bad_in_a_row: [u16; 2],
    bad_frames: u32,
}

impl App {
    /// An idle application on the named board (ASCII, at most sixteen bytes).
    #[must_use]
    pub fn new(board: &str) -> Self {
        let mut name = [0; 16];
        for (slot, byte) in name.iter_mut().zip(board.bytes()) {
            *slot = byte;
        }
        Self {
            board: name,
            state: StateName::Idle,
            reason: Reason::Boot,
            settings: None,
            path: None,
            link: Link::new(),
            decoder: Decoder::new(),
            pending: None,
            greeted: false,
            state_unsent: false,
            now_ns: 0,
            last_heard_ns: 0,
            last_announced_ns: None,
            last_heartbeat_ns: 0,
            batch: Vec::new(),
            batch_first: 0,
            injected_next: 0,
            last_reading: ReadingMessage::default(),
            blocks_since_estimate: 0,
            estimate_due: false,
            snapshot: None,
            load_cell_crc_errors: 0,
            imu_errors: 0,
            bad_in_a_row: [0; 2],
            bad_frames: 0,
        }
    }

    /// The state, and why it is that.
    pub fn state(&self) -> (StateName, Reason) {
        (self.state, self.reason)
    }

    /// Takes a byte from the host. If it completes a `Configure` for real sensors, the rates to bring them
    /// up with; [`App::sensors_up`] must follow before the next byte.
    pub fn on_byte(&mut self, byte: u8, now_ns: u64) -> Option<SensorRates> {
        self.advance(now_ns);
        self.last_heard_ns = self.now_ns;
        // The frame borrows the decoder, the application is needed to obey: take it out for the while.
        let mut decoder = core::mem::take(&mut self.decoder);
        let rates = match decoder.push(byte) {
            None => None,
            Some(Ok(frame)) if frame.kind == Kind::Command => {
                self.on_command(frame.sequence, frame.payload, frame.message())
            }
            Some(Ok(_)) => None,
            Some(Err(DecodeError::Version(want))) => {
                let error = ErrorCode::WrongProtocol { have: PROTOCOL_VERSION, want };
                self.link.answer(0, &[], &Err(error));
                None
            }
            Some(Err(_)) => {
                self.bad_frames = self.bad_frames.saturating_add(1);
                None
            }
        };
        self.decoder = decoder;
        rates
    }

    fn on_command(
        &mut self,
        sequence: u16,
        payload: &[u8],
        command: Result<Command, DecodeError>,
    ) -> Option<SensorRates> {
        if matches!(command, Ok(Command::Hello)) {
            self.link.forget();
        } else if self.link.answer_again(sequence, payload) {
            return None;
        }
        let answer = match command {
            Err(_) => Err(ErrorCode::UnknownCommand),
            Ok(Command::Configure(settings)) => match self.configure(&settings) {
                Ok(()) if settings.source == Source::Sensors => {
                    let rates = SensorRates { load_cell_hz: settings.rate_hz, imu_hz: settings.imu.rate_hz };
                    let command_payload = Vec::from_slice(payload).unwrap_or_default();
                    self.pending = Some(PendingConfigure { sequence, settings, command_payload });
                    return Some(rates);
                }
                Ok(()) => self.configured(settings),
                Err(error) => Err(error),
            },
            Ok(command) => self.obey(&command),
        };
        self.link.answer(sequence, payload, &answer);
        None
    }

    /// Whether the settings are possible and the state allows them.
    fn configure(&self, settings: &Settings) -> Result<(), ErrorCode> {
        if !matches!(self.state, StateName::Idle | StateName::Configured | StateName::Holding) {
            return Err(ErrorCode::WrongState(self.state));
        }
        let configuration = Configuration::new(settings).map_err(ErrorCode::BadSetting)?;
        SamplePath::new(&configuration).map(drop).map_err(|e| ErrorCode::BadSetting(setting_of(e)))
    }

    fn configured(&mut self, settings: Settings) -> Result<Reply, ErrorCode> {
        let configuration = Configuration::new(&settings).map_err(ErrorCode::BadSetting)?;
        let path = SamplePath::new(&configuration).map_err(|e| ErrorCode::BadSetting(setting_of(e)))?;
        self.path = Some(path);
        self.settings = Some(settings);
        self.forget_run();
        self.load_cell_crc_errors = 0;
        self.imu_errors = 0;
        self.enter(StateName::Configured, Reason::Command);
        Ok(Reply::Done)
    }

    /// Tells how the bring-up went that [`App::on_byte`] asked for, and answers the command.
    pub fn sensors_up(&mut self, result: Result<(), BringUpError>) {
        let Some(pending) = self.pending.take() else { return };
        let answer = match result {
            Ok(()) => self.configured(pending.settings),
            Err(BringUpError::Setting(name)) => Err(ErrorCode::BadSetting(name)),
            Err(BringUpError::Fault(reason)) => {
                self.enter(StateName::Fault, reason);
                Err(ErrorCode::Sensors)
            }
        };
        self.link.answer(pending.sequence, &pending.command_payload, &answer);
    }

    fn obey(&mut self, command: &Command) -> Result<Reply, ErrorCode> {
        let wrong_state = Err(ErrorCode::WrongState(self.state));
        match command {
            Command::Hello => {
                self.greeted = true;
                Ok(Reply::Hello(self.identity()))
            }
            // Taken care of before.
            Command::Configure(_) => wrong_state,
            Command::Start => match self.state {
                StateName::Configured => {
                    self.flush_readings();
                    if let Some(path) = &mut self.path {
                        path.restart();
                    }
                    self.forget_run();
                    self.absorb(true);
                    self.enter(StateName::Running, Reason::Command);
                    Ok(Reply::Done)
                }
                StateName::Holding => {
                    self.absorb(true);
                    self.enter(StateName::Running, Reason::Command);
                    Ok(Reply::Done)
                }
                StateName::Running => Ok(Reply::Done),
                StateName::Idle | StateName::Fault => wrong_state,
            },
            Command::Hold => match self.state {
                StateName::Running => {
                    self.hold(Reason::Command);
                    Ok(Reply::Done)
                }
                StateName::Holding => Ok(Reply::Done),
                _ => wrong_state,
            },
            Command::Reset => {
                self.path = None;
                self.settings = None;
                self.forget_run();
                self.enter(StateName::Idle, Reason::Command);
                Ok(Reply::Done)
            }
            Command::Inject(batch) => self.inject(batch),
            Command::ReadSettings => self.settings.clone().map(Reply::Settings).map_or(wrong_state, Ok),
            Command::ReadCounters => Ok(Reply::Counters(self.counters())),
            Command::ReadEstimate => {
                let path = self.path.as_ref().ok_or(ErrorCode::NoEstimate)?;
                if path.counters().blocks == 0 {
                    return Err(ErrorCode::NoEstimate);
                }
                let solved = solve(&path.factor());
                self.report(&solved).map(Reply::Estimate).ok_or(ErrorCode::NoEstimate)
            }
            Command::ReadFactor { offset } => {
                if *offset == 0 {
                    self.snapshot = self.path.as_ref().map(|path| FactorSnapshot::new(&path.factor()));
                }
                let snapshot = self.snapshot.as_ref().ok_or(ErrorCode::NoEstimate)?;
                snapshot
                    .chunk(*offset)
                    .map(Reply::Factor)
                    .ok_or(ErrorCode::BadOffset { total: snapshot.total() })
            }
            Command::Heartbeat => Ok(Reply::Done),
        }
    }

    fn inject(&mut self, batch: &InjectBatch) -> Result<Reply, ErrorCode> {
        let injecting = self.settings.as_ref().is_some_and(|s| s.source == Source::Injected);
        if self.state != StateName::Running || !injecting {
            return Err(ErrorCode::WrongState(self.state));
        }
        if batch.first_index != self.injected_next {
            return Err(ErrorCode::OutOfOrder { expected: self.injected_next });
        }
        for message in &batch.readings {
            self.injected_next = self.injected_next.wrapping_add(1);
            self.take(&Words::Aligned(reading_of(message)));
            // The stop rule must see every estimate, whatever the size of the batches.
            self.work();
        }
        Ok(Reply::Injected { next_index: self.injected_next })
    }

    /// Takes gauge voltages with their capture time.
    pub fn on_gauges(&mut self, time_ns: u64, volts: [f32; 6]) {
        self.bad_in_a_row[0] = 0;
        self.advance(time_ns);
        self.take(&Words::Gauges { time_ns, volts });
    }

    /// Takes an IMU sample: specific force (m/s²) and angular rate (rad/s) in the IMU's axes.
    pub fn on_imu(&mut self, time_ns: u64, specific_force: [f32; 3], angular_rate: [f32; 3]) {
        self.bad_in_a_row[1] = 0;
        self.advance(time_ns);
        self.take(&Words::Imu(ImuReading {
            time_ns,
            specific_force: SpecificForce::from_array(specific_force),
            angular_rate: AngularRate::from_array(angular_rate),
        }));
    }

    /// Notes a sample that could not be had. Ten in a row, or a fault that does not pass, end in `Fault`.
    pub fn on_sensor_error(&mut self, sensor: Sensor, fault: SensorFault) {
        let (count, in_a_row, reason) = match (sensor, &mut self.bad_in_a_row) {
            (Sensor::LoadCell, [n, _]) => (&mut self.load_cell_crc_errors, n, Reason::LoadCell(fault)),
            (Sensor::Imu, [_, n]) => (&mut self.imu_errors, n, Reason::Imu(fault)),
        };
        *count = count.saturating_add(1);
        *in_a_row = in_a_row.saturating_add(1);
        let lasting = fault == SensorFault::Restarted || *in_a_row >= BAD_FRAMES_TO_FAULT;
        if lasting && !matches!(self.state, StateName::Idle | StateName::Fault) {
            self.absorb(false);
            self.flush_readings();
            self.enter(StateName::Fault, reason);
        }
    }

    fn take(&mut self, words: &Words) {
        let Some(path) = &mut self.path else { return };
        let Some(settings) = &self.settings else { return };
        let from_sensors = !matches!(words, Words::Aligned(_));
        if from_sensors != (settings.source == Source::Sensors) || self.state == StateName::Fault {
            return;
        }
        let (stream, every) = (settings.telemetry.stream_readings, settings.telemetry.estimate_every_blocks);
        let mut next = sample_path(path, Some(words));
        while let Some((reading, outcome)) = next {
            self.last_reading = message_of(&reading);
            if outcome == Outcome::Absorbed {
                self.blocks_since_estimate = self.blocks_since_estimate.saturating_add(1);
                if every > 0 && self.blocks_since_estimate >= every {
                    self.blocks_since_estimate = 0;
                    self.estimate_due = true;
                }
            }
            if stream && self.state != StateName::Holding {
                let _ = self.batch.push(self.last_reading);
                if self.batch.is_full() {
                    let batch = core::mem::take(&mut self.batch);
                    let first = self.batch_first;
                    self.batch_first = first.wrapping_add(batch.len() as u32);
                    self.link.telemetry(&Telemetry::Readings { first, readings: batch });
                }
            }
            next = sample_path(path, None);
        }
    }

    /// What need not be done within a sample: solving, the stop rule, telemetry. Call it after every event.
    pub fn work(&mut self) {
        if core::mem::take(&mut self.estimate_due)
            && let Some(path) = &mut self.path
        {
            let solved = solve(&path.factor());
            if solved.determined.iter().all(|d| *d) {
                path.set_reference(&solved.estimate);
            }
            if let Some(report) = self.report(&solved) {
                self.link.telemetry(&Telemetry::Estimate(report));
            }
            if self.state == StateName::Running && self.stop_rule_met(&solved) {
                self.hold(Reason::StopRule);
            }
        }
        if self.state_unsent {
            let (state, reason) = self.state();
            self.state_unsent = !self.link.telemetry(&Telemetry::State { state, reason });
        }
    }

    fn stop_rule_met(&self, solved: &Solved) -> bool {
        let Some(stop) = self.settings.as_ref().and_then(|s| s.stop.as_ref()) else { return false };
        let blocks = self.path.as_ref().map_or(0, |p| p.counters().blocks);
        blocks >= stop.minimum_blocks
            && solved.standard_deviation.iter().zip(&solved.determined).zip(stop.u95).enumerate().all(
                |(j, ((sd, determined), u95))| stop.asked >> j & 1 == 0 || (*determined && 1.96 * *sd <= u95),
            )
    }

    /// Moves the clock and does what time alone asks for. Time never runs backwards.
    pub fn tick(&mut self, now_ns: u64) {
        self.advance(now_ns);
        if !self.greeted {
            let due = self
                .last_announced_ns
                .is_none_or(|last| self.now_ns.saturating_sub(last) >= ANNOUNCE_EVERY_NS);
            if due {
                self.last_announced_ns = Some(self.now_ns);
                let identity = self.identity();
                self.link.telemetry(&Telemetry::Announce(identity));
            }
        } else if self.now_ns.saturating_sub(self.last_heartbeat_ns) >= HEARTBEAT_EVERY_NS {
            self.last_heartbeat_ns = self.now_ns;
            self.link.telemetry(&Telemetry::Heartbeat { time_ns: self.now_ns });
        }
        self.work();
    }

    fn advance(&mut self, now_ns: u64) {
        self.now_ns = self.now_ns.max(now_ns);
        let timeout_ms = self.settings.as_ref().map_or(0, |s| s.host_timeout_ms);
        let quiet_ns = self.now_ns.saturating_sub(self.last_heard_ns);
        if self.state == StateName::Running && timeout_ms > 0 && quiet_ns > u64::from(timeout_ms) * 1_000_000
        {
            self.hold(Reason::HostQuiet);
        }
    }

    fn hold(&mut self, reason: Reason) {
        self.absorb(false);
        self.flush_readings();
        self.enter(StateName::Holding, reason);
    }

    fn absorb(&mut self, absorbing: bool) {
        if let Some(path) = &mut self.path {
            path.absorb_from_now_on(absorbing);
        }
    }

    fn enter(&mut self, state: StateName, reason: Reason) {
        (self.state, self.reason) = (state, reason);
        self.state_unsent = !self.link.telemetry(&Telemetry::State { state, reason });
    }

    fn forget_run(&mut self) {
        self.batch.clear();
        self.batch_first = 0;
        self.injected_next = 0;
        self.blocks_since_estimate = 0;
        self.estimate_due = false;
        self.snapshot = None;
    }

    fn flush_readings(&mut self) {
        let batch = core::mem::take(&mut self.batch);
        if !batch.is_empty() {
            let first = self.batch_first;
            self.batch_first = first.wrapping_add(batch.len() as u32);
            self.link.telemetry(&Telemetry::Readings { first, readings: batch });
        }
    }

    fn identity(&self) -> Identity {
        Identity {
            protocol_version: PROTOCOL_VERSION,
            schema_hash: SCHEMA_HASH,
            firmware_version: VERSION,
            firmware_hash: FIRMWARE_HASH,
            board: self.board,
            state: self.state,
            reason: self.reason,
        }
    }

    fn counters(&self) -> CounterReport {
        let mut report = CounterReport {
            load_cell_crc_errors: self.load_cell_crc_errors,
            imu_errors: self.imu_errors,
            bad_frames: self.bad_frames,
            telemetry_dropped: self.link.telemetry_dropped(),
            ..CounterReport::default()
        };
        if let Some(path) = &self.path {
            let counters = path.counters();
            report.readings = counters.readings;
            report.rejected = counters.rejected;
            report.rejected_by_channel = counters.rejected_by_channel;
            (report.last_rejection, report.last_rejected_channel) = match counters.last_rejection {
                None => (0, 0),
                Some(Rejection::NotFinite(channel)) => (1, channel),
                Some(Rejection::Saturated(channel)) => (2, channel),
                Some(Rejection::Frozen(channel)) => (3, channel),
            };
            report.gaps = counters.gaps;
            report.blocks = counters.blocks;
            report.unaligned = path.unaligned();
        }
        report
    }

    fn report(&self, solved: &Solved) -> Option<EstimateReport> {
        let path = self.path.as_ref()?;
        Some(EstimateReport {
            readings: path.counters().readings,
            time_ns: self.last_reading.time_ns,
            blocks: path.counters().blocks,
            estimate: solved.estimate.clone(),
            standard_deviation: solved.standard_deviation.clone(),
            determined: solved
                .determined
                .iter()
                .enumerate()
                .fold(0, |bits, (j, d)| bits | u16::from(*d) << j),
            condition_number: solved.condition_number,
            innovation_rms: path.statistics().rms().unwrap_or_default(),
            last: self.last_reading,
        })
    }

    /// Bytes waiting to be sent.
    pub fn tx_pending(&self) -> usize {
        self.link.pending()
    }

    /// Takes bytes to send; how many. Answers come before telemetry.
    pub fn poll_tx(&mut self, out: &mut [u8]) -> usize {
        self.link.take(out)
    }
}

fn message_of(reading: &Reading<f32>) -> ReadingMessage {
    ReadingMessage {
        time_ns: reading.time_ns,
        wrench: reading.wrench.array(),
        specific_force: reading.specific_force.array(),
        angular_rate: reading.angular_rate.array(),
    }
}

fn reading_of(message: &ReadingMessage) -> Reading<f32> {
    Reading {
        time_ns: message.time_ns,
        wrench: Wrench::from_array(message.wrench),
        specific_force: SpecificForce::from_array(message.specific_force),
        angular_rate: AngularRate::from_array(message.angular_rate),
    }
}
