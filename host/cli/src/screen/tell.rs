//! Words on standard error.

use std::fmt;
use std::io::Write as _;
use std::sync::{Mutex, PoisonError};

use rigident_io::behind::Behind;
use rigident_shared::printable;

use crate::kept;
use crate::screen::terms::in_own_terms;

/// The thread that writes on standard error while nobody may wait for it.
static BEHIND: Mutex<Option<Behind>> = Mutex::new(None);

/// A guard: while it lives, standard error is written in a thread of its own. A terminal that was stopped
/// (Ctrl-S), or a pipe that nobody reads, then delays nothing that watches a motion. Its end waits for the
/// messages that are still to be shown.
pub(crate) struct WithoutWaiting(());

impl WithoutWaiting {
    /// Begins to write standard error in a thread of its own.
    pub(crate) fn begin() -> Self {
        *BEHIND.lock().unwrap_or_else(PoisonError::into_inner) =
            Some(Behind::new(std::io::stderr(), |_| Ok(())));
        Self(())
    }
}

impl Drop for WithoutWaiting {
    fn drop(&mut self) {
        let behind = BEHIND.lock().unwrap_or_else(PoisonError::into_inner).take();
        // A reader that has gone away is no failure.
        let _ = behind.map(Behind::close);
    }
}

/// Writes on standard error, or has it written.
pub(crate) fn write(text: &str) -> std::io::Result<()> {
    match &mut *BEHIND.lock().unwrap_or_else(PoisonError::into_inner) {
        Some(behind) => behind.write_all(text.as_bytes()),
        None => {
            let mut out = std::io::stderr().lock();
            out.write_all(text.as_bytes()).and_then(|()| out.flush())
        }
    }
}

/// Prints a line on standard error, or keeps it for the program that called the command. A reader that has
/// gone away is no failure, and no reason to stop a platform's program in the middle, as `eprintln!` would by
/// a panic.
macro_rules! tell {
    ($($words:tt)*) => {
        $crate::screen::tell::tell(format_args!($($words)*), "\n")
    };
}

/// Prints words in the terms of the command line, then `end`; characters of names that would steer the
/// terminal are replaced.
pub(crate) fn tell(words: fmt::Arguments<'_>, end: &str) {
    let text = words.to_string();
    let text = in_own_terms(&text);
    let text = printable::lines(&text);
    if !kept::keep_message(format_args!("{text}")) {
        let _ = write(&format!("{text}{end}"));
    }
}
