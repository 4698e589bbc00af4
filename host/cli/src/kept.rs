//! The output that a thread stores of a called command that it would print elsewhere, and whether the command
//! is to stop.
#![cfg_attr(
    target_family = "wasm",
    allow(dead_code, reason = "nothing calls a command in a browser's process")
)]

use std::cell::RefCell;
use std::fmt;
use std::ops::Deref;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rigident::device::session::INTERRUPTED;

/// The data of a thread that runs a called command.
pub(crate) struct Kept {
    /// Standard output.
    pub(crate) output: String,
    /// Lines of standard error.
    pub(crate) messages: Vec<String>,
    stop: Arc<AtomicBool>,
}

thread_local! {
    static KEPT: RefCell<Option<Kept>> = const { RefCell::new(None) };
}

/// Carried by the unwinding of a command that is to stop.
pub(crate) struct Stopped;

/// Makes this thread keep its output from now on, until [`end`].
pub(crate) fn begin(stop: Arc<AtomicBool>) {
    KEPT.set(Some(Kept { output: String::new(), messages: Vec::new(), stop }));
}

/// Returns what was stored; this thread prints again.
pub(crate) fn end() -> Option<Kept> {
    KEPT.take()
}

/// Returns true in a thread that runs a called command.
pub(crate) fn is_called() -> bool {
    KEPT.with_borrow(Option::is_some)
}

/// Keeps a line of standard output if this thread runs a called command; returns whether it does.
pub(crate) fn keep(text: &impl fmt::Display) -> bool {
    KEPT.with_borrow_mut(|kept| {
        kept.as_mut().map(|kept| {
            kept.output += &text.to_string();
            kept.output.push('\n');
        })
    })
    .is_some()
}

/// Keeps a line of standard error likewise.
pub(crate) fn keep_message(words: fmt::Arguments<'_>) -> bool {
    KEPT.with_borrow_mut(|kept| {
        kept.as_mut().map(|kept| {
            let line = words.to_string();
            kept.messages.push(line.strip_prefix("rigident: ").unwrap_or(&line).trim().to_owned());
        })
    })
    .is_some()
}

/// Unwinds a called command that is to stop; does nothing elsewhere.
pub(crate) fn stop_if_asked() {
    if KEPT.with_borrow(|kept| kept.as_ref().is_some_and(|kept| kept.stop.load(Ordering::Relaxed))) {
        resume_unwind(Box::new(Stopped));
    }
}

/// The signal to a long search to end with the best so far: Ctrl-C, or the caller of a called command.
pub(crate) enum Stop {
    /// Of this process.
    Process,
    /// Of one call.
    Call(Arc<AtomicBool>),
}

impl Stop {
    /// Returns that of this thread's command.
    pub(crate) fn of_this_command() -> Self {
        KEPT.with_borrow(|kept| {
            kept.as_ref().map_or(Self::Process, |kept| Self::Call(Arc::clone(&kept.stop)))
        })
    }
}

impl Deref for Stop {
    type Target = AtomicBool;

    fn deref(&self) -> &AtomicBool {
        match self {
            Self::Process => &INTERRUPTED,
            Self::Call(stop) => stop,
        }
    }
}
