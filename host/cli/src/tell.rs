//! Words on standard error.

use std::fmt;
use std::io::Write as _;

use rigident_shared::printable;

use super::kept;

/// Prints a line on standard error, or keeps it for the program that called the command. A reader that has gone away is no
/// failure, and no reason to stop a platform's program in the middle, as `eprintln!` would by a panic.
macro_rules! tell {
    ($($words:tt)*) => {
        $crate::tell::tell(format_args!($($words)*), "\n")
    };
}

/// Prints words, then `end`; characters of names that would steer the terminal are replaced.
pub(super) fn tell(words: fmt::Arguments<'_>, end: &str) {
    let text = words.to_string();
    let text = printable::lines(&text);
    if !kept::told(format_args!("{text}")) {
        let _ = write!(std::io::stderr().lock(), "{text}{end}");
    }
}
