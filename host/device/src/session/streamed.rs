//! Frames of a robot that is watched, streamed to the device over its link, and the changes that it tells
//! meanwhile.
//!
//! No frame is answered: the device counts what became of them. Firmware in this process or in the emulator
//! takes them as fast as it can, `WINDOW` under way at most; a device that one can buy takes them when they
//! are due, so that its line must be fast enough ([`line_need`]).

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use rigident_shared::wire::frame::MAX_FRAME;
use rigident_shared::wire::{
    ChangeReport, Command, CounterReport, ErrorCode, Kind, LINE_RATE_MS, Reason, Reply, SensorFault,
    StateName, Telemetry, encode_payload,
};

use super::watched::{NumberedFrame, WatchedRobot};
use super::{INTERRUPTED, Session, SessionError};
use crate::link::{BAUD, LinkError};

/// Frames that are under way before the device is asked what it has taken.
const WINDOW: usize = 8;
/// A byte on the line, in bits: with start and stop.
const BYTE_BITS: f64 = 10.0;
/// So long after an answer the device has another rate.
const RATE_CHANGES: Duration = Duration::from_millis(50);
/// The name of the request in messages.
const COUNTERS: &str = "read the counters";

/// Tells how fast frames are sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Frames are sent as fast as they are taken.
    AsTaken,
    /// Each at its time.
    RealTime {
        /// Frames per second.
        rate_hz: f64,
        /// Rate of the line meanwhile, baud; `None`: as it is.
        baud: Option<u32>,
    },
}

/// Returns the bits a second that the line must carry for these frames, at the given rate at most.
pub fn line_need(frames: &[NumberedFrame], rate_hz: f64) -> f64 {
    let mut line = [0; MAX_FRAME];
    let on_line = |frame: &NumberedFrame| encode_payload(Kind::Stream, 0, &frame.payload, &mut line).ok();
    frames.iter().filter_map(on_line).max().map_or(0.0, |bytes| bytes as f64 * BYTE_BITS * rate_hz)
}

/// Holds what a watch has found.
#[derive(Debug, Default)]
pub struct Watched {
    /// Changes: each when it was found, and when it was measured.
    pub changes: Vec<ChangeReport>,
    /// The device's counters when they were last read.
    pub counters: CounterReport,
    /// Frames sent.
    pub sent: u32,
    /// True if it was ended by Ctrl-C.
    pub interrupted: bool,
    /// The failure in the middle, if there was one; what was taken before is here.
    pub broken: Option<SessionError>,
}

impl Watched {
    /// Returns how many of the frames sent the device did not take in, those among them of which it never
    /// heard; zero where it was not asked at the end.
    pub fn lost(&self) -> u32 {
        if self.broken.is_some() { 0 } else { self.sent.saturating_sub(self.counters.frames.frames) }
    }
}

impl Session {
    /// Tells the device a robot, streams its frames and takes the changes until they end.
    ///
    /// # Errors
    /// The error that prevents a start. Anything later is stated in [`Watched::broken`], with what was found
    /// before.
    pub fn watch_robot(
        &mut self,
        robot: &WatchedRobot,
        pace: Pace,
        report: &mut dyn FnMut(&ChangeReport),
    ) -> Result<Watched, SessionError> {
        self.configure(&robot.settings)?;
        for (i, link) in robot.links.iter().enumerate() {
            let command = Command::WatchLink { link: i as u8, settings: *link };
            self.client().ask("tell a link", &command)?;
        }
        let baud = if let Pace::RealTime { baud, .. } = pace { baud } else { None };
        if let Some(baud) = baud {
            self.quicken(baud)?;
        }
        self.start()?;
        let mut watched = Watched::default();
        let outcome = self
            .stream(&robot.frames, pace, &mut watched, report)
            .and_then(|()| self.conclude_watch(baud.is_some(), &mut watched, report));
        watched.broken = outcome.err();
        Ok(watched)
    }

    /// Gives both ends of the line another rate, and both the old one again where they do not understand each
    /// other.
    fn quicken(&mut self, baud: u32) -> Result<(), SessionError> {
        // Twice, before the device goes back by itself.
        const ATTEMPTS: u32 = 2;
        self.client().ask("change the rate of the line", &Command::LineRate { baud })?;
        std::thread::sleep(RATE_CHANGES);
        let refused = |_| SessionError::Line(baud, "this computer's port does not do that rate");
        self.client().set_baud(baud).map_err(refused)?;
        if self.client().is_there(ATTEMPTS).is_err() {
            self.client().set_baud(BAUD)?;
            std::thread::sleep(Duration::from_millis(u64::from(LINE_RATE_MS)));
            return Err(SessionError::Line(baud, "at that rate the two ends do not understand each other"));
        }
        Ok(())
    }

    fn stream(
        &mut self,
        frames: &[NumberedFrame],
        pace: Pace,
        watched: &mut Watched,
        report: &mut dyn FnMut(&ChangeReport),
    ) -> Result<(), SessionError> {
        let begun = Instant::now();
        for (k, frame) in frames.iter().enumerate() {
            match pace {
                Pace::RealTime { rate_hz, .. } => {
                    self.wait_until(begun + Duration::from_secs_f64(f64::from(frame.number) / rate_hz))?;
                }
                Pace::AsTaken if k % WINDOW == 0 => self.read_counters(watched)?,
                Pace::AsTaken => {}
            }
            // Sequence numbers wrap.
            self.client().stream(k as u16, &frame.payload)?;
            watched.sent += 1;
            self.hear(watched, report)?;
            if self.client().is_out() {
                let gone = std::io::Error::from(std::io::ErrorKind::BrokenPipe);
                return Err(LinkError::Gone(gone).into());
            }
            watched.interrupted = INTERRUPTED.load(Ordering::Relaxed);
            if watched.interrupted {
                break;
            }
        }
        Ok(())
    }

    /// Takes what comes until then.
    fn wait_until(&mut self, due: Instant) -> Result<(), SessionError> {
        // A port is listened to for a millisecond at least.
        const LEAST: Duration = Duration::from_millis(2);
        while let Some(left) = due.checked_duration_since(Instant::now()) {
            if left < LEAST {
                std::thread::sleep(left);
            } else {
                self.client().listen(left - LEAST / 2)?;
            }
        }
        Ok(())
    }

    /// Ends the watch before the device misses frames, and asks what became of them.
    fn conclude_watch(
        &mut self,
        quick: bool,
        watched: &mut Watched,
        report: &mut dyn FnMut(&ChangeReport),
    ) -> Result<(), SessionError> {
        match self.client().ask("hold", &Command::Hold) {
            // It has missed them, having waited for this in vain.
            Ok(_) | Err(LinkError::Refused { code: ErrorCode::WrongState(StateName::Fault), .. }) => {}
            Err(error) => return Err(error.into()),
        }
        if quick {
            // A device that holds takes its line back.
            std::thread::sleep(RATE_CHANGES);
            self.client().set_baud(BAUD)?;
        }
        self.read_counters(watched)?;
        self.hear(watched, report).or_else(|error| match error {
            SessionError::Stopped { reason: Reason::Frames(SensorFault::Silent), .. } => Ok(()),
            other => Err(other),
        })
    }

    fn read_counters(&mut self, watched: &mut Watched) -> Result<(), SessionError> {
        match self.client().ask(COUNTERS, &Command::ReadCounters)? {
            Reply::Counters(counters) => watched.counters = counters,
            _ => return Err(LinkError::Nonsense(COUNTERS).into()),
        }
        Ok(())
    }

    /// Takes the changes that were reported.
    fn hear(
        &mut self,
        watched: &mut Watched,
        report: &mut dyn FnMut(&ChangeReport),
    ) -> Result<(), SessionError> {
        while let Some(message) = self.client().next_telemetry() {
            match message {
                Telemetry::Change(change) => {
                    report(&change);
                    watched.changes.push(change);
                }
                Telemetry::State { state: state @ StateName::Fault, reason } => {
                    return Err(SessionError::Stopped { state, reason, advice: super::advice(reason) });
                }
                Telemetry::Announce(_) => {
                    return Err(SessionError::Stopped {
                        state: StateName::Idle,
                        reason: Reason::Boot,
                        advice: "it restarted in the middle of the watch: check its supply",
                    });
                }
                _ => {}
            }
        }
        Ok(())
    }
}
