//! The watch on the firmware, frames over its link.

use std::io;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use rigident_shared::wire::frame::MAX_FRAME;
use rigident_shared::wire::{Answer, Command, Decoder, ErrorCode, Kind, Reply, SettingName, encode};
use rigident_sim::rig::{Rig, RigConfig};
use rigident_sim::runner::{InProcess, Mcu, Pacing};

use super::*;
use crate::link::{BAUD, Client, LinkError, Transport};
use crate::session::streamed::{Pace, Watched};
use crate::session::watched::NumberedFrame;
use crate::session::{Session, SessionError};

/// The effect of the line on the frames that pass it.
#[derive(Clone, Copy)]
enum Fate {
    Passes,
    Lost,
    Twice,
    Damaged,
}

/// A line to firmware, on which something happens to every nth frame.
struct Line {
    mcu: Box<dyn Mcu>,
    decoder: Decoder,
    frames: usize,
    fate: fn(usize) -> Fate,
    /// The number of frames after which the line goes out.
    out_after: Option<usize>,
}

impl Line {
    fn to(mcu: Box<dyn Mcu>) -> Self {
        Self { mcu, decoder: Decoder::new(), frames: 0, fate: |_| Fate::Passes, out_after: None }
    }
}

impl Transport for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let is_frame = bytes
            .iter()
            .any(|byte| matches!(self.decoder.push(*byte), Some(Ok(f)) if f.kind == Kind::Stream));
        if self.is_out() {
            return Ok(());
        }
        if !is_frame {
            return self.mcu.write(bytes);
        }
        self.frames += 1;
        match (self.fate)(self.frames) {
            Fate::Passes => self.mcu.write(bytes),
            Fate::Lost => Ok(()),
            Fate::Twice => self.mcu.write(&[bytes, bytes].concat()),
            Fate::Damaged => {
                let mut bytes = bytes.to_vec();
                bytes[50] ^= 4;
                self.mcu.write(&bytes)
            }
        }
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if self.is_out() { Ok(0) } else { self.mcu.read(buffer, timeout) }
    }

    fn is_out(&self) -> bool {
        self.out_after.is_some_and(|after| self.frames >= after)
    }
}

fn in_process(pacing: Pacing) -> Box<dyn Mcu> {
    Box::new(InProcess::new(Rig::new(RigConfig::thesis_horizontal()).unwrap().shared(), pacing))
}

fn watched(robot: &WatchedRobot, line: Line) -> Watched {
    let mut session = Session::open(Client::new(Box::new(line))).unwrap();
    session.watch_robot(robot, Pace::AsTaken, &mut |_| ()).unwrap()
}

fn here(robot: &WatchedRobot) -> Watched {
    watched(robot, Line::to(in_process(Pacing::LockStep)))
}

fn short() -> WatchedRobot {
    let case = PicksUp { holds_s: Some([12.0, 99.0]), seconds: 15.0, ..PicksUp::default() };
    let (_, input, _) = case.input().unwrap();
    WatchedRobot::new(&input, HAND, &WatchOptions { settle_s: 8.0, ..WatchOptions::default() }).unwrap()
}

#[test]
fn the_firmware_agrees_with_the_watch_and_counts_frames_left_out() {
    let robot = short();
    let firmware = here(&robot);
    assert!(firmware.broken.is_none() && firmware.sent == 7500, "{:?}", firmware.broken);
    let (own, _) = changes::<f32>(&robot);
    assert_eq!((firmware.changes.len(), own.len()), (2, 2), "{:?} {own:?}", firmware.changes);
    for (reported, own) in firmware.changes.iter().zip(&own) {
        let size = reported.size.map(|size| (size.change, size.standard_deviation));
        assert_eq!(
            (reported.found, reported.at, reported.between, size),
            (own.found, own.at, own.between, own.size)
        );
    }
    // A number that is none, one of another robot, and two that were never recorded.
    let mut spoiled = robot.clone();
    let payload = robot.frames[5500].payload.clone();
    let frame = WatchFrame::decode(&payload, robot.links.len(), 2).unwrap();
    let joints: Vec<[f32; 2]> = frame.joints().collect();
    let mut feet: Vec<[f32; 6]> = frame.feet().collect();
    let encoded = |feet: &[[f32; 6]], joints: &[[f32; 2]], number: u32| {
        let mut payload = vec![0; MAX_WATCH_FRAME];
        let n = WatchFrame::encode(number, &frame.imu, feet, joints, &mut payload).unwrap();
        payload.truncate(n);
        NumberedFrame { number, payload }
    };
    spoiled.frames[5700] = encoded(&feet, &joints[1..], 5700);
    feet[1][1] = f32::NAN;
    spoiled.frames[5500] = encoded(&feet, &joints, 5500);
    spoiled.frames.drain(5800..5802);
    // Of those sent one is damaged, two are lost, and one comes twice.
    let fate = |number| match number {
        5600 => Fate::Damaged,
        6001 | 6002 => Fate::Lost,
        6300 => Fate::Twice,
        _ => Fate::Passes,
    };
    let after = watched(&spoiled, Line { fate, ..Line::to(in_process(Pacing::LockStep)) });
    let (frames, stream) = (after.counters.frames, after.counters.watch.stream);
    assert_eq!((frames.not_finite, frames.wrong_links, frames.damaged), (1, 1, 0));
    assert_eq!((stream.lost, stream.repeated, after.lost(), after.counters.bad_frames), (3, 1, 3, 1));
    // A frame of another robot has no number: it is missing in the series, too.
    assert_eq!((frames.missing, frames.absorbed), (3 + 2 + 1, 7500 - 7));
    assert_eq!(after.changes.len(), 2, "{:?}", after.changes);
    let (size, sd) = after.changes[1].size.map(|s| (s.change[0], s.standard_deviation[0])).unwrap();
    assert!((size - 0.5).abs() < 4.0 * sd, "{size} {sd}");
}

#[test]
fn a_port_that_vanishes_ends_the_watch_and_leaves_earlier_changes() {
    let robot = short();
    let line = Line { out_after: Some(7100), ..Line::to(in_process(Pacing::LockStep)) };
    let begun = Instant::now();
    let watched = watched(&robot, line);
    assert!(matches!(watched.broken, Some(SessionError::Link(LinkError::Gone(_)))), "{:?}", watched.broken);
    assert!(begun.elapsed() < Duration::from_secs(60));
    assert_eq!((watched.sent, watched.lost(), watched.changes.len()), (7100, 0, 2));
}

#[test]
fn in_real_time_frames_go_out_when_they_are_due() {
    let mut robot = short();
    robot.frames.truncate(800);
    robot.frames.drain(500..560);
    let mut session = Session::open(Client::new(Box::new(Line::to(in_process(Pacing::LockStep))))).unwrap();
    let begun = Instant::now();
    let pace = Pace::RealTime { rate_hz: RATE_HZ, baud: None };
    let watched = session.watch_robot(&robot, pace, &mut |_| ()).unwrap();
    let took_s = begun.elapsed().as_secs_f64();
    assert!(watched.broken.is_none() && took_s >= 799.0 / RATE_HZ, "{:?} {took_s}", watched.broken);
    let frames = watched.counters.frames;
    assert_eq!((watched.lost(), frames.absorbed, frames.missing), (0, 740, 60));
}

/// A load cell and an IMU that signal samples all the time have not been set up for a watch, which would be
/// faults.
#[test]
fn sensors_that_a_watch_does_not_need_are_left_alone() {
    let robot = short();
    let watched = watched(&robot, Line::to(in_process(Pacing::RealTime)));
    assert!(watched.broken.is_none(), "{:?}", watched.broken);
    assert_eq!((watched.lost(), watched.changes.len()), (0, 2));
}

/// Of the frames that were sent this many are in the hands of nobody at a time.
#[test]
fn few_frames_are_under_way_at_once() {
    struct Counting(Line, Arc<Mutex<[usize; 2]>>);

    impl Transport for Counting {
        fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
            let before = self.0.frames;
            let written = self.0.write(bytes);
            let mut counts = self.1.lock().unwrap();
            let [now, most] = &mut *counts;
            *now = if self.0.frames > before { *now + 1 } else { 0 };
            *most = (*most).max(*now);
            written
        }

        fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
            self.0.read(buffer, timeout)
        }
    }

    let mut robot = short();
    robot.frames.truncate(100);
    let counts = Arc::new(Mutex::new([0; 2]));
    let line = Counting(Line::to(in_process(Pacing::LockStep)), Arc::clone(&counts));
    let mut session = Session::open(Client::new(Box::new(line))).unwrap();
    session.watch_robot(&robot, Pace::AsTaken, &mut |_| ()).unwrap();
    assert_eq!(counts.lock().unwrap()[1], 8);
}

#[cfg(feature = "emulator")]
fn emulated(elf: std::path::PathBuf) -> Box<dyn Mcu> {
    use rigident_sim::runner::{Qemu, QemuOptions};
    let rig = Rig::new(RigConfig::thesis_horizontal()).unwrap().shared();
    Box::new(Qemu::spawn(&QemuOptions { elf, ..QemuOptions::default() }, rig, Pacing::LockStep).unwrap())
}

#[cfg(feature = "emulator")]
#[test]
#[ignore = "needs the emulated board"]
fn the_emulated_board_tells_the_same_to_the_bit() {
    let robot = short();
    let here = here(&robot);
    let there = watched(&robot, Line::to(emulated(rigident_sim::runner::watch_elf())));
    assert!(there.broken.is_none(), "{:?}", there.broken);
    assert_eq!((here.changes.len(), &here.changes), (2, &there.changes));
    assert_eq!((here.counters.watch, here.counters.frames), (there.counters.watch, there.counters.frames));
    assert_eq!((there.lost(), there.counters.overruns), (0, 0));
}

#[cfg(feature = "emulator")]
#[test]
#[ignore = "needs the emulated board"]
fn on_the_emulated_board_the_standard_image_refuses_a_robot_to_watch() {
    let robot = short();
    let line = Line::to(emulated(rigident_sim::runner::firmware_elf()));
    let mut session = Session::open(Client::new(Box::new(line))).unwrap();
    let refused = session.configure(&robot.settings).unwrap_err();
    let LinkError::Refused { code, .. } = refused else { panic!("{refused}") };
    assert_eq!(code, ErrorCode::NotBuiltIn);
}

/// A line whose device says that it changes its rate, and is then not understood at that one.
struct OtherRate {
    line: Line,
    decoder: Decoder,
    answer: Vec<u8>,
    rates: Arc<Mutex<Vec<u32>>>,
}

impl Transport for OtherRate {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        for byte in bytes {
            let Some(Ok(frame)) = self.decoder.push(*byte) else { continue };
            if let Ok(Command::LineRate { .. }) = frame.message() {
                let mut line = [0; MAX_FRAME];
                let done: Answer = Ok(Reply::Done);
                let length = encode(Kind::Answer, frame.sequence, &done, &mut line).unwrap();
                self.answer = line[..length].to_vec();
                return Ok(());
            }
        }
        let understood = self.rates.lock().unwrap().last().is_none_or(|rate| *rate == BAUD);
        if understood { self.line.write(bytes) } else { Ok(()) }
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if self.answer.is_empty() {
            return self.line.read(buffer, timeout);
        }
        let answer = std::mem::take(&mut self.answer);
        buffer[..answer.len()].copy_from_slice(&answer);
        Ok(answer.len())
    }

    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        self.rates.lock().unwrap().push(baud);
        Ok(())
    }
}

#[test]
fn a_rate_at_which_nothing_is_understood_is_reported_and_taken_back() {
    let mut robot = short();
    robot.frames.truncate(10);
    let rates = Arc::new(Mutex::new(Vec::new()));
    let line = OtherRate {
        line: Line::to(in_process(Pacing::LockStep)),
        decoder: Decoder::new(),
        answer: Vec::new(),
        rates: Arc::clone(&rates),
    };
    let mut session = Session::open(Client::new(Box::new(line))).unwrap();
    let pace = Pace::RealTime { rate_hz: RATE_HZ, baud: Some(2_000_000) };
    let refused = session.watch_robot(&robot, pace, &mut |_| ()).unwrap_err();
    assert!(matches!(refused, SessionError::Line(2_000_000, _)), "{refused}");
    assert_eq!(*rates.lock().unwrap(), [2_000_000, BAUD]);
    session.client().is_there(1).unwrap();
}

#[test]
fn firmware_whose_line_has_one_rate_refuses_another() {
    let mut session = Session::open(Client::new(Box::new(Line::to(in_process(Pacing::LockStep))))).unwrap();
    let pace = Pace::RealTime { rate_hz: RATE_HZ, baud: Some(2_000_000) };
    let refused = session.watch_robot(&short(), pace, &mut |_| ()).unwrap_err();
    let SessionError::Link(LinkError::Refused { code, .. }) = refused else { panic!("{refused}") };
    assert_eq!(code, ErrorCode::BadSetting(SettingName::LineRate));
}
