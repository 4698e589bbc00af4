//! A program sent as set points at a fixed rate, and what came of it.
//!
//! Whatever ends it early, set points go on until the plate rests, unless the controller has a stop of its own or the line
//! itself is broken.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use hexapod::{Pose, Trajectory};

use super::{Motion, MotionSample, PlatformError};

/// Whoever watches the motion asks often; after so long without, s, the platform is stopped.
pub(super) const UNWATCHED_S: f64 = 2.0;
/// A controller without a stop of its own is led to rest on the path within, s.
const SLOW_S: f64 = 0.35;
/// The last pose is repeated for so long, s.
const TAIL_S: f64 = 0.2;
/// The longest wait for rest after the last point or a stop, s.
const REST_S: f64 = 3.0;
/// A controller that says nothing is given so long to come to rest at the last pose, s.
const SETTLE_S: f64 = 0.3;
/// A gap after which missed points are no longer caught up, s.
pub(super) const GAP_S: f64 = 0.5;

/// When set points are sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Timing {
    /// Points per second.
    pub rate_hz: f64,
    /// Points are sent so long before their time, s: what the network or this machine delays by less does not show. A stop
    /// comes so much later where the controller has none of its own.
    pub lead_s: f64,
}

/// What set points go to: by default a controller that says nothing.
pub(super) trait Sink: Send {
    /// Sends the set point for a time since the beginning, s.
    fn send(&mut self, time_s: f64, pose: &Pose) -> Result<(), PlatformError>;
    /// Whether all is well; where the plate is, if the controller says.
    fn look(&mut self) -> Result<Option<Pose>, PlatformError> {
        Ok(None)
    }
    /// A set point that comes so long after its time ends the motion, s. Whether a controller that says nothing goes by a
    /// line's time or follows as it comes, nobody knows: one that goes by it stands by then.
    fn patience_s(&self) -> f64 {
        0.0
    }
    /// Stops at once; false if the controller has no such command.
    fn halt(&mut self) -> Result<bool, PlatformError> {
        Ok(false)
    }
    /// Whether the plate is at rest; `None` if the controller does not say.
    fn at_rest(&mut self) -> Result<Option<bool>, PlatformError> {
        Ok(None)
    }
}

/// What is known of the plate once nothing more is sent.
#[derive(Clone, Debug, PartialEq)]
enum End {
    /// It rests: the controller says so or, if it says nothing, all lines to rest were sent.
    AtRest,
    /// Nobody knows, and why.
    Unseen(String),
}

#[derive(Debug, Default)]
struct Shared {
    end: Option<End>,
    error: Option<PlatformError>,
    samples: Vec<MotionSample>,
    watched: Option<Instant>,
    /// What was sent last, and for when, s.
    last: Option<(f64, Pose)>,
}

/// A motion under way, in a thread of its own.
pub(super) struct Pace<S> {
    shared: Arc<Mutex<Shared>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<S>>,
}

fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    // A thread that panicked leaves what it had put in: every change is complete.
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<S: Sink + 'static> Pace<S> {
    /// Begins to send `trajectory`, looking `looks_hz` times per second.
    pub(super) fn begin(sink: S, trajectory: Trajectory, timing: Timing, looks_hz: f64) -> Self {
        let shared = Arc::new(Mutex::new(Shared { watched: Some(Instant::now()), ..Shared::default() }));
        let stop = Arc::new(AtomicBool::new(false));
        let run =
            Run { sink, trajectory, timing, looks_hz, shared: Arc::clone(&shared), stop: Arc::clone(&stop) };
        Self { shared, stop, thread: Some(thread::spawn(move || run.run())) }
    }

    /// Asks for a stop.
    pub(super) fn stop(&self) {
        self.stop.store(true, Ordering::Release);
    }

    /// What it is doing. What broke is told once; after that, whether the plate was seen at rest.
    pub(super) fn motion(&self) -> Result<Motion, PlatformError> {
        let mut shared = lock(&self.shared);
        shared.watched = Some(Instant::now());
        if let Some(error) = shared.error.take() {
            return Err(error);
        }
        match &shared.end {
            None => Ok(Motion::Moving),
            Some(End::AtRest) => Ok(Motion::Done),
            Some(End::Unseen(why)) => Err(PlatformError::Unseen(why.clone())),
        }
    }

    /// The last pose sent.
    pub(super) fn last(&self) -> Option<Pose> {
        lock(&self.shared).last.map(|(_, pose)| pose)
    }

    /// What was commanded and measured since the last time.
    pub(super) fn samples(&self) -> Vec<MotionSample> {
        std::mem::take(&mut lock(&self.shared).samples)
    }

    /// Waits for the end; the sink again.
    pub(super) fn end(mut self) -> Option<S> {
        self.stop();
        // A panic there has printed itself.
        self.thread.take().and_then(|thread| thread.join().ok())
    }
}

impl<S> Drop for Pace<S> {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
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
    stop: Arc<AtomicBool>,
}

impl<S: Sink> Run<S> {
    fn run(mut self) -> S {
        let followed = self.follow();
        let led = followed.is_ok();
        if let Err(error) = followed {
            self.note(error);
            // Whatever went wrong, the plate must not go on. If the line is what broke, this fails again.
            let _ = self.sink.halt();
        }
        let end = self.come_to_rest(led);
        lock(&self.shared).end = Some(end);
        self.sink
    }

    /// The first thing that went wrong is the one told.
    fn note(&self, error: PlatformError) {
        lock(&self.shared).error.get_or_insert(error);
    }

    /// Sends every point in time, to the end or to rest on the path.
    ///
    /// # Errors
    /// The line or the controller: nothing more can be sent.
    fn follow(&mut self) -> Result<(), PlatformError> {
        let step_s = 1.0 / self.timing.rate_hz;
        let begun = Instant::now();
        // The program's own time: it goes slower once the plate is led to rest.
        let (mut program_s, mut slowing) = (0.0_f64, None);
        let mut next_look_s = 0.0;
        let mut k = 0_u64;
        loop {
            k += 1;
            let mut time_s = k as f64 * step_s;
            let wait = Duration::from_secs_f64((time_s - self.timing.lead_s).max(0.0))
                .saturating_sub(begun.elapsed());
            thread::sleep(wait);
            let over = slowing.map_or(self.trajectory.duration_s(), |since| since + SLOW_S);
            let late_s = begun.elapsed().as_secs_f64() - time_s;
            let gap = late_s > GAP_S && time_s < over;
            let late = time_s < over && late_s > self.sink.patience_s();
            let cause = if late { Some(PlatformError::Late(late_s)) } else { self.unwatched() };
            let stop = slowing.is_none() && (cause.is_some() || self.stop.load(Ordering::Acquire));
            if let Some(error) = cause.filter(|_| stop || gap) {
                self.note(error);
            }
            if (stop || gap) && self.sink.halt()? {
                return Ok(());
            }
            if gap {
                // No line came for so long: the plate stands at the last pose by now, or near it. Nothing but that is sent.
                k += (late_s / step_s).ceil() as u64;
                time_s = k as f64 * step_s;
                slowing = Some(time_s - SLOW_S);
            } else if stop {
                slowing = Some(time_s);
            }
            let speed = slowing.map_or(1.0, |since| {
                let u = ((time_s - since) / SLOW_S).min(1.0);
                1.0 - u * u * u * (10.0 + u * (6.0 * u - 15.0))
            });
            program_s += speed * step_s;
            let pose = self.trajectory.state(program_s).pose();
            self.sink.send(time_s, &pose)?;
            let now_s = begun.elapsed().as_secs_f64();
            lock(&self.shared).last = Some((time_s, pose));
            if now_s >= next_look_s {
                next_look_s = now_s + 1.0 / self.looks_hz;
                self.sample(begun, slowing.is_some())?;
            }
            let over = slowing.map_or(self.trajectory.duration_s(), |since| since + SLOW_S);
            if time_s >= over + TAIL_S {
                // The last points are still to be driven.
                while begun.elapsed().as_secs_f64() < time_s {
                    self.sample(begun, slowing.is_some())?;
                    thread::sleep(Duration::from_secs_f64(1.0 / self.looks_hz));
                }
                return Ok(());
            }
        }
    }

    fn unwatched(&self) -> Option<PlatformError> {
        let quiet_s = lock(&self.shared).watched.map_or(0.0, |t| t.elapsed().as_secs_f64());
        (quiet_s > UNWATCHED_S).then_some(PlatformError::Unwatched(UNWATCHED_S))
    }

    /// Where the plate should be and is. While it is led to rest the two have no time in common.
    fn sample(&mut self, begun: Instant, slowing: bool) -> Result<(), PlatformError> {
        let asked_s = begun.elapsed().as_secs_f64();
        let measured = self.sink.look()?;
        // The answer was made between question and arrival.
        let time_s = 0.5 * (asked_s + begun.elapsed().as_secs_f64());
        if !slowing {
            let commanded = self.trajectory.state(time_s).pose();
            lock(&self.shared).samples.push(MotionSample { time_s, commanded, measured });
        }
        Ok(())
    }

    /// What becomes of the plate; `led` if points to rest were sent, or the controller was told to stop.
    fn come_to_rest(&mut self, led: bool) -> End {
        let begun = Instant::now();
        while begun.elapsed().as_secs_f64() < REST_S {
            match self.sink.at_rest() {
                Ok(Some(true)) => return End::AtRest,
                Ok(Some(false)) => thread::sleep(Duration::from_millis(20)),
                Ok(None) if led => {
                    // Nothing more can be known: the last points were those of a plate at rest.
                    thread::sleep(Duration::from_secs_f64(SETTLE_S));
                    return End::AtRest;
                }
                Ok(None) => {
                    let last = lock(&self.shared).last;
                    return End::Unseen(match last {
                        Some((time_s, _)) => {
                            format!(
                                "it does not say where the plate is, and got no line after t = {time_s:.2} s"
                            )
                        }
                        None => "it does not say where the plate is, and got no line".to_owned(),
                    });
                }
                Err(error) => {
                    let why = error.to_string();
                    self.note(error);
                    return End::Unseen(why);
                }
            }
        }
        End::Unseen(format!("its controller says that it still moved {REST_S} s after the last set point"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexapod::{Geometry, MotionProgram, Segment};

    /// Takes points, and once takes its time.
    struct Slow {
        sent: Arc<Mutex<Vec<(f64, f64)>>>,
        delay: Duration,
    }

    impl Sink for Slow {
        fn send(&mut self, time_s: f64, pose: &Pose) -> Result<(), PlatformError> {
            let mut sent = self.sent.lock().unwrap();
            sent.push((time_s, pose.position_m[0]));
            if sent.len() == 60 {
                thread::sleep(self.delay);
            }
            Ok(())
        }
    }

    type Told = Vec<Result<Motion, PlatformError>>;

    /// The points of a move of 0.1 m in 2 s, one of which took so long, s, with a lead of 0.3 s; what was told.
    fn driven(delay_s: f64) -> (Vec<(f64, f64)>, Told) {
        let home = Geometry::thesis().home();
        let mut to = home;
        to.position_m[0] += 0.1;
        let program = MotionProgram { start: home, segments: vec![Segment::Move { to, duration_s: 2.0 }] };
        let sent = Arc::default();
        let sink = Slow { sent: Arc::clone(&sent), delay: Duration::from_secs_f64(delay_s) };
        let timing = Timing { rate_hz: 100.0, lead_s: 0.3 };
        let pace = Pace::begin(sink, program.trajectory().unwrap(), timing, 20.0);
        let mut told = Vec::new();
        while told.last() != Some(&Ok(Motion::Done)) {
            let now = pace.motion();
            if now != Ok(Motion::Moving) {
                told.push(now);
            }
            thread::sleep(Duration::from_millis(5));
        }
        let sent = sent.lock().unwrap().clone();
        (sent, told)
    }

    #[test]
    fn what_comes_after_its_time_ends_the_motion_on_its_path_and_after_a_gap_nothing_moves_any_more() {
        // A seventh of a second after its time: led to rest further on.
        let (sent, told) = driven(0.45);
        assert!(
            matches!(told.as_slice(), [Err(PlatformError::Late(late)), Ok(_)] if *late > 0.1),
            "{told:?}"
        );
        let end = sent.last().unwrap().1;
        assert!(sent[59].1 + 1e-3 < end && end < 0.099, "{end}");
        assert!(sent[sent.len() - 10..].iter().all(|point| point.1 == end), "it ends at rest");
        // Two seconds: the plate has been at the last point for long.
        let (sent, told) = driven(2.0);
        assert!(
            matches!(told.as_slice(), [Err(PlatformError::Late(late)), Ok(_)] if *late > 1.0),
            "{told:?}"
        );
        assert!(
            sent.len() > 70 && sent[60..].iter().all(|point| (point.1 - sent[59].1).abs() < 1e-12),
            "{:?}",
            &sent[58..]
        );
        assert!(sent[60].0 > sent[59].0 + 1.0, "and is told so for times to come");
    }
}
