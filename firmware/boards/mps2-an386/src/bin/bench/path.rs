//! The whole path of a sample, in the default configuration at 1 kHz.

use rigident_firmware::{App, Buses, Event, Instrument, Path, Sensor};
use rigident_shared::wire::{
    AttitudeSource, Command, ImuSettings, Kind, LinkJoint, LinkSettings, LoadCellSettings, MemorySettings,
    ModelSettings, Settings, Source, StateName, StopLimit, StopRule, TelemetrySettings, TwoLinkSettings,
    encode, frame,
};
#[cfg(feature = "watch")]
use rigident_shared::wire::{FootSettings, WatchJoint, WatchLinkSettings, WatchSettings};

use crate::kernels::CHANNEL_SIGMA;
use crate::measure::{Bench, give_up};
use crate::sensors;

/// Until the filter is full and the factor no longer empty.
const WARM_UP: usize = 200;
/// Holds a merge of the cascade's first level and two evaluations of the stop rule.
const SAMPLES: u32 = 1000;
/// The worst is searched for in this many blocks: at one block in ten samples the cascade's second level is
/// merged once in 100 000 samples.
const SEARCH: u32 = 101_000;
/// Bytes that a serial port of 1 MBd takes away in a millisecond.
const LINE_BYTES: usize = 100;
/// Blocks in which the worst sample with estimates is searched for: some eighty estimates, a check with each
/// fiftieth block, all slices of both.
const ESTIMATES_SEARCH: u32 = 20_000;
/// Different samples, gone through again and again.
const WORDS: usize = 64;
/// The number of parameters from which on it is two links.
const TWO_LINKS: usize = 19;
const SILENT: TelemetrySettings = TelemetrySettings { estimate_every_blocks: 0, stream_readings: false };

/// Measures one IMU reading and one of the load cell, as decoded from the bus, through everything that the
/// application does with them, its work after each event included.
#[inline(never)]
pub fn decoded(bench: &mut Bench, path: &mut Path, n: usize) {
    telling(bench, path, "path", n, SILENT, SEARCH, |_| ());
}

/// Measures the path of [`decoded`] with an estimate four times a second, its solution and the nearest body
/// in it, and with all readings, too. A serial port of 1 MBd takes away what is sent.
#[inline(never)]
pub fn with_telemetry(bench: &mut Bench, path: &mut Path, n: usize) {
    let estimates = TelemetrySettings { estimate_every_blocks: 25, ..SILENT };
    let everything = TelemetrySettings { stream_readings: true, ..estimates };
    for (part, telemetry) in [("path with estimates", estimates), ("path with all telemetry", everything)] {
        telling(bench, path, part, n, telemetry, ESTIMATES_SEARCH, |app| {
            let mut sent = [0; LINE_BYTES];
            app.poll_tx(&mut sent);
        });
    }
}

/// Measures the path with this telemetry. `after` is called after each sample.
#[inline(never)]
fn telling(
    bench: &mut Bench,
    path: &mut Path,
    part: &str,
    n: usize,
    telemetry: TelemetrySettings,
    search: u32,
    mut after: impl FnMut(&mut App<&mut Path>),
) {
    let mut app = App::new("bench", path);
    for (sequence, command) in commands(n, telemetry).iter().enumerate() {
        let (bytes, length) = encoded(sequence, command);
        for byte in &bytes[..length] {
            if app.on_byte(*byte, 0).is_some() {
                app.sensors_up(Ok(()));
            }
        }
    }
    let words: [_; WORDS] = core::array::from_fn(words);
    let mut next = words.iter().cycle();
    let mut time_ns = 0;
    let mut sample = || {
        let Some((volts, specific_force, angular_rate)) = next.next() else { return };
        time_ns += 630_000;
        app.on_imu(time_ns, *specific_force, *angular_rate);
        app.work();
        if n >= TWO_LINKS {
            // Another motion of the same size.
            let [[ax, ay, az], [gx, gy, gz]] = [*specific_force, *angular_rate];
            app.on_second_imu(time_ns, [ay, az, ax], [0.5 * gz, gx, -gy]);
            app.work();
        }
        time_ns += 370_000;
        app.on_gauges(time_ns, *volts, 0.0);
        app.work();
        after(&mut app);
    };
    (0..WARM_UP).for_each(|_| sample());
    bench.case(part, n, SAMPLES, search, sample);
    check_running(&app);
}

/// Measures the path of [`decoded`] from the bytes on the bus: one frame of the converter and one packet of
/// the IMU through the drivers. The bus itself is a copy.
#[inline(never)]
pub fn with_drivers(bench: &mut Bench, path: &mut Path, n: usize) {
    let mut instrument = instrument(path);
    for (sequence, command) in commands(n, SILENT).iter().enumerate() {
        let (bytes, length) = encoded(sequence, command);
        instrument.on_bytes(&bytes[..length], 0);
    }
    let mut time_ns = 0;
    let mut sample = || {
        time_ns += 630_000;
        instrument.on_event(Event { sensor: Sensor::Imu, capture_time_ns: time_ns });
        if n >= TWO_LINKS {
            instrument.on_event(Event { sensor: Sensor::SecondImu, capture_time_ns: time_ns });
        }
        time_ns += 370_000;
        instrument.on_event(Event { sensor: Sensor::LoadCell, capture_time_ns: time_ns });
    };
    (0..WARM_UP).for_each(|_| sample());
    bench.case("path with drivers", n, SAMPLES, 0, sample);
    check_running(instrument.app());
}

/// Drivers and application on sensors that cost next to nothing.
fn instrument(
    path: &mut Path,
) -> Instrument<&mut Path, sensors::Adc, sensors::Imu, sensors::Frames, sensors::NoWait> {
    instrument_of(path, sensors::Frames::new(false))
}

fn instrument_of(
    path: &mut Path,
    frames: sensors::Frames,
) -> Instrument<&mut Path, sensors::Adc, sensors::Imu, sensors::Frames, sensors::NoWait> {
    let buses =
        Buses { load_cell: sensors::Adc::new(), imus: [sensors::Imu::new(), sensors::Imu::new()], frames };
    Instrument::new("bench", path, buses, sensors::NoWait)
}

/// Measures one frame of the 34-DOF human from the bytes on the bus through the driver to the factor of 128
/// parameters: every second frame reduces twelve rows. Of a tracked base its rows are those of nine frames
/// under the filter.
#[inline(never)]
pub fn frames(bench: &mut Bench, path: &mut Path, tracked: bool) {
    let mut instrument = instrument_of(path, sensors::Frames::new(tracked));
    let commands = [Command::Configure(tree(tracked)), Command::Start];
    for (sequence, command) in commands.iter().enumerate() {
        let (bytes, length) = encoded(sequence, command);
        instrument.on_bytes(&bytes[..length], 0);
    }
    let mut time_ns = 0;
    let mut frame = || {
        time_ns += 10_000_000;
        instrument.on_event(Event { sensor: Sensor::Frames, capture_time_ns: time_ns });
    };
    // Columns that meet no row cost nothing: until the factor has its full rank.
    (0..sensors::FRAMES / 2).for_each(|_| frame());
    let name = if tracked { "tracked frame path" } else { "frame path" };
    bench.case(name, 128, 20, 20, frame);
    check_running(instrument.app());
}

/// Measures one frame of a humanoid of 30 links that is watched, from the bytes on the link; twenty of fifty
/// take a step of the test along.
#[inline(never)]
#[cfg(feature = "watch")]
pub fn watch(bench: &mut Bench, path: &mut Path) {
    let mut instrument = instrument(path);
    // In the place of the frames on the bus, of which none is read.
    let mut streamed = sensors::Streamed::new();
    let foot = FootSettings { link: 6, rotation_wxyz: [1.0, 0.0, 0.0, 0.0], position_m: [0.0, 0.0, -0.05] };
    let robot = WatchSettings {
        links: sensors::WATCHED_LINKS as u8,
        watched: 29,
        feet: [foot, FootSettings { link: 12, ..foot }, FootSettings::default(), FootSettings::default()],
        foot_count: 2,
        limit: 1e9,
        settle_bins: 2,
        forget_s: 120.0,
    };
    let settings = Settings {
        model: ModelSettings::Watch(robot),
        rate_hz: 500.0,
        // Frames are numbered anew after each round of them, and rows with it: as many bins as with 25 and no
        // end.
        row_every: 13,
        stop: None,
        ..settings(10, SILENT)
    };
    let mut send = |sequence: usize, command: &Command| {
        let (bytes, length) = encoded(sequence, command);
        instrument.on_bytes(&bytes[..length], 0);
    };
    send(0, &Command::Configure(settings));
    for link in 0..sensors::WATCHED_LINKS {
        let given = WatchLinkSettings {
            // Four limbs of seven and a trunk.
            parent: if link % 7 == 1 { 0 } else { link.saturating_sub(1) as u8 },
            joint: if link == 0 { WatchJoint::Fixed } else { WatchJoint::Revolute },
            axis: core::array::from_fn(|k| if k == link % 3 { 1.0 } else { 0.0 }),
            rotation_wxyz: [1.0, 0.0, 0.0, 0.0],
            position_m: [0.02, 0.03, -0.1],
            parameters: [1.5, 0.01, 0.02, -0.1, 0.03, 0.03, 0.02, 0.001, 0.002, 0.001],
        };
        send(1 + link, &Command::WatchLink { link: link as u8, settings: given });
    }
    send(100, &Command::Start);
    let mut time_ns = 0;
    let mut frame = || {
        time_ns += 2_000_000;
        instrument.on_bytes(streamed.next(), time_ns);
        instrument.tick(time_ns);
        // What it says, a heartbeat a second, is taken away.
        instrument.poll_tx(&mut [0; LINE_BYTES]);
    };
    // Until all bins are full.
    (0..40 * sensors::FRAMES).for_each(|_| frame());
    bench.case(
        "watch path",
        sensors::WATCHED_LINKS,
        sensors::FRAMES as u32,
        2 * sensors::FRAMES as u32,
        frame,
    );
    check_running(instrument.app());
}

/// Returns the settings of the 34-DOF human: ten spherical joints, knees and elbows about y.
fn tree(tracked: bool) -> Settings {
    const PARENTS: [u8; sensors::TREE_LINKS] = [0, 0, 1, 2, 2, 4, 5, 2, 7, 8, 0, 10, 11, 0, 13];
    let links = PARENTS.iter().enumerate().map(|(i, parent)| LinkSettings {
        parent: *parent,
        joint: match i {
            0 if tracked => LinkJoint::Free,
            5 | 8 | 11 | 14 => LinkJoint::Revolute(1),
            _ => LinkJoint::Spherical,
        },
        position_m: [0.02 * i as f32, 0.1, -0.3],
    });
    Settings {
        model: ModelSettings::Tree(links.collect()),
        rate_hz: 100.0,
        row_every: 1,
        stop: None,
        ..settings(10, SILENT)
    }
}

fn check_running(app: &App<&mut Path>) {
    if app.state().0 != StateName::Running {
        give_up("the firmware does not run, or not any more");
    }
}

fn commands(n: usize, telemetry: TelemetrySettings) -> [Command; 2] {
    [Command::Configure(settings(n, telemetry)), Command::Start]
}

fn encoded(sequence: usize, command: &Command) -> ([u8; frame::MAX_FRAME], usize) {
    let mut bytes = [0; frame::MAX_FRAME];
    let length = encode(Kind::Command, sequence as u16, command, &mut bytes).expect("it fits");
    (bytes, length)
}

/// Gauges in V, specific force in m/s², angular rate in rad/s: each channel a different triangle wave.
fn words(k: usize) -> ([f32; 6], [f32; 3], [f32; 3]) {
    let wave = |period: usize, amplitude: f32| {
        let phase = (k * 7 + period) % period;
        amplitude * (phase as f32 * 2.0 / period as f32 - 0.97)
    };
    (
        core::array::from_fn(|g| wave(11 + 2 * g, 8e-4) + if g == 2 { 2e-3 } else { 0.0 }),
        core::array::from_fn(|axis| wave(31 + 6 * axis, 3.0) + if axis == 2 { 9.8 } else { 0.0 }),
        core::array::from_fn(|axis| wave(43 + 4 * axis, 1.1)),
    )
}

fn settings(n: usize, telemetry: TelemetrySettings) -> Settings {
    // All ten are checked each time, and the last one is never good enough.
    let mut never = StopLimit { u95: 0.0, ..StopLimit::default() };
    never.add(9);
    let imu = ImuSettings {
        rate_hz: 1000.0,
        rotation_wxyz: [0.92, 0.20, -0.10, 0.32],
        position_m: [0.06, -0.04, 0.02],
        accel_scale: [1.0; 3],
        accel_bias_mps2: [0.0; 3],
        gyro_bias_radps: [0.0; 3],
        accel_noise_mps2: 0.02,
        gyro_noise_radps: 2e-3,
        group_delay_ns: 600_000,
        range_mps2: 157.0,
        range_radps: 34.0,
    };
    let known_offset_n_nm = (n == 10 || n == TWO_LINKS).then_some([0.0; 6]);
    Settings {
        rate_hz: 1000.0,
        source: Source::Sensors,
        model: if n < TWO_LINKS {
            ModelSettings::Body
        } else {
            ModelSettings::TwoLinks(TwoLinkSettings {
                imu,
                joint_position_m: [0.05, 0.02, 0.2],
                attitude: AttitudeSource::FromImus {
                    initial_wxyz: [1.0, 0.0, 0.0, 0.0],
                    time_constant_s: 5.0,
                },
            })
        },
        imu,
        load_cell: LoadCellSettings {
            calibration: core::array::from_fn(|i| core::array::from_fn(|j| if i == j { 1e5 } else { 3e3 })),
            noise_n_nm: CHANNEL_SIGMA,
            known_offset_n_nm,
            group_delay_ns: 1_500_000,
            range_n_nm: [1e6; 6],
            excitation_v: None,
        },
        filter_width_s: 0.1,
        row_every: 10,
        knock_limit_sd: 6.0,
        memory: MemorySettings::Forever,
        stop: Some(StopRule { limits: [never].into_iter().collect(), minimum_blocks: 1, goes_on: false }),
        telemetry,
        frozen_after: 50,
        host_timeout_ms: 0,
    }
}
