//! Lines of a text cut into cells, quotes respected, with the numbers of the lines.

use std::borrow::Cow;

/// The separator of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Separator {
    /// A character.
    One(u8),
    /// Blanks and tabs, one or more.
    Blanks,
}

impl Separator {
    /// Returns its name, for people.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::One(b',') => "comma",
            Self::One(b';') => "semicolon",
            Self::One(b'\t') => "tab",
            Self::One(_) => "bar",
            Self::Blanks => "blanks",
        }
    }
}

/// The possible separators of columns; of equally many in a header the last one is taken: a comma.
const SEPARATORS: [u8; 4] = *b"|\t;,";

/// Returns what separates the columns: what occurs most often in the first line that is not empty, outside of
/// quotes.
pub fn separator(body: &str) -> u8 {
    let (mut counts, mut quoted) = ([0_usize; SEPARATORS.len()], false);
    for byte in body.trim_start_matches(['\n', '\r']).bytes() {
        match byte {
            b'"' => quoted = !quoted,
            b'\n' | b'\r' if !quoted => break,
            _ if quoted => {}
            _ => counts.iter_mut().zip(SEPARATORS).for_each(|(count, of)| *count += usize::from(of == byte)),
        }
    }
    let most = SEPARATORS.into_iter().zip(counts).max_by_key(|(_, count)| *count);
    most.map_or(b',', |(separator, _)| separator)
}

/// Rows of a text; those without a word in them are left out.
#[derive(Clone, Debug)]
pub(crate) struct Rows<'a> {
    text: &'a str,
    at: usize,
    /// Number of the line that begins at `at`, from 1.
    line: u64,
    separator: Separator,
    /// No quote closes in the rest.
    is_unquoted: bool,
}

impl<'a> Rows<'a> {
    /// Begins a text whose first line has number `line`.
    pub(crate) fn new(text: &'a str, line: u64, separator: Separator) -> Self {
        Self { text, at: 0, line, separator, is_unquoted: false }
    }

    /// Returns where the next row is sought: bytes from the beginning, and the number of the line.
    pub(crate) fn place(&self) -> (usize, u64) {
        (self.at, self.line)
    }

    /// Puts the next row's cells, without blanks around them, into `cells`; returns its line, `None` after
    /// the last.
    pub(crate) fn next(&mut self, cells: &mut Vec<Cow<'a, str>>) -> Option<u64> {
        while self.at < self.text.len() {
            cells.clear();
            let line = self.line;
            self.cut(cells);
            if cells.iter().any(|cell| !cell.is_empty()) {
                return Some(line);
            }
        }
        None
    }

    fn byte(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    fn is_separator(&self, byte: u8) -> bool {
        match self.separator {
            Separator::One(own) => byte == own,
            Separator::Blanks => matches!(byte, b' ' | b'\t'),
        }
    }

    /// Cuts one line.
    fn cut(&mut self, cells: &mut Vec<Cow<'a, str>>) {
        loop {
            let is_blank = |b: u8| b == b' ' || (b == b'\t' && self.separator != Separator::One(b'\t'));
            let blanks = self.text.as_bytes().iter().skip(self.at).take_while(|b| is_blank(**b)).count();
            self.at += blanks;
            let is_at_end = self.byte().is_none_or(|b| b == b'\n' || b == b'\r');
            // Blanks before the line's end separate nothing.
            if !(is_at_end && self.separator == Separator::Blanks) {
                let cell = self.cell();
                cells.push(cell);
            }
            match self.byte() {
                Some(b'\r') => {
                    self.at += 1;
                    self.at += usize::from(self.byte() == Some(b'\n'));
                    self.line += 1;
                    return;
                }
                Some(b'\n') => {
                    self.at += 1;
                    self.line += 1;
                    return;
                }
                Some(_) => self.at += 1,
                None => return,
            }
        }
    }

    /// Takes the next cell, up to its separator or the line's end.
    fn cell(&mut self) -> Cow<'a, str> {
        let quoted = if self.byte() == Some(b'"') { self.quoted() } else { None };
        let rest = self.text.get(self.at..).unwrap_or_default();
        let is_end = |b: u8| self.is_separator(b) || b == b'\n' || b == b'\r';
        let length = rest.bytes().position(is_end).unwrap_or(rest.len());
        self.at += length;
        let plain = rest.get(..length).unwrap_or_default().trim();
        match quoted {
            None => Cow::Borrowed(plain),
            Some(text) if plain.is_empty() => text,
            Some(text) => Cow::Owned(format!("{text}{plain}")),
        }
    }

    /// Takes what is in quotes, a doubled quote being one; `None` if they do not close.
    fn quoted(&mut self) -> Option<Cow<'a, str>> {
        if self.is_unquoted {
            return None;
        }
        let start = self.at + 1;
        let (mut end, mut has_quotes) = (start, false);
        let bytes = self.text.as_bytes();
        loop {
            let Some(next) = bytes.get(end..).and_then(|rest| rest.iter().position(|b| *b == b'"')) else {
                self.is_unquoted = true;
                return None;
            };
            end += next;
            if bytes.get(end + 1) != Some(&b'"') {
                break;
            }
            has_quotes = true;
            end += 2;
        }
        let inside = self.text.get(start..end)?;
        self.at = end + 1;
        // A line's end is \n, \r\n or \r.
        let returns = inside.bytes().filter(|b| *b == b'\r').count();
        let feeds = inside.bytes().filter(|b| *b == b'\n').count();
        self.line += (returns + feeds - inside.matches("\r\n").count()) as u64;
        let inside = inside.trim();
        Some(if has_quotes { Cow::Owned(inside.replace("\"\"", "\"")) } else { Cow::Borrowed(inside) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(text: &str, separator: Separator) -> Vec<(u64, Vec<String>)> {
        let mut rows = Rows::new(text, 1, separator);
        let (mut cells, mut all) = (Vec::new(), Vec::new());
        while let Some(line) = rows.next(&mut cells) {
            all.push((line, cells.iter().map(|cell| cell.to_string()).collect()));
        }
        all
    }

    #[test]
    fn lines_are_counted_and_cells_cut_as_written() {
        let of = |cells: &[&str]| cells.iter().map(|c| (*c).to_owned()).collect::<Vec<_>>();
        let text = "a, \"b\"\"c\" ,\r\n\r\n ,\r\n\"x\r\ny\",2,3\r\n1,2,3";
        let known =
            vec![(1, of(&["a", "b\"c", ""])), (4, of(&["x\r\ny", "2", "3"])), (6, of(&["1", "2", "3"]))];
        assert_eq!(cut(text, Separator::One(b',')), known);
        assert_eq!(
            cut("  1  2\t3 \n\n4 5 6\r7", Separator::Blanks),
            [(1, of(&["1", "2", "3"])), (3, of(&["4", "5", "6"])), (4, of(&["7"]))]
        );
        assert_eq!(
            cut("1\t\t3\n\"no end\t5", Separator::One(b'\t')),
            [(1, of(&["1", "", "3"])), (2, of(&["\"no end", "5"]))]
        );
    }
}
