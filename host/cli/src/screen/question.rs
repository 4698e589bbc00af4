//! Questions at the terminal that Ctrl-C ends.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use crate::Failure;

/// Returns what `read` gives, in a thread that is left behind if nobody answers before `interrupted`: `None`
/// then.
pub(crate) fn answered(
    read: impl FnOnce() -> io::Result<String> + Send + 'static,
    interrupted: &AtomicBool,
) -> Result<Option<String>, Failure> {
    let (tell, answer) = mpsc::channel();
    std::thread::spawn(move || {
        // Nobody listens any more once the user has stopped it.
        let _ = tell.send(read());
    });
    loop {
        match answer.recv_timeout(Duration::from_millis(50)) {
            _ if interrupted.load(Ordering::Relaxed) => return Ok(None),
            Ok(answer) => return answer.map(Some).map_err(Failure::input),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(Some(String::new())),
        }
    }
}
