//! The application as the host sees it: states, commands, telemetry, and what bad input does to it.

use rigident_firmware::{App, BringUpError, EventRoom, Path, Sensor};
use rigident_shared::consistency::{ITERATIONS, nearest};
use rigident_shared::factor::InformationFactor;
use rigident_shared::wire::frame::MAX_FRAME;
use rigident_shared::wire::{
    Answer, BadEnd, ClockSource, Command, Consistency, Decoder, ErrorCode, EventCode, ImuSettings,
    InjectBatch, Kind, LoadCellSettings, MemorySettings, ModelSettings, ReadingMessage, Reason, Reply,
    ResetReason, SensorFault, SettingName, Settings, Source, StateName, StopLimit, StopRule, Telemetry,
    TelemetrySettings, encode, number_of_reason, number_of_reset,
};

mod line;
mod stream;

fn settings(source: Source) -> Settings {
    Settings {
        rate_hz: 200.0,
        source,
        model: ModelSettings::Body,
        imu: ImuSettings {
            rate_hz: 200.0,
            rotation_wxyz: [1.0, 0.0, 0.0, 0.0],
            position_m: [0.0; 3],
            accel_scale: [1.0; 3],
            accel_bias_mps2: [0.0; 3],
            gyro_bias_radps: [0.0; 3],
            accel_noise_mps2: 0.0,
            gyro_noise_radps: 0.0,
            group_delay_ns: 0,
            range_mps2: 160.0,
            range_radps: 35.0,
        },
        load_cell: LoadCellSettings {
            calibration: std::array::from_fn(|i| std::array::from_fn(|j| f32::from(u8::from(i == j)))),
            noise_n_nm: [1.0; 6],
            known_offset_n_nm: None,
            group_delay_ns: 0,
            range_n_nm: [1e4; 6],
            excitation_v: None,
        },
        filter_width_s: 0.1,
        row_every: 2,
        knock_limit_sd: 6.0,
        memory: MemorySettings::Forever,
        stop: None,
        telemetry: TelemetrySettings { estimate_every_blocks: 25, stream_readings: false },
        frozen_after: 50,
        host_timeout_ms: 0,
    }
}

/// Returns a reading of a 2 kg point mass at (0, 0, 0.1) m whose frame turns and sways.
fn reading(n: u32) -> ReadingMessage {
    let t = f64::from(n) / 200.0;
    let w: [f64; 3] = [(1.9 * t).sin(), 0.8 * (2.7 * t).cos(), 0.7 * (3.3 * t).sin()];
    let wd: [f64; 3] = [1.9 * (1.9 * t).cos(), -0.8 * 2.7 * (2.7 * t).sin(), 0.7 * 3.3 * (3.3 * t).cos()];
    let a = [3.0 * (1.1 * t).sin(), 2.0 * (0.7 * t).cos(), 9.0 + (1.3 * t).sin()];
    let cross = |u: [f64; 3], v: [f64; 3]| {
        [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    };
    let c = [0.0, 0.0, 0.1];
    let (x, y) = (cross(wd, c), cross(w, cross(w, c)));
    let f: [f64; 3] = std::array::from_fn(|k| 2.0 * (a[k] + x[k] + y[k]));
    let m = cross(c, f);
    ReadingMessage {
        time_ns: u64::from(n) * 5_000_000,
        wrench: std::array::from_fn(|k| if k < 3 { f[k] as f32 } else { m[k - 3] as f32 }),
        specific_force: a.map(|v| v as f32),
        angular_rate: w.map(|v| v as f32),
    }
}

/// A host with its own decoder at the other end of the line.
struct Host {
    app: App<Box<Path>>,
    decoder: Decoder,
    sequence: u16,
    telemetry: Vec<Telemetry>,
}

impl Host {
    fn new() -> Self {
        Self {
            app: App::new("test", Box::default()),
            decoder: Decoder::new(),
            sequence: 0,
            telemetry: Vec::new(),
        }
    }

    fn send(&mut self, sequence: u16, command: &Command, now_ns: u64) {
        let mut frame = [0; MAX_FRAME];
        let length = encode(Kind::Command, sequence, command, &mut frame).unwrap();
        for byte in &frame[..length] {
            if self.app.on_byte(*byte, now_ns).is_some() {
                self.app.sensors_up(Ok(()));
            }
        }
    }

    /// Returns everything that has been sent; telemetry is set aside. Every frame must be whole.
    fn drain(&mut self) -> Vec<(u16, Answer)> {
        let mut answers = Vec::new();
        let mut bytes = [0; 512];
        loop {
            let count = self.app.poll_tx(&mut bytes);
            if count == 0 {
                return answers;
            }
            for byte in &bytes[..count] {
                if let Some(frame) = self.decoder.push(*byte) {
                    let frame = frame.expect("the device sends whole frames");
                    match frame.kind {
                        Kind::Answer => answers.push((frame.sequence, frame.message().unwrap())),
                        Kind::Telemetry => self.telemetry.push(frame.message().unwrap()),
                        Kind::Command | Kind::Stream => panic!("the device commands"),
                    }
                }
            }
        }
    }

    fn ask_at(&mut self, command: &Command, now_ns: u64) -> Answer {
        self.sequence += 1;
        self.send(self.sequence, command, now_ns);
        let answers = self.drain();
        let [(sequence, answer)] = answers.as_slice() else { panic!("{} answers", answers.len()) };
        assert_eq!(*sequence, self.sequence);
        answer.clone()
    }

    fn ask(&mut self, command: &Command) -> Answer {
        self.ask_at(command, 0)
    }

    fn inject(&mut self, from: u32, count: u32) -> Answer {
        let readings = (from..from + count).map(reading).collect();
        self.ask(&Command::Inject(InjectBatch { first_index: from, readings }))
    }

    fn run(&mut self, settings: Settings, readings: u32) {
        assert_eq!(self.ask(&Command::Configure(settings)), Ok(Reply::Done));
        assert_eq!(self.ask(&Command::Start), Ok(Reply::Done));
        for from in (0..readings).step_by(16) {
            let count = 16.min(readings - from);
            let Ok(Reply::Injected { next_index }) = self.inject(from, count) else { panic!("not injected") };
            if next_index != from + count {
                return;
            }
        }
    }

    fn factor(&mut self) -> InformationFactor<f32, 16> {
        let (mut rows, mut z, mut residual, mut count) = (Vec::new(), Vec::new(), 0.0, 0);
        for row in 0.. {
            let Ok(Reply::Row(mut taken)) = self.ask(&Command::TakeRow { row }) else {
                panic!("no row {row}")
            };
            if row == 0 {
                (residual, count) = (taken.residual_sum_of_squares, taken.rows);
            }
            z.extend(taken.entries.pop());
            rows.extend(taken.entries);
            if row + 1 == taken.parameters {
                break;
            }
        }
        let entries = rows.into_iter().chain(z).chain([residual]);
        InformationFactor::from_entries(entries, count).unwrap()
    }
}

#[test]
fn commands_move_the_states_and_are_refused_elsewhere() {
    let mut host = Host::new();
    let wrong = |state| Err(ErrorCode::WrongState(state));
    assert_eq!(host.ask(&Command::Start), wrong(StateName::Idle));
    assert_eq!(host.ask(&Command::Hold), wrong(StateName::Idle));
    assert_eq!(host.ask(&Command::ReadSettings), wrong(StateName::Idle));
    assert_eq!(host.ask(&Command::ReadEstimate), Err(ErrorCode::NoEstimate));
    assert!(matches!(host.ask(&Command::Hello), Ok(Reply::Hello(_))));
    let s = settings(Source::Sensors);
    assert_eq!(host.ask(&Command::Configure(s.clone())), Ok(Reply::Done));
    assert_eq!(host.ask(&Command::ReadSettings), Ok(Reply::Settings(s.clone())));
    assert_eq!(host.ask(&Command::Start), Ok(Reply::Done));
    assert_eq!(host.ask(&Command::Configure(s)), wrong(StateName::Running));
    assert_eq!(host.ask(&Command::Hold), Ok(Reply::Done));
    assert_eq!(host.ask(&Command::Start), Ok(Reply::Done));
    assert_eq!(host.ask(&Command::Reset), Ok(Reply::Done));
    assert_eq!(host.app.state(), (StateName::Idle, Reason::Command));
}

#[test]
fn a_recording_gives_its_body_and_the_factor_crosses_the_wire_whole() {
    let mut host = Host::new();
    host.run(settings(Source::Injected), 6000);
    let Ok(Reply::Estimate(report)) = host.ask(&Command::ReadEstimate) else { panic!("no estimate") };
    let solution = host.factor().solve();
    // A point on an axis is at the very edge of what bodies can be.
    assert_ne!(report.consistency, Consistency::NotDetermined);
    let near = nearest(&host.factor(), &solution.estimate, ITERATIONS);
    assert_eq!(report.estimate.as_slice(), near.parameters(&solution.estimate).unwrap());
    assert_eq!(Some(report.distance_sd), near.distance_sd());
    // 2 kg at 0.1 m: a point has 0.02 kg m² about the two other axes.
    let truth = [2.0, 0.0, 0.0, 0.2, 0.02, 0.02, 0.0, 0.0, 0.0, 0.0];
    for (value, truth) in solution.estimate.iter().zip(truth) {
        assert!((value - truth).abs() < 2e-4, "{value} {truth}");
    }
    assert!(host.telemetry.iter().filter(|t| matches!(t, Telemetry::Estimate(_))).count() > 100);
}

#[test]
fn a_repeated_command_is_answered_from_memory_and_acts_once() {
    let mut host = Host::new();
    host.run(settings(Source::Injected), 0);
    let batch = Command::Inject(InjectBatch { first_index: 0, readings: (0..16).map(reading).collect() });
    host.send(500, &batch, 0);
    let first = host.drain();
    host.send(500, &batch, 0);
    assert_eq!(host.drain(), first);
    assert_eq!(first, [(500, Ok(Reply::Injected { next_index: 16 }))]);
    // As a command of its own it comes too early for 16 and too late for 0.
    host.send(501, &batch, 0);
    assert_eq!(host.drain(), [(501, Err(ErrorCode::OutOfOrder { expected: 16 }))]);
    // A late copy of an older one does nothing.
    host.send(499, &Command::Reset, 0);
    assert_eq!(host.drain(), [(499, Err(ErrorCode::Stale))]);
    assert_eq!(host.app.state().0, StateName::Running);
}

#[test]
fn a_quiet_host_ends_in_holding_and_is_reported() {
    let mut host = Host::new();
    let s = Settings { host_timeout_ms: 2000, ..settings(Source::Injected) };
    host.run(s, 0);
    host.app.tick(1_900_000_000);
    assert_eq!(host.app.state().0, StateName::Running);
    host.ask_at(&Command::Heartbeat, 1_900_000_000).unwrap();
    host.app.tick(3_800_000_000);
    assert_eq!(host.app.state().0, StateName::Running);
    host.app.tick(4_000_000_000);
    assert_eq!(host.app.state(), (StateName::Holding, Reason::HostQuiet));
    host.drain();
    let reported = Telemetry::State { state: StateName::Holding, reason: Reason::HostQuiet };
    assert!(host.telemetry.contains(&reported));
}

/// Noise on the line is no host: neither bytes, nor zeros, nor a frame with a changed bit put off the end.
#[test]
fn noise_on_the_line_is_not_taken_for_a_host() {
    let mut frame = [0; MAX_FRAME];
    let length = encode(Kind::Command, 9, &Command::Heartbeat, &mut frame).unwrap();
    frame[2] ^= 4;
    for noise in [&[0x55][..], &[0], &[0xff, 0, 0xff], &frame[..length]] {
        let mut host = Host::new();
        host.run(Settings { host_timeout_ms: 2000, ..settings(Source::Injected) }, 0);
        for ms in (0..2_050).step_by(10) {
            for byte in noise {
                host.app.on_byte(*byte, ms * 1_000_000);
            }
            host.app.tick(ms * 1_000_000);
        }
        assert_eq!(host.app.state(), (StateName::Holding, Reason::HostQuiet), "{noise:x?}");
    }
}

#[test]
fn a_restart_is_due_once_its_answer_is_sent_and_refused_where_nothing_can_do_it() {
    let mut host = Host::new();
    assert_eq!(host.ask(&Command::Restart), Err(ErrorCode::NotBuiltIn));
    assert!(!host.app.restart_is_due());
    host.app.can_restart();
    host.run(settings(Source::Injected), 100);
    host.send(77, &Command::Restart, 0);
    assert!(!host.app.restart_is_due(), "its answer waits");
    assert_eq!(host.drain(), [(77, Ok(Reply::Done))]);
    assert!(host.app.restart_is_due());
    assert_eq!(host.app.state().0, StateName::Holding, "what was absorbed is kept first");
}

/// A board that is asked for more than it can do says what it is, and where its program ended.
#[test]
fn the_hello_tells_the_chip_and_where_the_last_program_ended() {
    let mut host = Host::new();
    let end = BadEnd { pc: 0x0800_1234, lr: 0x0800_0001, status: 1 << 17, address: 0, line: 0, file: 0 };
    host.app.is_chip(*b"twelve bytes", Some(end));
    host.app.stack_was(21_000, 41_000);
    let Ok(Reply::Hello(who)) = host.ask(&Command::Hello) else { panic!("no hello") };
    assert_eq!((who.unique_id, who.ended), (*b"twelve bytes", Some(end)));
    let Ok(Reply::Counters(counters)) = host.ask(&Command::ReadCounters) else { panic!("no counters") };
    assert_eq!(counters.stack_bytes, [21_000, 41_000]);
}

/// By the chip's own oscillator nobody can say which of two rates is wrong: the clock is reported, and the
/// run is not refused.
#[test]
fn a_rate_is_refused_by_a_crystal_and_not_by_the_chips_own_oscillator() {
    for (clock, refused) in [(ClockSource::Crystal, true), (ClockSource::Internal, false)] {
        let mut host = Host::new();
        host.app.booted(ResetReason::PowerOn, clock);
        assert_eq!(host.ask(&Command::Configure(settings(Source::Sensors))), Ok(Reply::Done));
        // 200 Hz asked for, and 196.
        for n in 1..300_u64 {
            host.app.on_gauges(n * 5_102_041, [0.1; 6], 0.0);
        }
        let answer = host.ask(&Command::Start);
        let expected = if refused { Err(ErrorCode::Sensors) } else { Ok(Reply::Done) };
        assert_eq!(answer, expected, "{clock:?}");
        let state = if refused {
            (StateName::Fault, Reason::LoadCell(SensorFault::Rate))
        } else {
            (StateName::Running, Reason::Command)
        };
        assert_eq!(host.app.state(), state);
    }
}

#[test]
fn impossible_settings_are_named_and_change_nothing() {
    let mut host = Host::new();
    let good = settings(Source::Injected);
    assert_eq!(host.ask(&Command::Configure(good.clone())), Ok(Reply::Done));
    type Spoil = fn(&mut Settings);
    let spoilt: [(Spoil, SettingName); 13] = [
        (|s| s.load_cell.excitation_v = Some(2.5), SettingName::Excitation),
        (|s| s.load_cell.excitation_v = Some(f32::NAN), SettingName::Excitation),
        (|s| s.rate_hz = 0.0, SettingName::Rate),
        (|s| s.rate_hz = f32::NAN, SettingName::Rate),
        (|s| s.imu.rotation_wxyz = [0.0; 4], SettingName::ImuRotation),
        (|s| s.imu.position_m[1] = f32::INFINITY, SettingName::ImuPosition),
        (|s| s.imu.accel_scale[2] = -1.0, SettingName::AccelScale),
        (|s| s.load_cell.noise_n_nm[4] = 0.0, SettingName::Noise(4)),
        (|s| s.load_cell.calibration[3] = [0.0; 6], SettingName::Calibration),
        (|s| s.load_cell.known_offset_n_nm = Some([f32::NAN; 6]), SettingName::KnownOffset),
        (|s| s.filter_width_s = 10.0, SettingName::Filter),
        (|s| s.row_every = 0, SettingName::Filter),
        (|s| s.knock_limit_sd = -1.0, SettingName::KnockLimit),
    ];
    for (spoil, name) in spoilt {
        let mut bad = good.clone();
        spoil(&mut bad);
        assert_eq!(host.ask(&Command::Configure(bad)), Err(ErrorCode::BadSetting(name)));
        assert_eq!(host.ask(&Command::ReadSettings), Ok(Reply::Settings(good.clone())));
    }
}

/// Returns a stop rule for the mass alone.
fn mass_to(u95: f32) -> StopRule {
    let mut limit = StopLimit { u95, ..StopLimit::default() };
    limit.add(0);
    StopRule { limits: [limit].into_iter().collect(), minimum_blocks: 10, goes_on: false }
}

#[test]
fn a_stop_rule_that_lets_the_run_go_on_is_reported_once() {
    let stop = StopRule { goes_on: true, ..mass_to(0.02) };
    let mut host = Host::new();
    host.run(Settings { stop: Some(stop), ..settings(Source::Injected) }, 6000);
    assert_eq!(host.app.state(), (StateName::Running, Reason::StopRule));
    let mut plain = Host::new();
    plain.run(settings(Source::Injected), 6000);
    assert_eq!(host.factor(), plain.factor());
}

#[test]
fn the_stop_rule_ends_the_run_at_the_same_reading_whatever_the_batches() {
    let stop = mass_to(0.02);
    let s = Settings { stop: Some(stop), ..settings(Source::Injected) };
    let mut whole = Host::new();
    whole.run(s.clone(), 6000);
    assert_eq!(whole.app.state(), (StateName::Holding, Reason::StopRule));
    let mut single = Host::new();
    single.run(s, 0);
    let mut n = 0;
    while single.app.state().0 == StateName::Running {
        single.inject(n, 1).unwrap();
        n += 1;
    }
    assert_eq!(whole.factor(), single.factor());
    assert!(n < 6000);
}

#[test]
fn sensors_that_fail_for_good_are_a_fault_and_passing_errors_are_counted() {
    let mut host = Host::new();
    host.run(settings(Source::Sensors), 0);
    for round in 0..3 {
        for _ in 0..4 {
            host.app.on_sensor_error(Sensor::LoadCell, SensorFault::Check);
        }
        // A thousand good frames make up for a damaged one.
        for k in 0..4 * 1_000 {
            host.app.on_gauges(10_000 * round + k + 1, [0.0; 6], 0.0);
        }
    }
    assert_eq!(host.app.state().0, StateName::Running);
    let Ok(Reply::Counters(counters)) = host.ask(&Command::ReadCounters) else { panic!("no counters") };
    assert_eq!(counters.load_cell_crc_errors, 12);
    for _ in 0..10 {
        host.app.on_sensor_error(Sensor::Imu, SensorFault::Bus);
    }
    assert_eq!(host.app.state(), (StateName::Fault, Reason::Imu(SensorFault::Bus)));
    // A sensor that does not come up is a fault, and the command says so.
    let mut app = App::new("test", Box::default());
    let mut frame = [0; MAX_FRAME];
    let command = Command::Configure(settings(Source::Sensors));
    let length = encode(Kind::Command, 1, &command, &mut frame).unwrap();
    let wanted = frame[..length].iter().filter_map(|byte| app.on_byte(*byte, 0)).count();
    assert_eq!(wanted, 1);
    app.sensors_up(Err(BringUpError::Fault(Reason::LoadCell(SensorFault::WrongId))));
    assert_eq!(app.state(), (StateName::Fault, Reason::LoadCell(SensorFault::WrongId)));
}

/// The IMU's words have no check sum: what damages the load cell's on the same bus damages them, without a
/// word.
#[test]
fn a_bus_that_damages_more_than_one_frame_in_a_thousand_is_a_fault() {
    for (good, is_fault) in [(30, true), (51, true), (125, true), (500, true), (1_001, false), (5_000, false)]
    {
        let mut host = Host::new();
        host.run(settings(Source::Sensors), 0);
        for k in 0..30_000_u64 {
            if k % (good + 1) == good {
                host.app.on_sensor_error(Sensor::LoadCell, SensorFault::Check);
            } else {
                host.app.on_gauges(k + 1, [0.0; 6], 0.0);
            }
        }
        let expected = (StateName::Fault, Reason::LoadCell(SensorFault::Check));
        assert_eq!(host.app.state() == expected, is_fault, "one in {good}: {:?}", host.app.state());
    }
}

#[test]
fn answers_overtake_telemetry_and_messages_without_room_are_counted() {
    let mut host = Host::new();
    let mut s = settings(Source::Sensors);
    s.telemetry.stream_readings = true;
    host.run(s, 0);
    for n in 0..4000_u64 {
        host.app.on_imu(n * 5_000_000, [0.0, 0.1 * n as f32, 9.8], [0.0, 0.0, 0.001 * n as f32]);
        host.app.on_gauges(n * 5_000_000, [n as f32; 6], 0.0);
        host.app.work();
    }
    // Nothing was fetched: the queue is full. The answer still comes, and soon.
    host.send(900, &Command::ReadCounters, 0);
    let mut head = [0; 2 * MAX_FRAME];
    let count = host.app.poll_tx(&mut head);
    let mut early = false;
    for byte in &head[..count] {
        if let Some(frame) = host.decoder.push(*byte) {
            early |= frame.unwrap().kind == Kind::Answer;
        }
    }
    assert!(early);
    host.drain();
    host.sequence = 900;
    let Ok(Reply::Counters(counters)) = host.ask(&Command::ReadCounters) else { panic!("no counters") };
    assert!(counters.telemetry_dropped > 0);
}

/// For any bytes on the line, the application answers in whole frames, and a clean run afterwards gives the
/// clean answer, bit for bit.
#[test]
fn garbage_and_wild_commands_never_corrupt_a_later_run() {
    let mut clean = Host::new();
    clean.run(settings(Source::Injected), 800);
    let expected = clean.factor();
    let mut host = Host::new();
    let mut state = 3_u64;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    for _ in 0..3000 {
        match random() % 4 {
            0 => {
                for _ in 0..random() % 300 {
                    let _ = host.app.on_byte(random() as u8, random() % 1_000_000);
                }
            }
            1 => {
                let mut s = settings(Source::Injected);
                s.load_cell.noise_n_nm[(random() % 6) as usize] = f32::from_bits(random() as u32);
                s.imu.rotation_wxyz[0] = f32::from_bits(random() as u32);
                s.filter_width_s = f32::from_bits(random() as u32);
                host.send(random() as u16, &Command::Configure(s), 0);
            }
            2 => {
                let mut wild = reading(random() as u32 % 1000);
                wild.wrench[(random() % 6) as usize] = f32::from_bits(random() as u32);
                wild.angular_rate[0] = f32::from_bits(random() as u32);
                let batch = InjectBatch { first_index: 0, readings: [wild].into_iter().collect() };
                host.send(random() as u16, &Command::Inject(batch), 0);
            }
            _ => {
                let commands = [
                    Command::Start,
                    Command::Hold,
                    Command::Reset,
                    Command::ReadEstimate,
                    Command::ReadCounters,
                    Command::TakeRow { row: random() as u8 % 20 },
                    Command::Hello,
                ];
                host.send(random() as u16, &commands[(random() % 7) as usize], 0);
            }
        }
        host.drain();
    }
    // Ends whatever half frame is left; hello starts the numbers anew.
    let _ = host.app.on_byte(0, 0);
    host.drain();
    host.send(1, &Command::Hello, 0);
    host.drain();
    host.sequence = 1;
    host.ask(&Command::Reset).unwrap();
    host.run(settings(Source::Injected), 800);
    assert_eq!(host.factor(), expected);
}

/// Room for events that outlives a program, as a board's memory does a reset.
#[test]
fn events_of_the_program_before_are_reported_by_the_next_one() {
    let room: &'static EventRoom = Box::leak(Box::new(EventRoom::empty()));
    let program = |reset| {
        let mut host = Host::new();
        host.app.keeps_events(room);
        host.app.booted(reset, ClockSource::Crystal);
        host
    };
    let mut first = program(ResetReason::PowerOn);
    first.run(settings(Source::Sensors), 0);
    for _ in 0..10 {
        first.app.on_sensor_error(Sensor::Imu, SensorFault::Bus);
    }
    first.app.on_lost(Sensor::Imu, 3);
    assert!(first.ask(&Command::Start).is_err());
    let mut second = program(ResetReason::Watchdog);
    let Ok(Reply::Events(report)) = second.ask(&Command::ReadEvents) else { panic!("no events") };
    let reported: Vec<(u8, u8)> = report.events.iter().map(|event| (event.code, event.detail)).collect();
    let expected = [
        (EventCode::Started, number_of_reset(ResetReason::PowerOn)),
        (EventCode::Configured, number_of_reason(Reason::Command)),
        (EventCode::Running, number_of_reason(Reason::Command)),
        (EventCode::Fault, number_of_reason(Reason::Imu(SensorFault::Bus))),
        (EventCode::Refused, ErrorCode::WrongState(StateName::Fault).number() as u8),
        (EventCode::Started, number_of_reset(ResetReason::Watchdog)),
    ];
    assert_eq!(reported, expected.map(|(code, detail)| (code as u8, detail)));
    // A board without such memory keeps none, and says so.
    let Ok(Reply::Events(none)) = Host::new().ask(&Command::ReadEvents) else { panic!("no answer") };
    assert!(none.events.is_empty());
}
