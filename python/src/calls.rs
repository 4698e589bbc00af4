//! Commands in this process.

use std::ffi::OsString;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rigident_cli::{self as cli, Called};

use crate::errors::raised;
use crate::recordings::Recording;

/// The interval between checks of Python's signals while a command works.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// The time that a command may take after a request to stop before Python goes on without it.
const STOP_WITHIN: Duration = Duration::from_secs(2);
/// The stack of a command, as large as that of a process's first thread.
const STACK_BYTES: usize = 8 << 20;

/// Runs the command line of this process with these words, the program's name first; returns the exit status.
#[pyfunction]
pub fn main(py: Python<'_>, words: Vec<OsString>) -> i32 {
    py.detach(|| cli::main_of(words) as i32)
}

/// Calls a command with the words of its command line and returns exit status, standard output and the lines
/// of standard error. The lock is released meanwhile; Ctrl-C stops the command and raises
/// `KeyboardInterrupt`.
///
/// # Errors
/// Raises `RigidentError` if there is no answer.
#[pyfunction]
#[pyo3(signature = (words, recording=None))]
pub fn call(
    py: Python<'_>,
    words: Vec<OsString>,
    recording: Option<&Recording>,
) -> PyResult<(i32, String, Vec<String>)> {
    let memory = recording.map(|recording| recording.inner.clone());
    let called = watched(py, move |stop| cli::call(words, memory, stop))?;
    let Called { status, output, messages, failure } = called;
    match failure {
        Some(failure) => Err(raised(py, &failure, &messages)),
        None => Ok((status as i32, output, messages)),
    }
}

/// Does work in a thread of its own without Python's lock; Ctrl-C sets the token that the work gets and
/// raises `KeyboardInterrupt`.
///
/// # Errors
/// Raises `KeyboardInterrupt`, or `RuntimeError` if the work panicked.
pub fn watched<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(Arc<AtomicBool>) -> T + Send + 'static,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let (ended, end) = sync_channel::<()>(1);
    let token = Arc::clone(&stop);
    let work = move || {
        // Dropped when the work is over, and when it panics.
        let _ended = ended;
        work(token)
    };
    let thread = std::thread::Builder::new().stack_size(STACK_BYTES).spawn(work)?;
    // Shared with nobody; only so that it may be waited for without the lock.
    let end = Mutex::new(end);
    let wait = |limit| py.detach(|| end.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(limit));
    loop {
        match wait(LOOK_EVERY) {
            Err(RecvTimeoutError::Timeout) => {}
            _ => return finished(py, thread),
        }
        if let Err(interrupt) = py.check_signals() {
            stop.store(true, Ordering::Relaxed);
            // What does not heed it in time goes on by itself to its end; nobody hears of that.
            let _ = wait(STOP_WITHIN);
            return Err(interrupt);
        }
    }
}

fn finished<T: Send>(py: Python<'_>, thread: JoinHandle<T>) -> PyResult<T> {
    let joined = py.detach(|| thread.join());
    joined.map_err(|panic| {
        let words = panic.downcast_ref::<String>().map(String::as_str);
        let words = words.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no reason given");
        PyRuntimeError::new_err(format!("a fault of rigident itself, please report it: {words}"))
    })
}
