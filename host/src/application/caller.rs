//! The caller of a job: sees its progress, may stop it, and words what is noticed.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, ThreadId};

use super::{Error, Notice};
use rigident_fit::{Progress, Silent};

/// Carried by the unwinding of a job that is to stop.
struct Stopped;

/// The functions that a job needs of its caller. By default nothing is shown, nothing stops it, and remedies
/// are worded for users of this library.
#[derive(Clone, Copy)]
pub struct Caller<'a> {
    progress: &'a (dyn Progress + Sync),
    stop: Option<&'a AtomicBool>,
    wording: fn(&Notice) -> String,
    /// Only the thread that a job was called in is unwound.
    thread: ThreadId,
}

impl Default for Caller<'_> {
    fn default() -> Self {
        Self { progress: &Silent, stop: None, wording: Notice::to_string, thread: thread::current().id() }
    }
}

impl fmt::Debug for Caller<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Caller").field("stop", &self.stop).finish_non_exhaustive()
    }
}

impl<'a> Caller<'a> {
    /// Returns a caller that sees stages: their names, and their shares done, 0 to 1 (zero where that is not
    /// known).
    pub fn new(progress: &'a (dyn Progress + Sync)) -> Self {
        Self { progress, ..Self::default() }
    }

    /// Returns the same caller with a token: where it becomes true the job ends at its next stage with
    /// [`Error::Stopped`].
    #[must_use]
    pub fn stopped_by(self, stop: &'a AtomicBool) -> Self {
        Self { stop: Some(stop), ..self }
    }

    /// Returns the same caller with words of its own for what is noticed.
    #[must_use]
    pub fn worded_by(self, wording: fn(&Notice) -> String) -> Self {
        Self { wording, ..self }
    }

    /// Words what was noticed.
    pub(super) fn words(&self, notice: &Notice) -> String {
        (self.wording)(notice)
    }

    /// Does a job that ends at a stage where the caller stops it.
    pub(super) fn stoppable<T>(&self, job: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
        match catch_unwind(AssertUnwindSafe(job)) {
            Ok(ended) => ended,
            Err(panic) if panic.is::<Stopped>() => Err(Error::Stopped),
            Err(panic) => resume_unwind(panic),
        }
    }
}

impl Progress for Caller<'_> {
    fn stage(&self, name: &str, share: f64) {
        self.progress.stage(name, share);
        let is_stopped = self.stop.is_some_and(|stop| stop.load(Ordering::Relaxed));
        if is_stopped && thread::current().id() == self.thread {
            resume_unwind(Box::new(Stopped));
        }
    }
}
