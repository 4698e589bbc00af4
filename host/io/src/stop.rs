//! Shows whether this process must stop, by Ctrl-C or by SIGTERM.

use std::sync::atomic::{AtomicBool, Ordering};

/// Set by Ctrl-C: whatever runs ends where it can keep what it has.
pub static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Returns true once the process is to stop.
pub fn is_asked() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}
