//! Text from files and networks, made fit for a terminal, a comment or a log.
//!
//! Names and titles are written by strangers. A control character in one moves the cursor, hides a line or
//! ends a comment in the program of a robot; a bidirectional control shows another order than the one that is
//! read.

use core::fmt::{self, Write};

/// The most bytes of a name.
pub const LONGEST_NAME: usize = 1024;
/// Is shown in place of a character that steers.
const SHOWN: char = '\u{fffd}';

/// Returns true for a character that steers what shows it: controls (C0, C1), separators of lines and
/// controls of direction.
pub fn steers(c: char) -> bool {
    c.is_control()
        || matches!(
            c,
            '\u{061c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{206f}' | '\u{feff}'
        )
}

/// Returns true if a text can be a name: no character steers, and it is at most [`LONGEST_NAME`] bytes long.
pub fn is_name(text: &str) -> bool {
    text.len() <= LONGEST_NAME && !text.chars().any(steers)
}

/// Returns true if a text may be shown in the lines that it has: nothing else in it steers.
pub fn are_lines(text: &str) -> bool {
    text.chars().all(|c| c == '\n' || !steers(c))
}

/// A text as it is shown.
#[derive(Clone, Copy, Debug)]
pub struct Printable<'a> {
    text: &'a str,
    most: usize,
    breaks: Breaks,
}

/// The treatment of the ends of lines in a text.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Breaks {
    Replaced,
    SetIn,
    Kept,
}

/// Shows a name: one line, cut after [`LONGEST_NAME`] characters.
pub fn name(text: &str) -> Printable<'_> {
    Printable { text, most: LONGEST_NAME, breaks: Breaks::Replaced }
}

/// Shows a text in one line, whole.
pub fn line(text: &str) -> Printable<'_> {
    Printable { text, most: usize::MAX, breaks: Breaks::Replaced }
}

/// Shows a text in the lines that it has; all after the first begin with a blank, so that none of them can
/// pass for a message of its own.
pub fn lines(text: &str) -> Printable<'_> {
    Printable { text, most: usize::MAX, breaks: Breaks::SetIn }
}

/// Shows a text that this program laid out: its lines and tabs stay.
pub fn page(text: &str) -> Printable<'_> {
    Printable { text, most: usize::MAX, breaks: Breaks::Kept }
}

impl fmt::Display for Printable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (mut begins, mut said) = (false, false);
        for (n, c) in self.text.chars().enumerate() {
            if n == self.most {
                return f.write_char('…');
            }
            let breaks =
                (c == '\n' && self.breaks != Breaks::Replaced) || (c == '\t' && self.breaks == Breaks::Kept);
            if breaks {
                begins = said && self.breaks == Breaks::SetIn;
                f.write_char(c)?;
                continue;
            }
            if core::mem::take(&mut begins) && c != ' ' {
                f.write_str("  ")?;
            }
            said = true;
            f.write_char(if steers(c) { SHOWN } else { c })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::{String, ToString};

    #[test]
    fn nothing_that_steers_is_shown() {
        let steering = ('\0'..='\u{1f}').chain('\u{7f}'..='\u{9f}').chain('\u{202a}'..='\u{202e}');
        let steering =
            steering.chain('\u{2066}'..='\u{2069}').chain(['\u{200e}', '\u{200f}', '\u{2028}', '\u{2029}']);
        for c in steering {
            let text: String = ['a', c, 'b'].iter().collect();
            assert!(!is_name(&text) && steers(c), "{c:?}");
            for shown in [name(&text).to_string(), line(&text).to_string()] {
                assert_eq!(shown, "a\u{fffd}b", "{c:?}");
            }
            assert!(are_lines(&lines(&text).to_string()) && are_lines(&text) == (c == '\n'), "{c:?}");
        }
        for plain in ["Größe 3 ± 0.1 kg·m²", "左手", "שלום", "a b", ""] {
            assert!(is_name(plain));
            assert_eq!(name(plain).to_string(), plain);
        }
    }

    #[test]
    fn a_long_name_is_cut_and_a_second_line_is_set_in() {
        let long = "x".repeat(LONGEST_NAME + 1);
        assert!(!is_name(&long));
        assert_eq!(name(&long).to_string().chars().count(), LONGEST_NAME + 1);
        assert_eq!(line(&long).to_string(), long);
        assert_eq!(lines("a\nplatform: safe\n  b\n").to_string(), "a\n  platform: safe\n  b\n");
        assert_eq!(page("a\n\tb\n\u{9b}c").to_string(), "a\n\tb\n\u{fffd}c");
        assert_eq!(lines("\nstopping").to_string(), "\nstopping");
        assert_eq!(lines("a\r\n\u{1b}[2Jb").to_string(), "a\u{fffd}\n  \u{fffd}[2Jb");
    }
}
