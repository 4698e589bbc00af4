//! The emulated firmware's log: defmt frames on the emulator's standard output.

use std::collections::VecDeque;
use std::io::{self, Read};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

use defmt_decoder::{DecodeError, Table};

use super::error::RunnerError;

/// Lines kept for an error message.
const KEPT: usize = 50;

/// One line the firmware logged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// `error`, `warn`, `info`, `debug` or `trace`.
    pub level: &'static str,
    /// Its text.
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

    fn push(&self, line: LogLine) {
        let mut lines = self.lines();
        if lines.len() == KEPT {
            lines.pop_front();
        }
        lines.push_back(line);
    }

    /// A line of our own.
    pub(super) fn error(&self, message: String) {
        self.push(LogLine { level: "error", message });
    }

    /// The last `n` lines, oldest first.
    pub(super) fn last(&self, n: usize) -> Vec<LogLine> {
        let lines = self.lines();
        lines.iter().skip(lines.len().saturating_sub(n)).cloned().collect()
    }
}

/// The format strings of a firmware image.
///
/// # Errors
/// [`RunnerError::NotFirmware`] if there are none.
pub(super) fn table(image: &[u8], path: &Path) -> Result<Table, RunnerError> {
    let refuse = |reason: String| RunnerError::NotFirmware { path: path.to_owned(), reason };
    Table::parse(image)
        .map_err(|e| refuse(e.to_string()))?
        .ok_or_else(|| refuse("it has no log table".to_owned()))
}

/// Decodes until the emulator closes its output.
pub(super) fn follow(
    table: &Table,
    output: &mut impl Read,
    log: &Log,
    mut each: impl FnMut(&LogLine),
) -> io::Result<()> {
    let mut decoder = table.new_stream_decoder();
    let mut chunk = [0; 1024];
    loop {
        let n = match output.read(&mut chunk) {
            Ok(0) => return Ok(()),
            Ok(n) => n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(e) => return Err(e),
        };
        decoder.received(&chunk[..n]);
        loop {
            let line = match decoder.decode() {
                Ok(frame) => LogLine {
                    level: frame.level().map_or("print", |level| level.as_str()),
                    message: frame.display_message().to_string(),
                },
                Err(DecodeError::UnexpectedEof) => break,
                Err(DecodeError::Malformed) => {
                    LogLine { level: "error", message: "a log frame that cannot be decoded".to_owned() }
                }
            };
            each(&line);
            log.push(line);
        }
    }
}
