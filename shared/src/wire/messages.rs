//! The messages. Both sides compile this one file; [`SCHEMA_HASH`] tells whether they compiled the same.
//!
//! SI units, the suffix says which; frames and signs as everywhere: wrench on the body in S, IMU values in
//! the IMU's axes. Numbers on the line are f32, as in the firmware.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::events::EventReport;
use super::links::{
    FactorRow, FrameReport, LINK_BATCH, LinkBatch, LinkReadingMessage, MAX_TREE_PARAMETERS, ModelSettings,
};
#[cfg(not(feature = "watch"))]
use super::watch::nothing_watched;
use super::watch::{ChangeReport, WatchLinkSettings, WatchReport};

/// Version of framing and header; another one is refused by both sides.
pub const PROTOCOL_VERSION: u8 = 8;

/// Hash of all message types: equal on both sides if they understand each other.
pub const SCHEMA_HASH: u64 =
    u64::from_le_bytes(postcard_schema::key::hash::fnv1a64::hash_ty_path::<(Command, Answer, Telemetry)>(
        "rigident",
    ));

/// Most parameters of a model that the device solves: two links' and the wrench offset.
pub const MAX_PARAMETERS: usize = 25;

/// Host to device. Every command is answered once, with its own sequence number; a repeat with the same
/// number is answered again from memory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant, reason = "no heap")]
pub enum Command {
    /// Asks who is there. Any state.
    Hello,
    /// Take these settings: Idle, Configured or Holding → Configured. Nothing changes on an error.
    Configure(Settings),
    /// Configured or Holding → Running. From Configured the estimate starts empty, from Holding it goes on;
    /// if the stop rule had ended the run, without the rule.
    Start,
    /// Running → Holding; the estimate stays.
    Hold,
    /// Any state → Idle; estimate and settings are forgotten.
    Reset,
    /// Readings of a recording, while Running with [`Source::Injected`].
    Inject(InjectBatch),
    /// Readings of two links, while Running with [`Source::Injected`].
    InjectLinks(LinkBatch),
    /// The settings in force.
    ReadSettings,
    /// Tells what happened so far.
    ReadCounters,
    /// The estimate now, while no samples of the sensors are absorbed: making it takes as long as several.
    /// Else there is
    /// [`Telemetry::Estimate`].
    ReadEstimate,
    /// Hand over a row of the factor. Row 0 begins. Of one body and of two links it is the factor of
    /// everything absorbed up to row 0, and the device keeps what it has. A tree's is taken out of the
    /// device, and a repeat of the command is answered from memory as every other; with row 0 what waits is
    /// absorbed first, and the level's frames are counted anew.
    TakeRow {
        /// The row, and so the first parameter with a coefficient in it.
        row: u8,
    },
    /// The host is there.
    Heartbeat,
    /// Go on with the run that is stored in flash ([`Kept::Run`]): Idle → Holding, with its settings and what
    /// its last checkpoint holds. `Start` then absorbs more.
    Resume {
        /// The run's number; another one is refused.
        run: u32,
        /// Number of the next reading that is streamed, if it is larger than that of the checkpoint: what the
        /// host has received since has numbers of its own.
        next_reading: u32,
    },
    /// Start anew, as after power-on: any state. The answer is sent first.
    Restart,
    /// The last events, those before a reset included. Any state.
    ReadEvents,
    /// A link of the robot that is to be watched: Configured.
    #[cfg_attr(not(feature = "watch"), serde(skip))]
    WatchLink {
        /// The link's index.
        link: u8,
        /// The knowledge of it.
        settings: WatchLinkSettings,
    },
    /// The line has another rate from now on; the answer is the last thing at the old one: Configured, of a
    /// robot that is watched. The device goes back by itself when it holds, fails, is reset, or has heard
    /// nothing whole for [`LINE_RATE_MS`].
    #[cfg_attr(not(feature = "watch"), serde(skip))]
    LineRate {
        /// The rate, baud.
        baud: u32,
    },
}

/// A device that has heard nothing whole for this long takes its line back to the rate that it started with,
/// ms.
pub const LINE_RATE_MS: u32 = 1_000;

/// Answer to a command.
pub type Answer = Result<Reply, ErrorCode>;

/// Tells what a command brings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant, reason = "no heap")]
pub enum Reply {
    /// Done.
    Done,
    /// The answer to `Hello`.
    Hello(Identity),
    /// The answer to `ReadSettings`.
    Settings(Settings),
    /// The answer to `ReadCounters`.
    Counters(CounterReport),
    /// The answer to `ReadEstimate`.
    Estimate(EstimateReport),
    /// The answer to `TakeRow`.
    Row(FactorRow),
    /// The answer to `Inject`: the index of the reading expected next.
    Injected {
        /// Index expected next.
        next_index: u32,
    },
    /// The answer to `ReadEvents`.
    Events(EventReport),
}

/// Tells why a command was not obeyed. [`ErrorCode::number`] is stable across versions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ErrorCode {
    /// 1: the payload is no command of this schema.
    UnknownCommand,
    /// 2: the device speaks another protocol version.
    WrongProtocol {
        /// The device's version.
        have: u8,
        /// The version in the frame.
        want: u8,
    },
    /// 3: not in this state.
    WrongState(StateName),
    /// 4: a setting is impossible; nothing was changed.
    BadSetting(SettingName),
    /// 5: a batch does not start where the last one ended.
    OutOfOrder {
        /// Index of the reading expected.
        expected: u32,
    },
    /// 6: nothing has been estimated yet.
    NoEstimate,
    /// 8: the sensors did not come up; see the state.
    Sensors,
    /// 9: the command is older than one that was answered: a copy that was late. It was not obeyed.
    Stale,
    /// 10: the image leaves out what is asked for; see the features of the boards.
    NotBuiltIn,
    /// 11: no run of this number is stored in flash, or it can no longer be read.
    NotKept,
}

impl ErrorCode {
    /// Returns the error's number, for people and logs.
    pub const fn number(self) -> u16 {
        match self {
            Self::UnknownCommand => 1,
            Self::WrongProtocol { .. } => 2,
            Self::WrongState(_) => 3,
            Self::BadSetting(_) => 4,
            Self::OutOfOrder { .. } => 5,
            Self::NoEstimate => 6,
            Self::Sensors => 8,
            Self::Stale => 9,
            Self::NotBuiltIn => 10,
            Self::NotKept => 11,
        }
    }
}

/// The states of the application.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum StateName {
    /// No settings.
    Idle,
    /// Settings taken, nothing absorbed.
    Configured,
    /// Readings are absorbed.
    Running,
    /// Readings are not absorbed; the estimate stays.
    Holding,
    /// Something is broken; only `Hello`, `Reset` and the reads are answered.
    Fault,
}

/// Tells why the state is what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Reason {
    /// Power came on.
    Boot,
    /// A command said so.
    Command,
    /// The host was not heard for the time set.
    HostQuiet,
    /// Every asked-for parameter has its asked-for uncertainty; while running, the rule is one that lets the
    /// run go on.
    StopRule,
    /// The load cell's converter does not answer as it should.
    LoadCell(SensorFault),
    /// The IMU does not answer as it should.
    Imu(SensorFault),
    /// The second link's IMU does not answer as it should.
    SecondImu(SensorFault),
    /// No frames come, or none that are whole.
    Frames(SensorFault),
    /// The level of a tree's factor holds as many frames as single precision bears: take its rows, then start
    /// again.
    LevelFull,
}

/// Tells what is wrong with a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum SensorFault {
    /// The bus failed.
    Bus,
    /// Another chip answers.
    WrongId,
    /// A register does not hold what was written.
    Verify,
    /// Too many check sums in a row did not fit.
    Check,
    /// The device restarted by itself.
    Restarted,
    /// The rate asked for is not one it has, or its samples come at another.
    Rate,
    /// The sensor gives no new samples.
    Silent,
    /// The sensor's filters began anew.
    Resynced,
    /// The sensor brings the same sample again.
    Stale,
    /// The excitation of the gauges is missing, or far from the one stated.
    Excitation,
}

/// A setting that is impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum SettingName {
    /// `rate_hz`
    Rate,
    /// `imu.rotation_wxyz`
    ImuRotation,
    /// `imu.position_m`
    ImuPosition,
    /// `imu.accel_scale`
    AccelScale,
    /// `imu.accel_bias_mps2` or `imu.gyro_bias_radps`
    ImuBias,
    /// `imu.accel_noise_mps2` or `imu.gyro_noise_radps`
    ImuNoise,
    /// `imu.rate_hz`
    ImuRate,
    /// `imu.range_mps2` or `imu.range_radps`
    ImuRange,
    /// `load_cell.calibration`
    Calibration,
    /// `load_cell.noise_n_nm`, by channel
    Noise(u8),
    /// `load_cell.known_offset_n_nm`
    KnownOffset,
    /// `load_cell.range_n_nm`
    LoadCellRange,
    /// `filter_width_s` or `row_every`
    Filter,
    /// `stop`
    StopRule,
    /// `knock_limit_sd`
    KnockLimit,
    /// `memory`
    Memory,
    /// `model`: what the other settings ask for is not what it can do.
    Model,
    /// The second link's IMU, in `model`
    SecondImu,
    /// `joint_position_m` or `attitude`, in `model`
    Joint,
    /// A link of a tree, in `model`: its parent, axis or place
    Link(u8),
    /// The links of a tree, in `model`: none, too many, or too many parameters
    Links,
    /// The stiffness of springs, in `model`: not finite, not symmetric, or not positive
    Stiffness,
    /// The base link's place on springs, in `model`, or that no coordinate is free
    Suspension,
    /// The watch: its sensors of forces, limit, or time constant, in `model`
    Watch,
    /// The rate of the line
    LineRate,
    /// `load_cell.excitation_v`
    Excitation,
}

/// Tells where readings come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Source {
    /// The device's sensors.
    Sensors,
    /// `Inject` commands.
    Injected,
}

/// Everything that fixes what the device does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Settings {
    /// Rate of the load cell and so of the readings, 1/s.
    pub rate_hz: f32,
    /// Tells where readings come from.
    pub source: Source,
    /// Tells what is identified.
    pub model: ModelSettings,
    /// The IMU.
    pub imu: ImuSettings,
    /// The load cell.
    pub load_cell: LoadCellSettings,
    /// Width of the FIR, s; zero for still rows without time.
    pub filter_width_s: f32,
    /// A row block is absorbed once in this many readings.
    pub row_every: u16,
    /// A row is given less weight if it is further from the estimate so far than this many standard
    /// deviations; 0: never. The estimate is that of the last check of the factor, every fifty row blocks.
    pub knock_limit_sd: f32,
    /// Tells what is retained of the rows.
    pub memory: MemorySettings,
    /// Tells when the run ends by itself: judged by what is retained.
    pub stop: Option<StopRule>,
    /// Tells what is sent unasked.
    pub telemetry: TelemetrySettings,
    /// A channel is frozen after this many equal readings; 0: never.
    pub frozen_after: u16,
    /// Holding after this long without a byte from the host, ms; 0: never.
    pub host_timeout_ms: u32,
}

/// The IMU's settings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ImuSettings {
    /// Rate, 1/s.
    pub rate_hz: f32,
    /// `R_LU`, Hamilton quaternion.
    pub rotation_wxyz: [f32; 4],
    /// Origin of U in the link's frame, m.
    pub position_m: [f32; 3],
    /// Factor on each accelerometer axis.
    pub accel_scale: [f32; 3],
    /// Bias of the scaled accelerometer, IMU axes, m/s².
    pub accel_bias_mps2: [f32; 3],
    /// Bias of the gyro, IMU axes, rad/s.
    pub gyro_bias_radps: [f32; 3],
    /// 1 σ of the accelerometer per reading, m/s²; zero: taken as exact.
    pub accel_noise_mps2: f32,
    /// 1 σ of the gyro per reading, rad/s; zero: taken as exact.
    pub gyro_noise_radps: f32,
    /// Group delay, ns.
    pub group_delay_ns: u32,
    /// Range of the accelerometer, m/s².
    pub range_mps2: f32,
    /// Range of the gyro, rad/s.
    pub range_radps: f32,
}

/// The load cell's settings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct LoadCellSettings {
    /// `wrench = calibration · gauges`, N/V and N m/V, wrench on the body.
    pub calibration: [[f32; 6]; 6],
    /// 1 σ per reading, N and N m.
    pub noise_n_nm: [f32; 6],
    /// Known offset, on-body sign, N and N m; `None`: estimated along, sixteen parameters.
    pub known_offset_n_nm: Option<[f32; 6]>,
    /// Group delay, ns.
    pub group_delay_ns: u32,
    /// Range, N and N m.
    pub range_n_nm: [f32; 6],
    /// The part that the converter's seventh input has of the excitation while it is the one of the
    /// calibration, V; gauges are divided by the excitation's ratio to it. `None`: that input is not
    /// examined.
    pub excitation_v: Option<f32>,
}

/// Tells what is retained of the rows. Seconds are those of rows taken in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub enum MemorySettings {
    /// Everything.
    #[default]
    Forever,
    /// Forgets what newer rows renew, with a time constant.
    Forgetting {
        /// The time constant, s, at least `filter_width_s`.
        time_constant_s: f32,
        /// 1 σ of the accelerometer per reading, m/s²: what it alone brings renews nothing.
        accel_noise_mps2: f32,
        /// 1 σ of the gyro per reading, rad/s.
        gyro_noise_radps: f32,
    },
    /// The rows of the last seconds and nothing else.
    Window {
        /// Length of the window, s, at least `filter_width_s`; the rows in it never span more, and never less
        /// than four fifths of it.
        length_s: f32,
    },
}

/// Most uncertainties that a stop rule asks for.
pub const MAX_STOP_LIMITS: usize = 16;

/// The run ends when every asked-for parameter has its uncertainty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct StopRule {
    /// The uncertainties asked for; one at least, of parameters that are estimated.
    pub limits: Vec<StopLimit, MAX_STOP_LIMITS>,
    /// But not before this many row blocks, or frames.
    pub minimum_blocks: u32,
    /// The run does not end but goes on: that the rule is met is only reported.
    pub goes_on: bool,
}

impl StopRule {
    /// Returns the largest 95 % uncertainty that parameter `j` may have, SI; `None` if it is not asked for.
    #[inline(never)]
    pub fn u95(&self, j: usize) -> Option<f32> {
        let asked = self.limits.iter().filter(|limit| limit.is_for(j)).map(|limit| limit.u95);
        asked.reduce(f32::min)
    }
}

/// An uncertainty that is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct StopLimit {
    /// The largest 95 % uncertainty, SI.
    pub u95: f32,
    /// Bit j mod 8 of byte j / 8: parameter j is to have it.
    pub parameters: [u8; MAX_TREE_PARAMETERS / 8],
}

impl StopLimit {
    /// Makes it a limit for parameter `j` too, if there may be such a one.
    pub fn add(&mut self, j: usize) {
        if let Some(byte) = self.parameters.get_mut(j / 8) {
            *byte |= 1 << (j % 8);
        }
    }

    /// Returns whether it is a limit for parameter `j`.
    pub fn is_for(&self, j: usize) -> bool {
        self.parameters.get(j / 8).is_some_and(|byte| byte >> (j % 8) & 1 == 1)
    }
}

/// Holds what is sent unasked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct TelemetrySettings {
    /// The number of row blocks from one estimate to the next; 0: never.
    pub estimate_every_blocks: u16,
    /// Every reading, in batches.
    pub stream_readings: bool,
}

/// One reading on the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct ReadingMessage {
    /// Time of the load cell's sample, ns.
    pub time_ns: u64,
    /// Wrench on the body in S, N and N m.
    pub wrench: [f32; 6],
    /// Specific force, IMU axes, uncorrected, m/s².
    pub specific_force: [f32; 3],
    /// Angular rate, IMU axes, uncorrected, rad/s.
    pub angular_rate: [f32; 3],
}

/// Readings per batch to the device.
pub const INJECT_BATCH: usize = 16;
/// Readings per batch from the device.
pub const STREAM_BATCH: usize = 8;

/// Readings of a recording, in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct InjectBatch {
    /// Index of the first one, counted from the start of the run.
    pub first_index: u32,
    /// The readings.
    pub readings: Vec<ReadingMessage, INJECT_BATCH>,
}

/// The identity of the device.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Identity {
    /// [`PROTOCOL_VERSION`] of the device.
    pub protocol_version: u8,
    /// [`SCHEMA_HASH`] of the device.
    pub schema_hash: u64,
    /// Version of the firmware: major, minor, patch.
    pub firmware_version: [u8; 3],
    /// CRC-32 of the firmware's sources.
    pub firmware_hash: u32,
    /// The board, in ASCII, padded with zeros.
    pub board: [u8; 16],
    /// The chip's own number; zeros: it has none.
    pub unique_id: [u8; 12],
    /// Tells why the device started.
    pub reset: ResetReason,
    /// Tells where the program ended before that, if it ended badly.
    pub ended: Option<BadEnd>,
    /// Tells what its time comes from.
    pub clock: ClockSource,
    /// The state.
    pub state: StateName,
    /// Tells why.
    pub reason: Reason,
    /// Tells what is stored in flash.
    pub kept: Kept,
}

/// Tells what is stored in the device's flash.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Kept {
    /// There is no flash to keep anything in, or it does not answer.
    #[default]
    NoStorage,
    /// Nothing.
    Nothing,
    /// A run, which [`Command::Resume`] goes on with; while it is under way, what would be left of it now.
    Run(KeptRun),
    /// The data that other firmware has left, which is not read.
    OtherFirmware {
        /// CRC-32 of that firmware's sources.
        hash: u32,
    },
    /// Something that is none of this firmware's records, or a record that is damaged. It is not read.
    Damaged,
}

/// Holds what the last checkpoint of a run says of it; zeros if there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct KeptRun {
    /// Number of the run: one more with every `Configure`.
    pub run: u32,
    /// Readings taken.
    pub readings: u32,
    /// Row blocks absorbed.
    pub blocks: u32,
    /// Index of the reading that `Inject` is to bring next.
    pub next_index: u32,
    /// Time of the checkpoint on the clock of then, ns.
    pub time_ns: u64,
    /// Checkpoints of this run.
    pub checkpoints: u16,
    /// No further checkpoint finds room until the next `Configure`.
    pub full: bool,
}

/// Tells why a device started anew.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ResetReason {
    /// Power came on.
    #[default]
    PowerOn,
    /// The supply sagged.
    BrownOut,
    /// The reset pin, a button or a debugger's.
    Pin,
    /// The program asked for it.
    Software,
    /// The program had not come round for too long.
    Watchdog,
    /// The program panicked.
    Panic,
    /// The processor met a fault.
    Fault,
    /// The crystal stopped.
    ClockLost,
    /// The chip does not tell.
    Unknown,
}

/// Tells where a program ended. What does not apply is zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BadEnd {
    /// Address of the instruction that faulted.
    pub pc: u32,
    /// The address to which its function would have returned.
    pub lr: u32,
    /// The core's configurable fault status register.
    pub status: u32,
    /// The address that could not be reached, where `status` says that it is known.
    pub address: u32,
    /// Line of the sources that panicked.
    pub line: u32,
    /// FNV-1a, 32 bits, of the name of their file.
    pub file: u32,
}

/// Tells what a device's time comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ClockSource {
    /// The simulator.
    #[default]
    Simulated,
    /// A crystal: to some 50 parts in a million.
    Crystal,
    /// The chip's own oscillator, because the crystal does not start: times are off by up to 1 % at 25 °C and
    /// 4 % from −10 to 85 °C.
    Internal,
    /// The chip's own oscillator without the multiplier, which does not lock: too slow for sensors.
    Slow,
    /// The emulator's.
    Emulated,
}

/// Holds what happened since the start of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct CounterReport {
    /// Readings taken.
    pub readings: u32,
    /// Readings rejected.
    pub rejected: u32,
    /// Rejected per channel, in the order of a reading; then the second IMU's, then the joint's attitude.
    pub rejected_by_channel: [u16; 19],
    /// The last rejection: 0 none, 1 not finite, 2 saturated, 3 frozen.
    pub last_rejection: u8,
    /// The channel of the last rejection.
    pub last_rejected_channel: u8,
    /// Stretches of missing time.
    pub gaps: u32,
    /// Row blocks absorbed.
    pub blocks: u32,
    /// Row blocks in which a knock gave a channel of the wrench less weight, per channel.
    pub knocks: [u16; 6],
    /// Frames of the converter whose CRC did not fit.
    pub load_cell_crc_errors: u32,
    /// Other frames of the converter that held no sample.
    pub load_cell_errors: u32,
    /// Samples left out because a gauge was at the end of the converter's range.
    pub load_cell_clipped: u32,
    /// Bit g: gauge g was.
    pub clipped_gauges: u8,
    /// Frames of the converter that brought a conversion again which had been read before.
    pub load_cell_stale: u32,
    /// Times that the converter's filters began anew, whose conversions were left out.
    pub load_cell_resyncs: u32,
    /// Samples left out because the excitation of the gauges was missing.
    pub without_excitation: u32,
    /// Transfers with the sensors that did not end and were given up.
    pub overdue_transfers: u32,
    /// Transfers with the sensors that ended with an error of the bus.
    pub failed_transfers: u32,
    /// Rates of load cell, IMU and second IMU by the device's clock, less those asked for, parts in a million
    /// of these; `None`: not measured yet.
    pub rate_error_ppm: [Option<i32>; 3],
    /// The depth of the stack so far, and its size, bytes; zeros: the device does not know.
    pub stack_bytes: [u32; 2],
    /// Failed transfers with the IMU, overflows of its FIFO, and samples of it that were read too late.
    pub imu_errors: u32,
    /// Failed transfers with the second link's IMU, overflows of its FIFO, and samples of it that were read
    /// too late.
    pub second_imu_errors: u32,
    /// Samples of load cell, IMU and second IMU that were signalled and that the board could not keep.
    pub lost: [u32; 3],
    /// Tells what became of frames.
    pub frames: FrameReport,
    /// Tells what became of the watch.
    #[cfg_attr(not(feature = "watch"), serde(serialize_with = "nothing_watched"))]
    pub watch: WatchReport,
    /// Load-cell samples without IMU neighbours.
    pub unaligned: u32,
    /// Frames from the host that were damaged.
    pub bad_frames: u32,
    /// Times that the board had no room for bytes from the host, since the start of the run.
    pub overruns: u32,
    /// Telemetry frames dropped for want of room.
    pub telemetry_dropped: u32,
}

/// Tells what physical consistency leaves of the free answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Consistency {
    /// The rows do not determine every parameter, so that no body is nearest; or base parameters of several
    /// links, which may be those of bodies in many ways.
    NotDetermined,
    /// The free answer is a body's.
    Free,
    /// The estimate is not consistent; the nearest body is given.
    Projected,
    /// The estimate is not consistent; a body is given, but the iteration bound was met before it was the
    /// nearest one.
    NotConverged,
}

/// The estimate at some row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct EstimateReport {
    /// Readings taken.
    pub readings: u32,
    /// Time of the last reading, ns.
    pub time_ns: u64,
    /// Row blocks absorbed.
    pub blocks: u32,
    /// Ten parameters, or sixteen: those of a body, unless `consistency` says that none is determined. Of two
    /// links 19, or 25.
    pub estimate: Vec<f32, MAX_PARAMETERS>,
    /// Tells what became of the free answer.
    pub consistency: Consistency,
    /// Tells how far the free answer is from any body's, in standard deviations; zero if it is one's.
    pub distance_sd: f32,
    /// Standard deviation of each parameter of the free answer, for the σ of the settings.
    pub standard_deviation: Vec<f32, MAX_PARAMETERS>,
    /// Bit j: the rows determine parameter j.
    pub determined: u32,
    /// Condition number of the column-scaled rows.
    pub condition_number: f32,
    /// Root mean square of the innovations, each against the estimate before it, N and N m.
    pub innovation_rms: [f32; 6],
    /// The last reading.
    pub last: ReadingMessage,
}

impl EstimateReport {
    /// Tells nothing yet.
    pub const EMPTY: Self = Self {
        readings: 0,
        time_ns: 0,
        blocks: 0,
        estimate: Vec::new(),
        consistency: Consistency::NotDetermined,
        distance_sd: 0.0,
        standard_deviation: Vec::new(),
        determined: 0,
        condition_number: 0.0,
        innovation_rms: [0.0; 6],
        last: ReadingMessage {
            time_ns: 0,
            wrench: [0.0; 6],
            specific_force: [0.0; 3],
            angular_rate: [0.0; 3],
        },
    };
}

/// Device to host, unasked; yields to answers and is dropped, and counted, when there is no room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant, reason = "no heap")]
pub enum Telemetry {
    /// The device's identity, sent after power-on until the host says hello.
    Announce(Identity),
    /// The state has changed.
    State {
        /// The new state.
        state: StateName,
        /// Tells why.
        reason: Reason,
    },
    /// The estimate, at the rate set.
    Estimate(EstimateReport),
    /// Consecutive readings.
    Readings {
        /// Number of the first one, counted from the start of the run.
        first: u32,
        /// The readings.
        readings: Vec<ReadingMessage, STREAM_BATCH>,
    },
    /// Consecutive readings of two links.
    LinkReadings {
        /// Number of the first one, counted from the start of the run.
        first: u32,
        /// The readings.
        readings: Vec<LinkReadingMessage, LINK_BATCH>,
    },
    /// The device is there: once a second after the hello.
    Heartbeat {
        /// The device's time, ns.
        time_ns: u64,
    },
    /// A change of the link that is watched.
    #[cfg_attr(not(feature = "watch"), serde(skip))]
    Change(ChangeReport),
}
