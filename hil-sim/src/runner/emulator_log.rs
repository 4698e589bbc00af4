//! The emulated firmware's log: defmt frames on the emulator's standard output.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Lines stored for an error message.
const KEPT: usize = 50;

/// One line the firmware logged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// `error`, `warn`, `info`, `debug` or `trace`.
    pub level: &'static str,
    /// The text of the line.
    pub message: String,
}

/// The last lines, shared between the thread that decodes and whoever reports an error.
#[derive(Default)]
pub(super) struct Log(Mutex<VecDeque<LogLine>>);

impl Log {
    fn lines(&self) -> MutexGuard<'_, VecDeque<LogLine>> {
        // A reader cannot leave the queue half changed.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn push(&self, line: LogLine) {
        let mut lines = self.lines();
        if lines.len() == KEPT {
            lines.pop_front();
        }
        lines.push_back(line);
    }

    /// Adds an error of our own.
    pub(super) fn error(&self, message: String) {
        self.push(LogLine { level: "error", message });
    }

    /// Returns the last `n` lines, oldest first.
    pub(super) fn last(&self, n: usize) -> Vec<LogLine> {
        let lines = self.lines();
        lines.iter().skip(lines.len().saturating_sub(n)).cloned().collect()
    }
}
