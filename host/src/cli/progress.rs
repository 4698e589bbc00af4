use std::io::{IsTerminal, Write, stderr};
use std::time::{Duration, Instant};

/// One line on standard error that is written over on a terminal, and now and then elsewhere.
///
/// Nothing is shown for work that ends within a second.
pub struct Progress {
    started: Instant,
    last: Option<Instant>,
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
        Self { started: Instant::now(), last: None, terminal: stderr().is_terminal(), width: 0 }
    }

    /// Shows a line if it is time for one; `line` is only called then.
    pub fn show(&mut self, line: impl FnOnce() -> String) {
        let every = if self.terminal { Duration::from_millis(200) } else { Duration::from_secs(5) };
        let due = match self.last {
            None => self.started.elapsed() >= Duration::from_secs(1),
            Some(last) => last.elapsed() >= every,
        };
        if !due {
            return;
        }
        self.last = Some(Instant::now());
        let line = line();
        let mut out = stderr().lock();
        // Progress that cannot be written is no reason to stop the work.
        let _ = if self.terminal {
            let width = line.chars().count();
            let padding = " ".repeat(self.width.saturating_sub(width));
            self.width = width;
            write!(out, "\r{line}{padding}").and_then(|()| out.flush())
        } else {
            writeln!(out, "{line}")
        };
    }

    /// Ends the line, so that other output starts on its own.
    pub fn finish(&mut self) {
        if self.terminal && self.last.is_some() {
            let _ = writeln!(stderr());
        }
        self.last = None;
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}
