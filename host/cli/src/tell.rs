//! Words on standard error.

/// Prints a line on standard error, or keeps it for the program that called the command. A reader that has gone away is no
/// failure, and no reason to stop a platform's program in the middle, as `eprintln!` would by a panic.
macro_rules! tell {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        if !$crate::kept::told(format_args!($($words)*)) {
            let _ = writeln!(std::io::stderr().lock(), $($words)*);
        }
    }};
}
