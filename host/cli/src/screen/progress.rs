use std::io::{IsTerminal, stderr};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rigident_shared::printable;

use crate::kept;
use crate::screen::{tell, worded};
use rigident::application::Caller;

/// False in a browser, whose page shows the lines as they come.
const HAS_THREADS: bool = cfg!(not(target_family = "wasm"));

/// One line on standard error that is written over on a terminal, and now and then elsewhere.
///
/// Nothing is shown for work that ends within a second, and of a command that a program called.
pub struct Progress {
    started: Instant,
    last: Option<Instant>,
    called: bool,
    terminal: bool,
    width: usize,
}

impl Default for Progress {
    fn default() -> Self {
        Self::new()
    }
}

impl Progress {
    /// Starts the clock.
    pub fn new() -> Self {
        Self {
            started: Instant::now(),
            last: None,
            called: kept::is_called(),
            terminal: stderr().is_terminal(),
            width: 0,
        }
    }

    /// Shows a line if it is time for one; `line` is only called then.
    pub fn show(&mut self, line: impl FnOnce() -> String) {
        let every =
            if self.terminal || !HAS_THREADS { Duration::from_millis(200) } else { Duration::from_secs(5) };
        let due = match self.last {
            None => !HAS_THREADS || self.started.elapsed() >= Duration::from_secs(1),
            Some(last) => last.elapsed() >= every,
        };
        if self.called || !due {
            return;
        }
        self.last = Some(Instant::now());
        let line = printable::line(&line()).to_string();
        let shown = if self.terminal {
            let width = line.chars().count();
            let padding = " ".repeat(self.width.saturating_sub(width));
            self.width = width;
            format!("\r{line}{padding}")
        } else {
            format!("{line}\n")
        };
        // Progress that cannot be written is no reason to stop the work.
        let _ = tell::write(&shown);
    }

    /// Ends the line, so that other output starts on its own.
    pub fn finish(&mut self) {
        if self.terminal && self.last.is_some() {
            let _ = tell::write("\n");
        }
        self.last = None;
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}

/// The interval between checks of the stage.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Shows what is being done, how much of it, and for how long, from a thread of its own while the work goes
/// on.
pub(crate) struct Stages {
    stage: Arc<Mutex<(String, f64)>>,
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
    /// Shows each stage as it begins where there are no threads.
    shown: Option<Mutex<Progress>>,
}

impl Stages {
    /// Starts the clock.
    pub(crate) fn new(stage: &str) -> Self {
        if kept::is_called() {
            return Self::silent();
        }
        if !HAS_THREADS {
            let mut stages = Self::silent();
            stages.shown = Some(Mutex::new(Progress::new()));
            stages.at(stage, 0.0);
            return stages;
        }
        let stage = Arc::new(Mutex::new((stage.to_owned(), 0.0)));
        let (end, ended) = channel();
        let seen = Arc::clone(&stage);
        let thread = std::thread::spawn(move || {
            let (started, mut progress) = (Instant::now(), Progress::new());
            while ended.recv_timeout(LOOK_EVERY) == Err(RecvTimeoutError::Timeout) {
                progress.show(|| {
                    let (stage, share) = seen.lock().unwrap_or_else(PoisonError::into_inner).clone();
                    line(&stage, share, started.elapsed())
                });
            }
        });
        Self { stage, end: Some(end), thread: Some(thread), shown: None }
    }

    /// Shows nothing: for work beside other work, or while the terminal is another's.
    pub(crate) fn silent() -> Self {
        Self { stage: Arc::default(), end: None, thread: None, shown: None }
    }

    /// Returns the caller of a job of the application, whose progress this shows.
    pub(crate) fn caller(&self) -> Caller<'_> {
        Caller::new(self).worded_by(worded::notice)
    }

    /// States what is being done now, and what share of it is done; zero: that is not known. A called command
    /// ends here if it is to.
    pub(crate) fn at(&self, stage: &str, share: f64) {
        kept::stop_if_asked();
        if let Some(shown) = &self.shown {
            let mut shown = shown.lock().unwrap_or_else(PoisonError::into_inner);
            let elapsed = shown.started.elapsed();
            shown.show(|| line(stage, share, elapsed));
        }
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = (stage.to_owned(), share);
    }
}

impl rigident_fit::Progress for Stages {
    fn stage(&self, name: &str, share: f64) {
        self.at(name, share);
    }
}

impl Drop for Stages {
    fn drop(&mut self) {
        drop(self.end.take());
        // A thread that failed has shown what it could.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn line(stage: &str, share: f64, elapsed: Duration) -> String {
    let done = if share > 0.0 { format!(" {:.0} %", 100.0 * share) } else { String::new() };
    format!("{stage}{done}, {:.0} s", elapsed.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_names_the_stage_its_share_and_its_time() {
        let elapsed = Duration::from_millis(12_300);
        assert_eq!(line("rows of frames", 0.43, elapsed), "rows of frames 43 %, 12 s");
        assert_eq!(line("reading panda.csv", 0.0, elapsed), "reading panda.csv, 12 s");
        // It ends at once, whatever it was at.
        let started = Instant::now();
        let stages = Stages::new("one");
        stages.at("two", 0.5);
        drop(stages);
        assert!(started.elapsed() < Duration::from_secs(1));
    }
}
