//! Frames of a robot that is watched, over the link: none is answered, all are counted, and none that arrived
//! damaged is taken in.

use rigident_shared::wire::encode_payload;
use rigident_shared::wire::{
    ChangeReport, Command, CounterReport, FootSettings, Kind, ModelSettings, Reason, Reply, SensorFault,
    Settings, Source, StateName, StreamReport, Telemetry, WatchFrame, WatchJoint, WatchLinkSettings,
    WatchReport, WatchSettings, frame::MAX_FRAME, watch_frame::MAX_WATCH_FRAME,
};

use super::{Host, settings};

const RATE_HZ: u32 = 200;
const FRAMES: u32 = 8 * RATE_HZ;
/// The frame from which on the body weighs [`MORE_KG`] more.
const CHANGE: u32 = 5 * RATE_HZ;
const MASS_KG: f32 = 2.0;
const MORE_KG: f32 = 0.5;

/// Returns a robot of a body and a plate that is welded to it, on one sensor.
fn robot() -> Settings {
    let robot = WatchSettings {
        links: 2,
        watched: 0,
        feet: [FootSettings { rotation_wxyz: [1.0, 0.0, 0.0, 0.0], ..FootSettings::default() }; 4],
        foot_count: 1,
        limit: 60.0,
        settle_bins: 20,
        forget_s: 0.0,
    };
    Settings {
        rate_hz: RATE_HZ as f32,
        model: ModelSettings::Watch(robot),
        row_every: 10,
        stop: None,
        ..settings(Source::Sensors)
    }
}

fn link(parameters: [f32; 10]) -> WatchLinkSettings {
    WatchLinkSettings {
        parent: 0,
        joint: WatchJoint::Fixed,
        axis: [0.0; 3],
        rotation_wxyz: [1.0, 0.0, 0.0, 0.0],
        position_m: [0.0; 3],
        parameters,
    }
}

/// Returns a number in [−1, 1): a hash of its own number (Wang's), so that a frame is the same in every run.
fn noise(number: u32) -> f32 {
    let mut x = (number ^ 61) ^ (number >> 16);
    x = x.wrapping_mul(9);
    x = (x ^ (x >> 4)).wrapping_mul(0x27d4_eb2d);
    (x ^ (x >> 15)) as f32 / 2_147_483_648.0 - 1.0
}

/// Returns the payload of a point mass in the sensor's origin that is shaken and turned: force is mass times
/// specific force.
fn payload(number: u32) -> Vec<u8> {
    let t = number as f32 / RATE_HZ as f32;
    let shaken = [3.0 * (7.0 * t).sin(), 2.0 * (11.0 * t).cos(), 9.8 + 2.0 * (5.0 * t).sin()];
    let mass = MASS_KG + if number < CHANGE { 0.0 } else { MORE_KG };
    let foot = std::array::from_fn(|k| {
        let exact = if k < 3 { mass * shaken[k] } else { 0.0 };
        exact + noise(6 * number + k as u32) * if k < 3 { 0.2 } else { 0.01 }
    });
    let turning = [(3.0 * t).sin(), 1.5 * (4.3 * t).cos(), (5.9 * t).sin()];
    let imu = [shaken[0], shaken[1], shaken[2], turning[0], turning[1], turning[2]];
    encoded(number, &imu, &[foot], 2)
}

fn encoded(number: u32, imu: &[f32; 6], feet: &[[f32; 6]], links: usize) -> Vec<u8> {
    let mut bytes = [0; MAX_WATCH_FRAME];
    let joints = vec![[0.0; 2]; links - 1];
    let length = WatchFrame::encode(number, imu, feet, &joints, &mut bytes).unwrap();
    bytes[..length].to_vec()
}

fn on_line(sequence: u16, payload: &[u8]) -> Vec<u8> {
    let mut bytes = [0; MAX_FRAME];
    let length = encode_payload(Kind::Stream, sequence, payload, &mut bytes).unwrap();
    bytes[..length].to_vec()
}

fn at_ns(number: u32) -> u64 {
    u64::from(number) * 1_000_000_000 / u64::from(RATE_HZ)
}

impl Host {
    fn watches() -> Self {
        let mut host = Self::new();
        host.configured();
        assert_eq!(host.ask(&Command::Start), Ok(Reply::Done));
        host
    }

    pub(super) fn configured(&mut self) {
        assert_eq!(self.ask(&Command::Configure(robot())), Ok(Reply::Done));
        let body = [MASS_KG, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        for (k, parameters) in [body, [0.0; 10]].into_iter().enumerate() {
            let command = Command::WatchLink { link: k as u8, settings: link(parameters) };
            assert_eq!(self.ask(&command), Ok(Reply::Done));
        }
    }

    /// Sends bytes as they are; nothing is answered.
    fn line(&mut self, bytes: &[u8], now_ns: u64) {
        for byte in bytes {
            assert!(self.app.on_byte(*byte, now_ns).is_none());
        }
        assert!(self.drain().is_empty());
    }

    fn frame(&mut self, number: u32) {
        self.line(&on_line(number as u16, &payload(number)), at_ns(number));
    }

    fn counted(&mut self, now_ns: u64) -> CounterReport {
        let Ok(Reply::Counters(counters)) = self.ask_at(&Command::ReadCounters, now_ns) else {
            panic!("no counters")
        };
        counters
    }

    fn changes(&self) -> Vec<ChangeReport> {
        let change = |t: &Telemetry| if let Telemetry::Change(change) = t { Some(*change) } else { None };
        self.telemetry.iter().filter_map(change).collect()
    }
}

/// Returns the report where all frames come once and in order.
fn undisturbed() -> (Vec<ChangeReport>, CounterReport) {
    let mut host = Host::watches();
    (0..FRAMES).for_each(|number| host.frame(number));
    let counters = host.counted(at_ns(FRAMES));
    (host.changes(), counters)
}

#[test]
fn a_change_is_reported_when_it_is_found_and_when_it_is_measured() {
    let (changes, counters) = undisturbed();
    let [found, measured] = changes.as_slice() else { panic!("{changes:?}") };
    assert!(found.size.is_none() && (CHANGE..CHANGE + RATE_HZ).contains(&found.found), "{found:?}");
    let size = measured.size.unwrap();
    let error = (size.change[0] - MORE_KG).abs();
    // Noise is uniform: 0.2/√3 N of a frame, and the mass is seen in some 300 of them at 10 m/s².
    assert!(error < 4.0 * size.standard_deviation[0] && size.standard_deviation[0] < 0.01, "{size:?}");
    assert_eq!((counters.frames.frames, counters.frames.absorbed), (FRAMES, FRAMES));
    assert_eq!((counters.watch.changes, counters.watch.settled), (1, true));
    assert_eq!((counters.frames.missing, counters.watch.stream), (0, StreamReport::default()));
}

#[test]
fn repeated_and_late_frames_are_left_out_and_other_requests_are_answered_between_frames() {
    let (wanted, clean) = undisturbed();
    let mut host = Host::watches();
    // Sequence numbers wrap in between.
    let sequence = |number: u32| (number as u16).wrapping_sub(700);
    let (mut repeated, mut late) = (0, 0);
    for number in 0..FRAMES {
        let now_ns = at_ns(number);
        let own = on_line(sequence(number), &payload(number));
        host.line(&own, now_ns);
        if number % 7 == 3 {
            host.line(&own, now_ns);
            repeated += 1;
        }
        if number % 50 == 20 {
            host.line(&on_line(sequence(number - 5), &payload(number - 5)), now_ns);
            late += 1;
        }
        if number % 8 == 7 {
            assert_eq!(host.counted(now_ns).frames.frames, number + 1);
        }
    }
    let counters = host.counted(at_ns(FRAMES));
    assert_eq!(host.changes(), wanted);
    assert_eq!(counters.frames, clean.frames);
    let stream = StreamReport { repeated, late, ..StreamReport::default() };
    assert_eq!(counters.watch, WatchReport { stream, ..clean.watch });
}

#[test]
fn damaged_and_missing_frames_are_lost_and_the_watch_goes_on() {
    let mut host = Host::watches();
    for number in 0..FRAMES {
        match number {
            700 => {
                let mut damaged = on_line(number as u16, &payload(number));
                damaged[30] ^= 0x10;
                host.line(&damaged, at_ns(number));
            }
            800..803 => {}
            // Its closing zero is lost, and the next one with it.
            900 => {
                let whole = on_line(number as u16, &payload(number));
                host.line(&whole[..whole.len() - 1], at_ns(number));
            }
            _ => host.frame(number),
        }
    }
    let counters = host.counted(at_ns(FRAMES));
    assert_eq!(counters.watch.stream, StreamReport { lost: 6, ..StreamReport::default() });
    assert_eq!((counters.bad_frames, counters.frames.missing), (2, 6));
    assert_eq!((counters.frames.frames, counters.frames.absorbed), (FRAMES - 6, FRAMES - 6));
    let changes = host.changes();
    let [found, measured] = changes.as_slice() else { panic!("{changes:?}") };
    assert!((CHANGE..CHANGE + RATE_HZ).contains(&found.found), "{found:?}");
    let size = measured.size.unwrap();
    assert!((size.change[0] - MORE_KG).abs() < 4.0 * size.standard_deviation[0], "{size:?}");
}

#[test]
fn frames_that_nobody_asked_for_are_counted_and_nothing_else() {
    let mut host = Host::new();
    let unasked = |host: &mut Host| {
        let (before, state) = (host.counted(0).watch.stream.unasked, host.app.state());
        host.frame(0);
        let counters = host.counted(0);
        assert_eq!((counters.watch.stream.unasked, host.app.state()), (before + 1, state));
        assert_eq!(counters.watch.stream.lost, 0);
    };
    unasked(&mut host);
    host.configured();
    unasked(&mut host);
    assert_eq!(host.ask(&Command::Start), Ok(Reply::Done));
    host.frame(0);
    assert_eq!(host.counted(0).watch.stream, StreamReport::default());
    assert_eq!(host.ask(&Command::Hold), Ok(Reply::Done));
    unasked(&mut host);
    unasked(&mut host);
    // Going on: whoever streams counts anew.
    assert_eq!(host.ask(&Command::Start), Ok(Reply::Done));
    host.line(&on_line(40_000, &payload(1)), 0);
    let counters = host.counted(0);
    assert_eq!(
        (counters.frames.absorbed, counters.watch.stream.lost, counters.watch.stream.unasked),
        (2, 0, 2)
    );
    // A body is no robot to watch.
    assert_eq!(host.ask(&Command::Reset), Ok(Reply::Done));
    assert_eq!(host.ask(&Command::Configure(settings(Source::Injected))), Ok(Reply::Done));
    assert_eq!(host.ask(&Command::Start), Ok(Reply::Done));
    unasked(&mut host);
}

#[test]
fn frames_of_another_robot_and_numbers_that_are_none_are_left_out() {
    let mut host = Host::watches();
    let (imu, foot) = ([0.0; 6], [0.0; 6]);
    let payloads = [
        payload(0),
        encoded(1, &imu, &[foot], 5),
        encoded(2, &imu, &[foot, foot], 2),
        payload(3)[1..].to_vec(),
        Vec::new(),
        encoded(5, &[f32::NAN; 6], &[foot], 2),
        encoded(6, &imu, &[[1e6; 6]], 2),
        payload(7),
    ];
    for (k, payload) in payloads.iter().enumerate() {
        host.line(&on_line(k as u16, payload), 0);
    }
    let frames = host.counted(0).frames;
    assert_eq!((frames.frames, frames.absorbed), (8, 2));
    assert_eq!((frames.wrong_links, frames.not_finite, frames.saturated), (4, 1, 1));
    host.line(&on_line(8, &payloads[1]), 0);
    assert_eq!(host.counted(0).frames.last_link, 5);
}

#[test]
fn frames_that_cease_are_a_fault() {
    let mut host = Host::watches();
    (0..20).for_each(|number| host.frame(number));
    host.app.tick(at_ns(19) + 990_000_000);
    assert_eq!(host.app.state().0, StateName::Running);
    host.app.tick(at_ns(19) + 1_010_000_000);
    assert_eq!(host.app.state(), (StateName::Fault, Reason::Frames(SensorFault::Silent)));
}

#[test]
fn bytes_without_room_are_counted_for_the_run() {
    let mut host = Host::watches();
    host.app.on_overruns(2);
    host.app.on_overruns(1);
    assert_eq!(host.counted(0).overruns, 3);
    assert_eq!(host.ask(&Command::Reset), Ok(Reply::Done));
    assert_eq!(host.counted(0).overruns, 0);
}
