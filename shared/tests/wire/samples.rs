//! One message of every kind.

use rigident_shared::wire::*;

/// Any message with its direction.
#[derive(Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "only a test")]
pub enum Message {
    Command(Command),
    Answer(Answer),
    Telemetry(Telemetry),
    /// A frame of a robot that is watched.
    Stream(Vec<u8>),
}

pub fn settings() -> Settings {
    Settings {
        rate_hz: 1000.0,
        source: Source::Sensors,
        model: ModelSettings::Body,
        imu: ImuSettings {
            rate_hz: 500.0,
            rotation_wxyz: [0.5, -0.5, 0.5, 0.5],
            position_m: [0.05, 0.0, -0.125],
            accel_scale: [1.0, 1.01, 0.99],
            accel_bias_mps2: [0.02, 0.0, -0.03],
            gyro_bias_radps: [0.001, 0.002, 0.003],
            accel_noise_mps2: 0.02,
            gyro_noise_radps: 0.0015,
            group_delay_ns: 1_000_000,
            range_mps2: 156.9,
            range_radps: 34.9,
        },
        load_cell: LoadCellSettings {
            calibration: core::array::from_fn(|i| {
                core::array::from_fn(|j| if i == j { 1e5 } else { (i as f32) - (j as f32) })
            }),
            noise_n_nm: [0.1, 0.1, 0.2, 0.005, 0.005, 0.005],
            known_offset_n_nm: Some([1.0, -2.0, 3.0, 0.1, 0.2, -0.3]),
            group_delay_ns: 1_500_000,
            range_n_nm: [660.0, 660.0, 1980.0, 60.0, 60.0, 60.0],
            excitation_v: Some(1.0),
        },
        filter_width_s: 0.06,
        row_every: 10,
        knock_limit_sd: 6.0,
        memory: MemorySettings::Forgetting {
            time_constant_s: 20.0,
            accel_noise_mps2: 0.02,
            gyro_noise_radps: 0.000_5,
        },
        stop: Some(StopRule {
            limits: (0..10)
                .map(|j| {
                    let mut limit = StopLimit { u95: 0.01 * j as f32, ..StopLimit::default() };
                    limit.add(j);
                    limit
                })
                .collect(),
            minimum_blocks: 300,
            goes_on: false,
        }),
        telemetry: TelemetrySettings { estimate_every_blocks: 25, stream_readings: true },
        frozen_after: 20,
        host_timeout_ms: 3000,
    }
}

pub fn reading(k: u32) -> ReadingMessage {
    let x = k as f32;
    ReadingMessage {
        time_ns: 1_000_000 * u64::from(k),
        wrench: [x, -x, 200.0, 0.5, 0.25, -0.125],
        specific_force: [0.1, 0.2, 9.8],
        angular_rate: [0.01 * x, -0.02, 0.03],
    }
}

fn identity() -> Identity {
    Identity {
        protocol_version: PROTOCOL_VERSION,
        // Not the real one: it has a golden of its own.
        schema_hash: 0x0123_4567_89ab_cdef,
        firmware_version: [0, 1, 2],
        firmware_hash: 0xdead_beef,
        board: *b"mps2-an386\0\0\0\0\0\0",
        unique_id: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12],
        reset: ResetReason::Fault,
        ended: Some(BadEnd {
            pc: 0x0800_1234,
            lr: 0x0800_4321,
            status: 0x8200,
            address: 0xdead_0000,
            line: 77,
            file: 0x1234_5678,
        }),
        clock: ClockSource::Internal,
        state: StateName::Idle,
        reason: Reason::Boot,
        kept: Kept::Run(KeptRun {
            run: 7,
            readings: 4000,
            blocks: 399,
            next_index: 0,
            time_ns: 4_000_000_000,
            checkpoints: 2,
            full: false,
        }),
    }
}

fn events() -> EventReport {
    let event = |time_ms, code, detail, count| EventMessage { time_ms, code, detail, count };
    let events = [event(0, 1, 4, 1), event(300_000, 8, 2, 255)];
    EventReport { events: events.into_iter().collect() }
}

fn counters() -> CounterReport {
    CounterReport {
        readings: 20_000,
        rejected: 12,
        rejected_by_channel: [0, 0, 7, 0, 0, 0, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0],
        last_rejection: 2,
        last_rejected_channel: 9,
        gaps: 3,
        blocks: 1_990,
        knocks: [0, 12, 3, 0, 0, 1],
        load_cell_crc_errors: 1,
        load_cell_errors: 2,
        load_cell_clipped: 300,
        clipped_gauges: 0b10_0001,
        load_cell_stale: 10,
        load_cell_resyncs: 11,
        without_excitation: 400,
        overdue_transfers: 13,
        failed_transfers: 14,
        rate_error_ppm: [Some(-40), Some(9_000), None],
        stack_bytes: [21_000, 41_000],
        imu_errors: 4,
        second_imu_errors: 8,
        lost: [9, 300, 1],
        frames: FrameReport {
            frames: 3000,
            absorbed: 2900,
            missing: 3,
            damaged: 4,
            wrong_links: 10,
            not_finite: 20,
            no_attitude: 30,
            saturated: 15,
            without_motion: 25,
            full: 1,
            last_link: 7,
        },
        watch: WatchReport {
            changes: 2,
            settled: true,
            excess_percent: 340,
            last_saturated: 1,
            stream: StreamReport { lost: 300, repeated: 2, late: 1, unasked: 40 },
        },
        unaligned: 5,
        bad_frames: 6,
        overruns: 17,
        telemetry_dropped: 70_000,
    }
}

fn estimate() -> EstimateReport {
    EstimateReport {
        readings: 20_000,
        time_ns: 20_000_000_000,
        blocks: 1_990,
        estimate: (0..16).map(|j| j as f32 - 3.5).collect(),
        consistency: Consistency::Projected,
        distance_sd: 1.25,
        standard_deviation: (0..16).map(|j| 0.001 * j as f32).collect(),
        determined: 0xfffe,
        condition_number: 37.5,
        innovation_rms: [0.1, 0.2, 0.3, 0.01, 0.02, 0.03],
        last: reading(19_999),
    }
}

fn two_links() -> Settings {
    let one = settings();
    let model = ModelSettings::TwoLinks(TwoLinkSettings {
        imu: one.imu,
        joint_position_m: [0.1, 0.0, 0.25],
        attitude: AttitudeSource::FromImus { initial_wxyz: [1.0, 0.0, 0.0, 0.0], time_constant_s: 5.0 },
    });
    Settings { model, stop: None, memory: MemorySettings::Forever, ..one }
}

fn tree() -> Settings {
    let link = |parent, joint| LinkSettings { parent, joint, position_m: [0.0, 0.125, -0.5] };
    let links = [(0, LinkJoint::Fixed), (0, LinkJoint::Spherical), (1, LinkJoint::Revolute(1))];
    let model = ModelSettings::Tree(links.into_iter().map(|(p, j)| link(p, j)).collect());
    Settings { model, ..settings() }
}

fn tracked_tree() -> Settings {
    let mut settings = tree();
    if let ModelSettings::Tree(links) = &mut settings.model {
        links[0].joint = LinkJoint::Free;
    }
    settings
}

fn suspended_tree() -> Settings {
    let settings = tree();
    let ModelSettings::Tree(links) = &settings.model else { return settings };
    let springs = SuspensionSettings {
        stiffness: core::array::from_fn(|k| 100.0 * k as f32),
        base_position_m: [0.0, 0.25, 0.5],
        base_rotation_wxyz: [0.5, 0.5, -0.5, 0.5],
        anchor_height_m: -0.125,
        locked: 0b10_0100,
    };
    Settings { model: ModelSettings::Suspended(links.clone(), springs), ..settings }
}

fn watch() -> Settings {
    let foot =
        FootSettings { link: 6, rotation_wxyz: [0.5, 0.5, -0.5, 0.5], position_m: [0.125, 0.0, -0.25] };
    let model = ModelSettings::Watch(WatchSettings {
        links: 30,
        watched: 17,
        feet: [foot, FootSettings { link: 12, ..foot }, FootSettings::default(), FootSettings::default()],
        foot_count: 2,
        limit: 45.5,
        settle_bins: 100,
        forget_s: 60.0,
    });
    Settings { model, stop: None, memory: MemorySettings::Forever, ..settings() }
}

fn watch_link() -> WatchLinkSettings {
    WatchLinkSettings {
        parent: 16,
        joint: WatchJoint::Prismatic,
        axis: [0.0, 0.0, 1.0],
        rotation_wxyz: [0.5, -0.5, 0.5, 0.5],
        position_m: [0.25, 0.0, -0.5],
        parameters: core::array::from_fn(|k| k as f32 - 2.5),
    }
}

/// Returns the stream settings of three links and a foot.
fn stream() -> Message {
    let mut bytes = [0; watch_frame::MAX_WATCH_FRAME];
    let imu = [0.5, -0.25, 9.75, 0.125, -1.0, 2.0];
    let foot = [1.0, -2.0, 300.0, 4.0, 5.0, -6.0];
    let joints = [[0.5, -1.5], [-0.75, 3.0]];
    let length = WatchFrame::encode(70_000, &imu, &[foot], &joints, &mut bytes).unwrap();
    Message::Stream(bytes[..length].to_vec())
}

fn change() -> ChangeReport {
    ChangeReport {
        change: 2,
        found: 15_020,
        at: 15_000,
        between: [14_990, 15_010],
        ratio: 1.5,
        size: Some(ChangeSize {
            change: core::array::from_fn(|k| k as f32 - 2.5),
            standard_deviation: core::array::from_fn(|k| 0.5 * k as f32),
        }),
    }
}

fn link_reading(k: u32) -> LinkReadingMessage {
    LinkReadingMessage {
        base: reading(k),
        specific_force: [0.5, -0.5, 9.5],
        angular_rate: [1.0, 2.0, -3.0],
        attitude_wxyz: [0.5, -0.5, 0.5, 0.5],
    }
}

fn row() -> FactorRow {
    FactorRow {
        row: 126,
        parameters: 128,
        entries: [1.5, -2.5, 4.0].into_iter().collect(),
        gram: [0.5, 0.25].into_iter().collect(),
        residual_sum_of_squares: 0.25,
        rows: 6000,
    }
}

/// Returns every message once.
pub fn samples() -> Vec<(&'static str, Message)> {
    let command = Message::Command;
    let reply = |m| Message::Answer(Ok(m));
    let refusal = |m| Message::Answer(Err(m));
    let telemetry = Message::Telemetry;
    let batch = InjectBatch { first_index: 4096, readings: (0..3).map(reading).collect() };
    vec![
        ("command_hello", command(Command::Hello)),
        ("command_configure", command(Command::Configure(settings()))),
        ("command_configure_two_links", command(Command::Configure(two_links()))),
        ("command_configure_tree", command(Command::Configure(tree()))),
        ("command_configure_tracked_tree", command(Command::Configure(tracked_tree()))),
        ("command_configure_suspended_tree", command(Command::Configure(suspended_tree()))),
        ("command_configure_watch", command(Command::Configure(watch()))),
        ("command_watch_link", command(Command::WatchLink { link: 17, settings: watch_link() })),
        ("command_line_rate", command(Command::LineRate { baud: 2_000_000 })),
        ("command_start", command(Command::Start)),
        ("command_hold", command(Command::Hold)),
        ("command_reset", command(Command::Reset)),
        ("command_inject", command(Command::Inject(batch))),
        (
            "command_inject_links",
            command(Command::InjectLinks(LinkBatch {
                first_index: 4096,
                readings: (0..2).map(link_reading).collect(),
            })),
        ),
        ("command_take_row", command(Command::TakeRow { row: 126 })),
        ("command_read_settings", command(Command::ReadSettings)),
        ("command_read_counters", command(Command::ReadCounters)),
        ("command_read_estimate", command(Command::ReadEstimate)),
        ("command_heartbeat", command(Command::Heartbeat)),
        ("command_resume", command(Command::Resume { run: 7, next_reading: 4096 })),
        ("command_restart", command(Command::Restart)),
        ("command_read_events", command(Command::ReadEvents)),
        ("reply_done", reply(Reply::Done)),
        ("reply_events", reply(Reply::Events(events()))),
        ("reply_hello", reply(Reply::Hello(identity()))),
        ("reply_settings", reply(Reply::Settings(settings()))),
        ("reply_counters", reply(Reply::Counters(counters()))),
        ("reply_estimate", reply(Reply::Estimate(estimate()))),
        ("reply_row", reply(Reply::Row(row()))),
        ("reply_injected", reply(Reply::Injected { next_index: 4099 })),
        ("error_unknown_command", refusal(ErrorCode::UnknownCommand)),
        ("error_wrong_protocol", refusal(ErrorCode::WrongProtocol { have: 1, want: 2 })),
        ("error_wrong_state", refusal(ErrorCode::WrongState(StateName::Running))),
        ("error_bad_setting", refusal(ErrorCode::BadSetting(SettingName::Noise(4)))),
        ("error_out_of_order", refusal(ErrorCode::OutOfOrder { expected: 4096 })),
        ("error_no_estimate", refusal(ErrorCode::NoEstimate)),
        ("error_sensors", refusal(ErrorCode::Sensors)),
        ("error_stale", refusal(ErrorCode::Stale)),
        ("error_not_built_in", refusal(ErrorCode::NotBuiltIn)),
        ("error_not_kept", refusal(ErrorCode::NotKept)),
        ("telemetry_announce", telemetry(Telemetry::Announce(identity()))),
        (
            "telemetry_state",
            telemetry(Telemetry::State {
                state: StateName::Fault,
                reason: Reason::LoadCell(SensorFault::Check),
            }),
        ),
        ("telemetry_estimate", telemetry(Telemetry::Estimate(estimate()))),
        (
            "telemetry_readings",
            telemetry(Telemetry::Readings { first: 4096, readings: (0..2).map(reading).collect() }),
        ),
        (
            "telemetry_link_readings",
            telemetry(Telemetry::LinkReadings { first: 4096, readings: (0..2).map(link_reading).collect() }),
        ),
        ("telemetry_change", telemetry(Telemetry::Change(change()))),
        ("telemetry_heartbeat", telemetry(Telemetry::Heartbeat { time_ns: 1_000_000_000 })),
        ("stream_frame", stream()),
    ]
}

/// Returns the messages with lists at their longest and numbers at their widest: postcard writes up to ten
/// bytes for a `u64` and five for a `u32`.
pub fn longest() -> Vec<(&'static str, Message)> {
    let widest = ReadingMessage { time_ns: u64::MAX, ..reading(1) };
    let full = EstimateReport {
        readings: u32::MAX,
        time_ns: u64::MAX,
        blocks: u32::MAX,
        last: widest,
        estimate: core::iter::repeat_n(1.0, MAX_PARAMETERS).collect(),
        standard_deviation: core::iter::repeat_n(1.0, MAX_PARAMETERS).collect(),
        determined: u32::MAX,
        ..estimate()
    };
    let widest_pair = LinkReadingMessage { base: widest, ..link_reading(1) };
    let pairs = core::iter::repeat_n(widest_pair, LINK_BATCH);
    let link_batch = LinkBatch { first_index: u32::MAX, readings: pairs.clone().collect() };
    let links = core::iter::repeat_n(
        LinkSettings { parent: 15, joint: LinkJoint::Revolute(2), position_m: [1.0; 3] },
        MAX_LINKS,
    );
    let tree = Settings { model: ModelSettings::Tree(links.collect()), ..settings() };
    let widest_row = FactorRow {
        row: u8::MAX,
        parameters: u8::MAX,
        entries: core::iter::repeat_n(1.0, MAX_TREE_PARAMETERS + 1).collect(),
        gram: core::iter::repeat_n(1.0, MAX_NOISY_PARAMETERS).collect(),
        residual_sum_of_squares: 1.0,
        rows: u32::MAX,
    };
    let batch =
        InjectBatch { first_index: u32::MAX, readings: core::iter::repeat_n(widest, INJECT_BATCH).collect() };
    let stream = Telemetry::Readings {
        first: u32::MAX,
        readings: core::iter::repeat_n(widest, STREAM_BATCH).collect(),
    };
    let event = EventMessage { time_ms: u32::MAX, code: u8::MAX, detail: u8::MAX, count: u8::MAX };
    let full_events = EventReport { events: core::iter::repeat_n(event, MAX_EVENTS).collect() };
    vec![
        ("inject", Message::Command(Command::Inject(batch))),
        ("estimate", Message::Telemetry(Telemetry::Estimate(full))),
        ("inject_links", Message::Command(Command::InjectLinks(link_batch))),
        ("configure_tree", Message::Command(Command::Configure(tree))),
        ("row", Message::Answer(Ok(Reply::Row(widest_row)))),
        (
            "link_readings",
            Message::Telemetry(Telemetry::LinkReadings { first: u32::MAX, readings: pairs.collect() }),
        ),
        ("readings", Message::Telemetry(stream)),
        ("events", Message::Answer(Ok(Reply::Events(full_events)))),
    ]
}
