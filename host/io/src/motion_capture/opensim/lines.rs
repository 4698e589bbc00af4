//! Lines of a text, one at a time.

use std::io::BufRead;

use super::error::{OpenSimError, at};

/// The mark that some programs begin a text with.
const BYTE_ORDER_MARK: char = '\u{feff}';

/// Goes through the lines of a text.
pub(super) struct Lines<R> {
    reader: R,
    text: String,
    line: usize,
}

impl<R: BufRead> Lines<R> {
    pub(super) fn new(reader: R) -> Self {
        Self { reader, text: String::new(), line: 0 }
    }

    /// Returns the next line with its number, from 1; `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<(usize, &str)>, OpenSimError> {
        self.text.clear();
        self.line += 1;
        match self.reader.read_line(&mut self.text) {
            Ok(0) => Ok(None),
            Ok(_) => {
                if self.line == 1 && self.text.starts_with(BYTE_ORDER_MARK) {
                    self.text.remove(0);
                }
                Ok(Some((self.line, self.text.trim_end_matches(['\n', '\r']))))
            }
            Err(error) => Err(at(self.line, format!("it cannot be read: {error}: save it as UTF-8 text"))),
        }
    }

    /// Returns the next line that is not blank.
    pub(super) fn next_filled(&mut self) -> Result<Option<(usize, &str)>, OpenSimError> {
        while self.next()?.is_some() {
            if !self.text.trim().is_empty() {
                break;
            }
        }
        let text = self.text.trim_end_matches(['\n', '\r']);
        Ok((!text.trim().is_empty()).then_some((self.line, text)))
    }
}
