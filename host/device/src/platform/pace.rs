//! A program sent as set points at a fixed rate, and its result.
//!
//! If it ends early for any reason, set points go on until the plate rests, unless the controller has a stop
//! of its own or the line itself is broken. No point follows the one before sooner than a share of their
//! interval ([`Follows::closest`]), so that a host that stood still makes up for it with no burst: a
//! controller that may take points as they come never moves faster than the path by more than a twentieth.

use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

use hexapod::{Pose, Trajectory};

use super::clock::Clock;
use super::{Motion, MotionSample, PlatformError, Stop};

/// The time without a question by the watcher of a motion, s, after which the platform is stopped.
pub(super) const UNWATCHED_S: f64 = 2.0;
/// The plate is led to rest on its path within, s.
pub(super) const SLOW_S: f64 = 0.35;
/// The last pose is repeated for this long, s.
const TAIL_S: f64 = 0.2;
/// The longest wait for rest after the last point or a stop, s.
const REST_S: f64 = 3.0;
/// A plate that still moves this long after a smooth stop is stopped abruptly, s.
const ABRUPT_S: f64 = 0.5;
/// A plate that still moves this long after its last point is stopped, s.
const LINGER_S: f64 = 1.5;
/// A controller that says nothing is given this long to come to rest at the last pose, s.
const SETTLE_S: f64 = 0.3;
/// A gap after which the motion does not go on, s.
pub(super) const GAP_S: f64 = 0.5;
/// The shortest time between two points, as a share of their interval, where the controller may take them as
/// they come: what sleep makes late is caught up, and no more at once.
const CLOSEST: f64 = 0.95;
/// The shortest time between two points, as a share of their interval, where the controller is known to have
/// a clock of its own: its buffer is filled again.
const CLOSEST_OF_TIME: f64 = 0.25;
/// A controller that follows lines as they come stands still after a pause of more intervals than this.
const STANDS: f64 = 3.0;

/// The reference that a controller follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Follows {
    /// Nobody has said.
    Unknown,
    /// The controller goes by the time of each point, or by an interval of its own.
    Time,
    /// The controller goes to each point as it comes.
    Arrival,
}

impl Follows {
    /// Returns the shortest time between two points, as a share of their interval.
    fn closest(self) -> f64 {
        if self == Self::Time { CLOSEST_OF_TIME } else { CLOSEST }
    }
}

/// The time at which set points are sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Timing {
    /// Points per second.
    pub rate_hz: f64,
    /// Points are sent this long before their time, s: what the network or this machine delays by less does
    /// not show. A stop comes this much later where the controller has none of its own. It is nothing where
    /// points are followed as they come.
    pub lead_s: f64,
    /// The reference that the controller follows.
    pub follows: Follows,
}

/// The destination of set points: by default a controller that says nothing.
pub(super) trait Sink: Send {
    /// Sends the set point for a time since the beginning, s.
    fn send(&mut self, time_s: f64, pose: &Pose) -> Result<(), PlatformError>;
    /// Returns whether all is well; where the plate is, if the controller says.
    fn look(&mut self) -> Result<Option<Pose>, PlatformError> {
        Ok(None)
    }
    /// Returns the time after which a late set point ends the motion, s. Whether a controller that says
    /// nothing goes by a line's time or follows as it comes, nobody knows: one that goes by it rests by then.
    fn patience_s(&self) -> f64 {
        0.0
    }
    /// Stops as fast as is smooth. Returns false if the controller has no such command.
    fn halt(&mut self) -> Result<bool, PlatformError> {
        Ok(false)
    }
    /// Stops abruptly what a smooth stop has not stopped.
    fn halt_abruptly(&mut self) -> Result<(), PlatformError> {
        Ok(())
    }
    /// Returns whether the plate is at rest; `None` if the controller does not say.
    fn at_rest(&mut self) -> Result<Option<bool>, PlatformError> {
        Ok(None)
    }
}

/// Checks until the plate rests, for a few seconds at most; `None` if the controller does not say. A plate
/// that goes on is stopped: smoothly after its last point, abruptly after a smooth stop, `halted`.
///
/// # Errors
/// No answer; the abrupt stop was sent all the same.
pub(super) fn rest(clock: &Clock, sink: &mut impl Sink, halted: bool) -> Result<Option<bool>, PlatformError> {
    let begun_s = clock.now_s();
    let mut halted_s = halted.then_some(0.0);
    let mut abrupt = false;
    loop {
        match sink.at_rest() {
            Ok(Some(false)) => {}
            Err(error) if halted_s.is_some() => {
                // Whoever answers no more may still hear.
                let _ = sink.halt_abruptly();
                return Err(error);
            }
            said => return said,
        }
        let now_s = clock.now_s() - begun_s;
        match halted_s {
            None if now_s > LINGER_S => {
                sink.halt()?;
                halted_s = Some(now_s);
            }
            Some(since_s) if !abrupt && now_s > since_s + ABRUPT_S => {
                abrupt = true;
                sink.halt_abruptly()?;
            }
            _ if now_s > REST_S => return Ok(Some(false)),
            _ => {}
        }
        clock.wait_s(0.02);
    }
}

/// The knowledge of the plate once nothing more is sent.
#[derive(Clone, Debug, PartialEq)]
enum End {
    /// The plate rests: the controller says so or, if it says nothing, all lines to rest were sent.
    AtRest,
    /// Nobody knows, and why.
    Unseen(String),
}

#[derive(Debug, Default)]
struct Shared {
    end: Option<End>,
    error: Option<PlatformError>,
    samples: Vec<MotionSample>,
    /// The time when somebody last asked, s of the clock.
    watched_s: f64,
    /// The point sent last, and its time, s.
    last: Option<(f64, Pose)>,
}

/// A motion under way, in a thread of its own.
pub(super) struct Pace<S> {
    shared: Arc<Mutex<Shared>>,
    stop: Asked,
    clock: Clock,
    work: Work<S>,
}

/// The place where a motion is driven.
enum Work<S> {
    Thread(JoinHandle<S>),
    /// The motion is over: in a simulation it was driven by whoever began it.
    Over(Box<S>),
    Taken,
}

/// A simulated watcher's hold on a motion.
#[derive(Clone)]
pub struct Watch {
    shared: Arc<Mutex<Shared>>,
    stop: Asked,
}

impl Watch {
    /// Asks for a stop.
    pub fn stop(&self, stop: Stop) {
        self.stop.ask(stop);
    }

    /// Notes that somebody watches, at a time of the clock, s; returns whether all is well so far.
    pub fn looks(&self, now_s: f64) -> bool {
        let mut shared = lock(&self.shared);
        shared.watched_s = now_s;
        shared.error.is_none()
    }
}

/// The stop that was asked for, if any.
#[derive(Clone, Default)]
struct Asked(Arc<AtomicU8>);

impl Asked {
    /// Asks for a stop; an alarm stays one.
    fn ask(&self, stop: Stop) {
        let number = match stop {
            Stop::Planned => 1,
            Stop::Alarm => 2,
        };
        self.0.fetch_max(number, Ordering::AcqRel);
    }

    fn get(&self) -> Option<Stop> {
        match self.0.load(Ordering::Acquire) {
            0 => None,
            1 => Some(Stop::Planned),
            _ => Some(Stop::Alarm),
        }
    }
}

fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    // A thread that panicked leaves what it had put in: every change is complete.
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<S: Sink + 'static> Pace<S> {
    /// Begins to send `trajectory`, checking `looks_hz` times per second.
    pub(super) fn begin(
        sink: S,
        trajectory: Trajectory,
        timing: Timing,
        looks_hz: f64,
        clock: &Clock,
    ) -> Self {
        let shared = Arc::new(Mutex::new(Shared { watched_s: clock.now_s(), ..Shared::default() }));
        let stop = Asked::default();
        let course = Course { program_s: 0.0, resumed_s: f64::NEG_INFINITY, slowing_s: None, alarmed: false };
        let (own, asked) = (Arc::clone(&shared), stop.clone());
        let clock = clock.clone();
        let run = Run {
            sink,
            trajectory,
            timing,
            looks_hz,
            shared: own,
            stop: asked,
            course,
            clock: clock.clone(),
        };
        let work = match &clock {
            Clock::Machine(_) => Work::Thread(thread::spawn(move || run.run())),
            Clock::Simulated(world) => {
                world.begins(Watch { shared: Arc::clone(&shared), stop: stop.clone() });
                Work::Over(Box::new(run.run()))
            }
        };
        Self { shared, stop, clock, work }
    }

    /// Asks for a stop.
    pub(super) fn stop(&self, stop: Stop) {
        self.stop.ask(stop);
    }

    /// Returns what it is doing. What broke is reported once; after that, whether the plate was seen at rest.
    pub(super) fn motion(&self) -> Result<Motion, PlatformError> {
        let mut shared = lock(&self.shared);
        shared.watched_s = self.clock.now_s();
        if let Some(error) = shared.error.take() {
            return Err(error);
        }
        match &shared.end {
            None => Ok(Motion::Moving),
            Some(End::AtRest) => Ok(Motion::Done),
            Some(End::Unseen(why)) => Err(PlatformError::Unseen(why.clone())),
        }
    }

    /// Returns the last pose sent.
    pub(super) fn last(&self) -> Option<Pose> {
        lock(&self.shared).last.map(|(_, pose)| pose)
    }

    /// Returns what was commanded and measured since the last time.
    pub(super) fn samples(&self) -> Vec<MotionSample> {
        std::mem::take(&mut lock(&self.shared).samples)
    }

    /// Waits for the end; the sink again.
    pub(super) fn end(mut self) -> Option<S> {
        self.stop(Stop::Alarm);
        match std::mem::replace(&mut self.work, Work::Taken) {
            // A panic there has printed itself.
            Work::Thread(thread) => thread.join().ok(),
            Work::Over(sink) => Some(*sink),
            Work::Taken => None,
        }
    }
}

impl<S> Drop for Pace<S> {
    fn drop(&mut self) {
        self.stop.ask(Stop::Alarm);
        if let Work::Thread(thread) = std::mem::replace(&mut self.work, Work::Taken) {
            // A panic there has printed itself.
            let _ = thread.join();
        }
    }
}

struct Run<S> {
    sink: S,
    trajectory: Trajectory,
    timing: Timing,
    looks_hz: f64,
    shared: Arc<Mutex<Shared>>,
    stop: Asked,
    course: Course,
    clock: Clock,
}

/// The place of the plate on its path.
struct Course {
    /// The program's own time, s: it goes slower once the plate is led to rest, or where it rested.
    program_s: f64,
    /// The time when the plate set off again after it rested, s.
    resumed_s: f64,
    /// Since when the plate is led to rest, s.
    slowing_s: Option<f64>,
    /// True if it was not the plan that ended it.
    alarmed: bool,
}

impl Course {
    /// Returns when all points to rest are sent but the last one repeated, s; `at_s` is now, of a trajectory
    /// of this length.
    fn over_s(&self, at_s: f64, duration_s: f64) -> f64 {
        self.slowing_s.map_or(at_s + duration_s - self.program_s, |since_s| since_s + SLOW_S)
    }

    /// Returns how fast the program's time goes: it grows and falls as a quintic.
    fn speed(&self, time_s: f64) -> f64 {
        let grown = |since_s: f64| {
            let u = ((time_s - since_s) / SLOW_S).clamp(0.0, 1.0);
            u * u * u * (10.0 + u * (6.0 * u - 15.0))
        };
        grown(self.resumed_s) * self.slowing_s.map_or(1.0, |since_s| 1.0 - grown(since_s))
    }
}

/// The end of the sending of points.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Ended {
    /// All points to rest were sent.
    Sent,
    /// The controller was commanded to stop.
    Halted,
    /// Neither could be done.
    Broken,
}

impl<S: Sink> Run<S> {
    fn run(mut self) -> S {
        let ended = self.follow().unwrap_or_else(|error| {
            self.note(error);
            // Whatever went wrong, the plate must not go on. If the line is what broke, this fails again.
            if self.sink.halt() == Ok(true) { Ended::Halted } else { Ended::Broken }
        });
        let end = self.come_to_rest(ended);
        lock(&self.shared).end = Some(end);
        self.sink
    }

    /// Notes an error: the first thing that went wrong is the one reported.
    fn note(&self, error: PlatformError) {
        lock(&self.shared).error.get_or_insert(error);
    }

    /// Sends every point in time, to the end or to rest on the path.
    ///
    /// # Errors
    /// The line or the controller: nothing more can be sent.
    fn follow(&mut self) -> Result<Ended, PlatformError> {
        let step_s = 1.0 / self.timing.rate_hz;
        let by_arrival = self.timing.follows == Follows::Arrival;
        let closest_s = self.timing.follows.closest() * step_s;
        let lead_s = if by_arrival { 0.0 } else { self.timing.lead_s };
        let begun_s = self.clock.now_s();
        let duration_s = self.trajectory.duration_s();
        let (mut sent_s, mut next_look_s, mut stretched_s) = (f64::NEG_INFINITY, 0.0, 0.0);
        let mut k = 0_u64;
        loop {
            k += 1;
            let mut time_s = k as f64 * step_s;
            // Points before the program's own beginning fill the controller's buffer at once.
            let soonest_s = if time_s > lead_s { sent_s + closest_s } else { 0.0 };
            let due_s = (time_s + stretched_s - lead_s).max(soonest_s);
            self.clock.wait_until(begun_s + due_s);
            let late_s = self.clock.now_s() - begun_s - time_s - stretched_s;
            if self.ends(time_s, late_s, time_s < self.course.over_s(time_s, duration_s))? {
                return Ok(Ended::Halted);
            }
            if late_s > GAP_S && time_s < self.course.over_s(time_s, duration_s) {
                // No line arrived for this long: the plate is at the last pose by now, or near it. Nothing
                // but that is sent.
                k += (late_s / step_s).ceil() as u64;
                time_s = k as f64 * step_s;
                self.course.slowing_s = Some(time_s - SLOW_S);
            } else if by_arrival && late_s > STANDS * step_s {
                // It is at the last point, and sets off from there.
                stretched_s += late_s;
                self.course.resumed_s = time_s - step_s;
            }
            self.course.program_s += self.course.speed(time_s) * step_s;
            let pose = self.trajectory.state(self.course.program_s).pose();
            self.sink.send(time_s, &pose)?;
            sent_s = self.clock.now_s() - begun_s;
            lock(&self.shared).last = Some((time_s, pose));
            if sent_s >= next_look_s {
                next_look_s = sent_s + 1.0 / self.looks_hz;
                self.sample(begun_s)?;
            }
            if time_s >= self.course.over_s(time_s, duration_s) + TAIL_S {
                // The last points are still to be driven.
                while self.clock.now_s() - begun_s < time_s {
                    self.sample(begun_s)?;
                    self.clock.wait_s(1.0 / self.looks_hz);
                }
                return Ok(Ended::Sent);
            }
        }
    }

    /// Returns whether the controller was commanded to stop now; where it has no stop, or the plan ends here,
    /// the plate is led to rest from now on.
    ///
    /// # Errors
    /// The line.
    fn ends(&mut self, time_s: f64, late_s: f64, moves: bool) -> Result<bool, PlatformError> {
        let patience_s = if self.timing.follows == Follows::Arrival { GAP_S } else { self.sink.patience_s() };
        let late = moves && late_s > patience_s;
        let cause = if late { Some(PlatformError::Late(late_s)) } else { self.unwatched() };
        let asked = self.stop.get();
        let alarm = cause.is_some() || asked == Some(Stop::Alarm);
        if alarm && !self.course.alarmed {
            self.course.alarmed = true;
            if let Some(error) = cause {
                self.note(error);
            }
            if self.sink.halt()? {
                return Ok(true);
            }
        }
        if alarm || asked.is_some() {
            self.course.slowing_s.get_or_insert(time_s);
        }
        Ok(false)
    }

    fn unwatched(&self) -> Option<PlatformError> {
        let quiet_s = self.clock.now_s() - lock(&self.shared).watched_s;
        (quiet_s > UNWATCHED_S).then_some(PlatformError::Unwatched(UNWATCHED_S))
    }

    /// Returns where the plate should be and is. While it is led to rest the two have no time in common.
    fn sample(&mut self, begun_s: f64) -> Result<(), PlatformError> {
        let asked_s = self.clock.now_s() - begun_s;
        let measured = self.sink.look()?;
        // The answer was made between question and arrival.
        let time_s = 0.5 * (asked_s + self.clock.now_s() - begun_s);
        if self.course.slowing_s.is_none() {
            let at_s = if self.timing.follows == Follows::Arrival { self.course.program_s } else { time_s };
            let commanded = self.trajectory.state(at_s).pose();
            lock(&self.shared).samples.push(MotionSample { time_s, commanded, measured });
        }
        Ok(())
    }

    /// Returns what becomes of the plate.
    fn come_to_rest(&mut self, ended: Ended) -> End {
        match rest(&self.clock, &mut self.sink, ended == Ended::Halted) {
            Ok(Some(true)) => End::AtRest,
            Ok(Some(false)) => End::Unseen(format!(
                "its controller says that it still moved {REST_S} s after the last set point, though it was \
                 commanded to stop"
            )),
            Ok(None) if ended != Ended::Broken => {
                // Nothing more can be known: the last points were those of a plate at rest.
                self.clock.wait_s(SETTLE_S);
                End::AtRest
            }
            Ok(None) => {
                let got = lock(&self.shared)
                    .last
                    .map_or("no line".to_owned(), |(time_s, _)| format!("no line after t = {time_s:.2} s"));
                End::Unseen(format!("it does not say where the plate is, and got {got}"))
            }
            Err(error) => {
                let why = error.to_string();
                self.note(error);
                End::Unseen(why)
            }
        }
    }
}

#[cfg(test)]
#[path = "pace_tests.rs"]
mod tests;
