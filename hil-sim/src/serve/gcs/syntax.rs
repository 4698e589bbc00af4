//! Bytes to commands.

use hexapod::gcs::{FREE_POINTS, IS_READY, LINE_BYTES, MACRO, MOVING, STATUS, STOP};

/// Bytes that are commands by themselves.
const SINGLE: [u8; 6] = [STATUS, MOVING, IS_READY, MACRO, FREE_POINTS, STOP];

/// The message of a client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Said {
    /// A single byte.
    Byte(u8),
    /// A line without its end.
    Line(String),
    /// A line that is too long.
    TooLong,
}

/// One client's bytes.
#[derive(Debug, Default)]
pub(super) struct Input {
    line: Vec<u8>,
    overflown: bool,
}

impl Input {
    pub(super) fn push(&mut self, byte: u8) -> Option<Said> {
        if SINGLE.contains(&byte) {
            return Some(Said::Byte(byte));
        }
        if byte != b'\n' {
            self.overflown |= self.line.len() >= LINE_BYTES;
            if !self.overflown {
                self.line.push(byte);
            }
            return None;
        }
        let line = std::mem::take(&mut self.line);
        if std::mem::take(&mut self.overflown) {
            return Some(Said::TooLong);
        }
        let text = String::from_utf8_lossy(&line).trim().to_owned();
        (!text.is_empty()).then_some(Said::Line(text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Vec<Said> {
        let mut input = Input::default();
        bytes.iter().filter_map(|b| input.push(*b)).collect()
    }

    #[test]
    fn a_single_byte_is_a_command_even_within_a_line() {
        let line = |s: &str| Said::Line(s.to_owned());
        assert_eq!(
            read(b"POS?\r\n\n\x05MOV X\x18 1\n"),
            [line("POS?"), Said::Byte(5), Said::Byte(24), line("MOV X 1")]
        );
    }

    #[test]
    fn a_line_without_end_takes_no_memory_and_is_said_to_be_too_long() {
        let mut input = Input::default();
        assert!((0..100_000).all(|_| input.push(b'A').is_none()));
        assert!(input.line.capacity() <= 2 * LINE_BYTES);
        assert_eq!(input.push(b'\n'), Some(Said::TooLong));
        assert_eq!(input.push(b'A'), None);
        assert_eq!(input.push(b'\n'), Some(Said::Line("A".to_owned())));
    }
}
