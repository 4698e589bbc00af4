//! A program sent as set points at a fixed rate, and what came of it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rigident_sim::platform::{Pose, Trajectory};

use super::{Motion, MotionSample, PlatformError};

/// Whoever watches the motion asks often; after so long without, s, the platform is stopped.
const UNWATCHED_S: f64 = 2.0;
/// A controller without a stop of its own is led to rest on the path within, s.
const SLOW_S: f64 = 0.5;
/// The last pose is repeated for so long, s.
const TAIL_S: f64 = 0.2;
/// The longest wait for rest after the last point or a stop, s.
const REST_S: f64 = 3.0;
/// A gap after which missed points are no longer caught up, s.
const GAP_S: f64 = 0.5;

/// When set points are sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Timing {
    /// Points per second.
    pub rate_hz: f64,
    /// Points are sent so long before their time, s: what the network or this machine delays by less does not show. A stop
    /// comes so much later where the controller has none of its own.
    pub lead_s: f64,
}

/// What set points go to.
pub(super) trait Sink: Send {
    /// Sends the set point for a time since the beginning, s.
    fn send(&mut self, time_s: f64, pose: &Pose) -> Result<(), PlatformError>;
    /// Whether all is well; where the plate is, if the controller says.
    fn look(&mut self) -> Result<Option<Pose>, PlatformError>;
    /// Stops at once; false if the controller has no such command.
    fn halt(&mut self) -> Result<bool, PlatformError>;
    /// Whether the plate is at rest; `None` if the controller does not say.
    fn at_rest(&mut self) -> Result<Option<bool>, PlatformError>;
}

#[derive(Debug, Default)]
struct Shared {
    done: bool,
    at_rest: bool,
    error: Option<PlatformError>,
    samples: Vec<MotionSample>,
    watched: Option<Instant>,
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
        match shared.error.take() {
            Some(error) => Err(error),
            None if shared.done && shared.at_rest => Ok(Motion::Done),
            None => Ok(Motion::Moving),
        }
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
        if let Err(error) = self.follow() {
            lock(&self.shared).error = Some(error);
            // Whatever went wrong, the plate must not go on. If the line is what broke, this fails again.
            let _ = self.sink.halt();
        }
        let at_rest = self.come_to_rest();
        let mut shared = lock(&self.shared);
        (shared.done, shared.at_rest) = (true, at_rest);
        drop(shared);
        self.sink
    }

    /// Sends every point in time, to the end or a stop.
    fn follow(&mut self) -> Result<(), PlatformError> {
        let step_s = 1.0 / self.timing.rate_hz;
        let begun = Instant::now();
        // The program's own time: it goes slower once the plate is led to rest.
        let (mut program_s, mut slowing) = (0.0_f64, None);
        let mut next_look_s = 0.0;
        for k in 1_u64.. {
            let time_s = k as f64 * step_s;
            let wait = Duration::from_secs_f64((time_s - self.timing.lead_s).max(0.0))
                .saturating_sub(begun.elapsed());
            thread::sleep(wait);
            if begun.elapsed().as_secs_f64() > time_s + GAP_S {
                return Err(PlatformError::Unwatched(GAP_S));
            }
            self.watch()?;
            if slowing.is_none() && self.stop.load(Ordering::Acquire) {
                if self.sink.halt()? {
                    return Ok(());
                }
                slowing = Some(time_s);
            }
            let speed = slowing.map_or(1.0, |since| {
                let u = ((time_s - since) / SLOW_S).min(1.0);
                1.0 - u * u * u * (10.0 + u * (6.0 * u - 15.0))
            });
            program_s += speed * step_s;
            self.sink.send(time_s, &self.trajectory.state(program_s).pose())?;
            let now_s = begun.elapsed().as_secs_f64();
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
        Ok(())
    }

    fn watch(&self) -> Result<(), PlatformError> {
        let quiet = lock(&self.shared).watched.is_some_and(|t| t.elapsed().as_secs_f64() > UNWATCHED_S);
        if quiet { Err(PlatformError::Unwatched(UNWATCHED_S)) } else { Ok(()) }
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

    fn come_to_rest(&mut self) -> bool {
        let begun = Instant::now();
        while begun.elapsed().as_secs_f64() < REST_S {
            match self.sink.at_rest() {
                Ok(Some(true)) => return true,
                Ok(Some(false)) => thread::sleep(Duration::from_millis(20)),
                // Nothing more can be known: the last points were those of a plate at rest.
                Ok(None) => return lock(&self.shared).error.is_none(),
                Err(error) => {
                    let mut shared = lock(&self.shared);
                    shared.error.get_or_insert(error);
                    return false;
                }
            }
        }
        false
    }
}
