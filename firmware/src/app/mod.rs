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
//!
//! Lives here: the object itself, its clock and its states. Next: what it does on commands (`commands`), with
//! samples (`samples`), and what it tells of itself (`reports`).

mod commands;
#[cfg(feature = "storage")]
mod kept;
mod line;
mod reports;
mod samples;
mod stream;

use core::ops::DerefMut;

use heapless::Vec;
use rigident_shared::wire::{
    BadEnd, ClockSource, Decoder, EventCode, LINK_BATCH, LinkReadingMessage, ModelSettings, ReadingMessage,
    Reason, ResetReason, STREAM_BATCH, SensorFault, SettingName, Settings, Source, StateName, StreamReport,
    Telemetry, number_of_reason, number_of_reset,
};

use crate::Path;
use crate::estimate::Estimation;
use crate::events::{EventRoom, Events};
use crate::link::Link;
use crate::log;
use crate::rates::RateMeter;
use crate::storage::Keeping;

/// Announced this often until the host says hello, ns.
const ANNOUNCE_EVERY_NS: u64 = 500_000_000;
/// Sent this often after that, ns.
const HEARTBEAT_EVERY_NS: u64 = 1_000_000_000;
/// A sensor that gives no sample for this long while readings are absorbed is broken, ns: six samples at the
/// slowest rate there is.
const SILENT_NS: u64 = 250_000_000;
/// A run whose host sends no frame of a robot that is watched for this long is broken, ns: the host has other
/// things to do, too.
const NO_FRAMES_NS: u64 = 1_000_000_000;
/// Silence, of sensors or of the host, is checked for this often, ns.
const LOOK_EVERY_NS: u64 = 5_000_000;

/// Rates at which the sensors are to be brought up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorRates {
    /// Rate of the load cell's converter, 1/s.
    pub load_cell_hz: f32,
    /// Rate of the IMU, 1/s.
    pub imu_hz: f32,
    /// Rate of the second link's IMU, 1/s, if it is wanted.
    pub second_imu_hz: Option<f32>,
}

/// Tells why sensors did not come up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BringUpError {
    /// The rate asked for is not one the sensor has; nothing was changed.
    Setting(SettingName),
    /// The sensor is broken.
    Fault(Reason),
}

/// Tells which sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    /// The load cell's converter.
    LoadCell,
    /// The IMU.
    Imu,
    /// The second link's IMU.
    SecondImu,
    /// The source of frames.
    Frames,
}

/// Tells how many there are.
const SENSORS: usize = 4;

impl Sensor {
    const ALL: [Self; SENSORS] = [Self::LoadCell, Self::Imu, Self::SecondImu, Self::Frames];

    fn reason(self, fault: SensorFault) -> Reason {
        match self {
            Self::LoadCell => Reason::LoadCell(fault),
            Self::Imu => Reason::Imu(fault),
            Self::SecondImu => Reason::SecondImu(fault),
            Self::Frames => Reason::Frames(fault),
        }
    }
}

/// A command waiting for the sensors to come up.
struct PendingConfigure {
    sequence: u16,
    /// Check sum of the command's payload.
    check: u32,
    settings: Settings,
}

/// Holds what the settings say of every sample.
#[derive(Clone, Copy, Default)]
struct Duty {
    from_sensors: bool,
    /// Tells which sensors are listened to, in the order of [`Sensor::ALL`].
    sensors: [bool; SENSORS],
    stream: bool,
    estimate_every_blocks: u16,
    /// Every reading is a row block.
    every_reading: bool,
    /// The part that the converter sees of the excitation as it was when the load cell was calibrated, V;
    /// zero: it is not examined.
    excitation_v: f32,
}

impl Duty {
    fn of(settings: &Settings) -> Self {
        let from_sensors = settings.source == Source::Sensors;
        let sensors = match settings.model {
            ModelSettings::Body => [true, true, false, false],
            ModelSettings::TwoLinks(_) => [true, true, true, false],
            ModelSettings::Tree(_) | ModelSettings::Suspended(..) | ModelSettings::Watch(_) => {
                [false, false, false, true]
            }
        };
        Self {
            from_sensors,
            sensors: sensors.map(|used| used && from_sensors),
            stream: settings.telemetry.stream_readings,
            estimate_every_blocks: settings.telemetry.estimate_every_blocks,
            every_reading: settings.row_every <= 1,
            excitation_v: settings.load_cell.excitation_v.unwrap_or(0.0),
        }
    }
}

/// Holds what is known of a sensor's well-being.
#[derive(Clone, Copy, Default)]
struct Pulse {
    /// Samples in a row that could not be had.
    bad_in_a_row: u16,
    /// Time of the last one that could, ns.
    last_ns: u64,
}

/// Numbers that are counted here; the rest of the counters is the sample path's.
#[derive(Clone, Copy, Default)]
struct SensorErrors {
    load_cell_crc: u32,
    load_cell_other: u32,
    load_cell_clipped: u32,
    clipped_gauges: u8,
    load_cell_stale: u32,
    load_cell_resyncs: u32,
    without_excitation: u32,
    overdue_transfers: u32,
    failed_transfers: u32,
    imu: u32,
    second_imu: u32,
    /// Lost samples of load cell, IMU and second IMU.
    lost: [u32; 3],
    frames_damaged: u32,
    frames_missing: u32,
    /// Number of the frame expected next.
    next_frame: Option<u32>,
    /// The sequence number of frames on the link that is expected next, and the frames' counts.
    next_streamed: Option<u16>,
    stream: StreamReport,
    /// Links of the last one of another robot.
    other_links: u8,
    /// Times that the board had no room for bytes from the host.
    overruns: u32,
    /// Unaligned samples before the run.
    unaligned_before: u32,
}

/// Holds what belongs to one run and is forgotten with it.
#[derive(Default)]
struct Run {
    batch: Vec<ReadingMessage, STREAM_BATCH>,
    batch_first: u32,
    link_batch: Vec<LinkReadingMessage, LINK_BATCH>,
    injected_next: u32,
    blocks_since_estimate: u16,
    estimate_due: bool,
    /// The sample path has left something to be done outside of it.
    path_behind: bool,
    /// The host has gone on after the stop rule: it ends this run no more.
    stop_overridden: bool,
    /// Rows of the factor are being handed over.
    hand_over: HandOver,
    /// The last reading was absorbed in no time to speak of: a slice of an estimate has room before the next.
    slice_fits: bool,
    /// Ticks since the last sample.
    idle_ticks: u8,
}

/// Holds what a board tells of itself when it starts, and what it can do.
#[derive(Clone, Copy, Default)]
struct BoardFacts {
    unique_id: [u8; 12],
    reset: ResetReason,
    ended: Option<BadEnd>,
    clock: ClockSource,
    restarts: bool,
    /// The depth of the stack so far, and its size, bytes.
    stack_bytes: [u32; 2],
}

/// Tells how far the factor is handed over to the host.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum HandOver {
    /// Nothing is asked for.
    #[default]
    None,
    /// The command for row 0, with this sequence number and check, waits for the factor.
    Folding(u16, u32),
    /// A row was handed over at this time, ns.
    Rows(u64),
}

/// The application. `P` says where its estimator is: a `&'static mut Path`, say, or a `Box<Path>`.
pub struct App<P> {
    board: [u8; 16],
    facts: BoardFacts,
    /// The host has asked for a restart, and has its answer on the way.
    restart_asked: bool,
    state: StateName,
    reason: Reason,
    settings: Option<Settings>,
    path: P,
    duty: Duty,
    link: Link,
    line: line::Line,
    decoder: Decoder,
    pending: Option<PendingConfigure>,
    greeted: bool,
    state_unsent: bool,
    now_ns: u64,
    next_look_ns: u64,
    last_heard_ns: u64,
    last_announced_ns: Option<u64>,
    last_heartbeat_ns: u64,
    run: Run,
    estimation: Estimation,
    last_reading: ReadingMessage,
    pulses: [Pulse; SENSORS],
    /// Samples of gauges in a row whose excitation was missing.
    starved: u16,
    /// The noise of the bus, by the check sums of the load cell's frames.
    noise: u16,
    /// The meters of load cell, IMU and second IMU.
    meters: [RateMeter; 3],
    errors: SensorErrors,
    bad_frames: u32,
    keeping: Keeping,
    events: Events,
}

impl<P: DerefMut<Target = Path>> App<P> {
    /// Returns an idle application on the named board (ASCII, at most sixteen bytes), with room for its
    /// estimator.
    #[must_use]
    pub fn new(board: &str, path: P) -> Self {
        let mut name = [0; 16];
        for (slot, byte) in name.iter_mut().zip(board.bytes()) {
            *slot = byte;
        }
        Self {
            board: name,
            facts: BoardFacts::default(),
            restart_asked: false,
            state: StateName::Idle,
            reason: Reason::Boot,
            settings: None,
            path,
            duty: Duty::default(),
            link: Link::new(),
            line: line::Line::default(),
            decoder: Decoder::new(),
            pending: None,
            greeted: false,
            state_unsent: false,
            now_ns: 0,
            next_look_ns: 0,
            last_heard_ns: 0,
            last_announced_ns: None,
            last_heartbeat_ns: 0,
            run: Run::default(),
            estimation: Estimation::IDLE,
            last_reading: ReadingMessage::default(),
            pulses: [Pulse::default(); SENSORS],
            starved: 0,
            noise: 0,
            meters: [RateMeter::default(); 3],
            errors: SensorErrors::default(),
            bad_frames: 0,
            keeping: Keeping::new(),
            events: Events::default(),
        }
    }

    /// Receives the room for events, whose memory a reset has left alone. [`Self::booted`] comes after it.
    pub fn keeps_events(&mut self, room: &'static EventRoom) {
        self.events = Events::go_on(room);
    }

    /// Notes why the board started, and what its time comes from, for the report to the host.
    pub fn booted(&mut self, reset: ResetReason, clock: ClockSource) {
        (self.facts.reset, self.facts.clock) = (reset, clock);
        self.events.note(self.now_ns, EventCode::Started, number_of_reset(reset));
    }

    /// Notes the chip's own number, and where the last program ended if it ended badly, for the report to the
    /// host.
    pub fn is_chip(&mut self, unique_id: [u8; 12], ended: Option<BadEnd>) {
        (self.facts.unique_id, self.facts.ended) = (unique_id, ended);
    }

    /// Notes that the board starts anew when [`Self::restart_is_due`].
    pub fn can_restart(&mut self) {
        self.facts.restarts = true;
    }

    /// Notes how deep the stack has been, and how large it is, bytes.
    pub fn stack_was(&mut self, deepest: u32, size: u32) {
        self.facts.stack_bytes = [deepest, size];
    }

    /// Returns whether the host has asked for a restart and has been given its answer.
    pub fn restart_is_due(&self) -> bool {
        self.restart_asked && self.link.pending() == 0
    }

    /// Returns the state, and why it is that.
    pub fn state(&self) -> (StateName, Reason) {
        (self.state, self.reason)
    }

    /// Returns whether samples of the device's sensors are wanted. While they are not, the sensors may not
    /// even have been set up.
    pub fn listens(&self) -> bool {
        !matches!(self.state, StateName::Idle | StateName::Fault)
            && self.settings.as_ref().is_some_and(|settings| settings.source == Source::Sensors)
    }

    /// Tells whose samples are wanted: of load cell, IMU and second IMU.
    pub fn wanted(&self) -> [bool; 3] {
        [Sensor::LoadCell, Sensor::Imu, Sensor::SecondImu].map(|sensor| self.wants(sensor))
    }

    /// Returns whether samples of this sensor are wanted. Another one may not even have been set up.
    pub fn wants(&self, sensor: Sensor) -> bool {
        self.listens() && self.duty.sensors.get(sensor as usize).is_some_and(|used| *used)
    }

    /// Moves the clock and does what time alone asks for. Time never runs backwards.
    #[inline(never)]
    pub fn tick(&mut self, now_ns: u64) {
        self.advance(now_ns);
        self.run.idle_ticks = self.run.idle_ticks.saturating_add(1);
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

    #[inline(always)]
    fn advance(&mut self, now_ns: u64) {
        self.now_ns = self.now_ns.max(now_ns);
        if self.now_ns >= self.next_look_ns {
            self.look_around();
        }
    }

    #[inline(never)]
    fn look_around(&mut self) {
        self.next_look_ns = self.now_ns.saturating_add(LOOK_EVERY_NS);
        self.look_at_line();
        self.look_for_silence();
    }

    #[inline(never)]
    fn look_for_silence(&mut self) {
        if self.state != StateName::Running {
            return;
        }
        if self.listens() {
            let most_ns = if self.path.watch().is_some() { NO_FRAMES_NS } else { SILENT_NS };
            for ((sensor, pulse), used) in Sensor::ALL.iter().zip(&self.pulses).zip(&self.duty.sensors) {
                if *used && self.now_ns.saturating_sub(pulse.last_ns) > most_ns {
                    return self.fail(sensor.reason(SensorFault::Silent));
                }
            }
        }
        let timeout_ms = self.settings.as_ref().map_or(0, |s| s.host_timeout_ms);
        let quiet_ns = self.now_ns.saturating_sub(self.last_heard_ns);
        if timeout_ms > 0 && quiet_ns > u64::from(timeout_ms) * 1_000_000 {
            self.hold(Reason::HostQuiet);
        }
    }

    fn hold(&mut self, reason: Reason) {
        self.absorb(false);
        self.keep_all();
        self.flush_readings();
        self.enter(StateName::Holding, reason);
    }

    fn fail(&mut self, reason: Reason) {
        self.absorb(false);
        self.keep_all();
        self.flush_readings();
        self.enter(StateName::Fault, reason);
    }

    /// Stores everything, since a run pauses or ends: nothing of it is to be lost.
    fn keep_all(&mut self) {
        if let Some(path) = self.path.samples() {
            self.keeping.hurry(path.counters().readings);
        }
    }

    fn enter(&mut self, state: StateName, reason: Reason) {
        (self.state, self.reason) = (state, reason);
        log::state(state, reason);
        self.events.note(self.now_ns, EventCode::of_state(state), number_of_reason(reason));
        self.state_unsent = !self.link.telemetry(&Telemetry::State { state, reason });
    }

    fn absorb(&mut self, absorbing: bool) {
        match &mut *self.path {
            Path::Samples(path) => path.absorb_from_now_on(absorbing),
            Path::Frames(path) if cfg!(feature = "frames") => path.absorb_from_now_on(absorbing),
            Path::Watch(path) if cfg!(feature = "watch") => path.absorb_from_now_on(absorbing),
            _ => {}
        }
    }

    /// Returns the number of bytes waiting to be sent.
    pub fn tx_pending(&self) -> usize {
        self.link.pending()
    }

    /// Takes bytes to send. Returns their number. Answers come before telemetry.
    pub fn poll_tx(&mut self, out: &mut [u8]) -> usize {
        self.link.take(out)
    }
}
