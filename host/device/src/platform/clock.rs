//! The time that motions go by: this machine's, or that of a simulation.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::pace::Watch;

/// A simulated world, in which time goes on only while somebody waits: a motion is driven to its end by
/// whoever starts it, and everything else happens while it waits.
pub trait World: Send + Sync {
    /// Returns the time, s.
    fn now_s(&self) -> f64;
    /// Waits until a time, s; it may come back later, as a machine that stood still does.
    fn wait_until(&self, time_s: f64);
    /// Receives that a motion begins; `watch` is its watcher's.
    fn begins(&self, watch: Watch);
}

/// The clock from which the time is read, and by which it is waited.
#[derive(Clone)]
pub(super) enum Clock {
    /// This machine's, since this instant.
    Machine(Instant),
    /// A simulation's.
    Simulated(Arc<dyn World>),
}

impl Clock {
    /// Returns this machine's.
    pub(super) fn of_this_machine() -> Self {
        Self::Machine(Instant::now())
    }

    /// Returns the time, s.
    pub(super) fn now_s(&self) -> f64 {
        match self {
            Self::Machine(begun) => begun.elapsed().as_secs_f64(),
            Self::Simulated(world) => world.now_s(),
        }
    }

    /// Waits until a time, s; not at all for one that is past.
    pub(super) fn wait_until(&self, time_s: f64) {
        match self {
            Self::Machine(begun) => {
                let since = Duration::from_secs_f64(time_s.max(0.0));
                std::thread::sleep(since.saturating_sub(begun.elapsed()));
            }
            Self::Simulated(world) if time_s > world.now_s() => world.wait_until(time_s),
            Self::Simulated(_) => {}
        }
    }

    /// Waits this long, s.
    pub(super) fn wait_s(&self, duration_s: f64) {
        self.wait_until(self.now_s() + duration_s);
    }
}
