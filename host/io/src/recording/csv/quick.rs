//! Rows read in pieces, on all cores: plain numbers between separators, and texts without quotes, as most
//! files hold them.
//!
//! Mistakes are not named here: a file that is not plain is left to the careful reader, which names line and
//! column. So both have the same numbers, and words have one place.

use std::io::Read;
use std::thread;

use super::plain::Plain;
use super::{Column, MOST_COLUMNS, Reader, Sink, separator};
use crate::recording::Recording;
use crate::recording::columns::Known;
use crate::recording::text::decimal::Forms;
use crate::recording::time::{self, Time};
use crate::rig::{DecimalMark, RigFile};

/// Bytes of a piece: some ten thousand rows.
const PIECE: usize = 2 << 20;

/// Text in pieces that end where lines do.
struct Pieces<R> {
    from: R,
    /// The beginning of the next piece.
    left: Vec<u8>,
    is_at_end: bool,
}

impl<R: Read> Pieces<R> {
    fn new(from: R) -> Self {
        Self { from, left: Vec::new(), is_at_end: false }
    }

    /// Returns the next piece, empty after the last; `None` if it cannot be read, or a line is longer than a
    /// piece.
    fn next(&mut self) -> Option<Vec<u8>> {
        let mut piece = std::mem::take(&mut self.left);
        if self.is_at_end {
            return Some(piece);
        }
        let wanted = PIECE.saturating_sub(piece.len());
        piece.reserve_exact(wanted);
        let read = self.from.by_ref().take(wanted as u64).read_to_end(&mut piece).ok()?;
        if read < wanted {
            self.is_at_end = true;
            return Some(piece);
        }
        let end = piece.iter().rposition(|byte| *byte == b'\n')? + 1;
        self.left = piece.split_off(end);
        Some(piece)
    }
}

/// The use of a column's cells.
enum Cells {
    Time { scale: f64, shift: Option<usize> },
    Number { scale: f64, offset: f64, is_kept: bool },
    Text,
}

impl Cells {
    fn of(column: &Column) -> Self {
        match &column.sink {
            Sink::Time { scale, .. } => Self::Time { scale: *scale, shift: time::power_of_ten(*scale) },
            Sink::Number { scale, offset, cells, .. } => {
                Self::Number { scale: *scale, offset: *offset, is_kept: cells.is_some() }
            }
            Sink::Text(_) => Self::Text,
        }
    }
}

/// The rows of a piece.
#[derive(Default)]
struct Rows {
    /// Numbers of each row, one after the other.
    numbers: Vec<f64>,
    times: Vec<Time>,
    /// Texts that are stored, by the columns that keep them.
    texts: Vec<Vec<String>>,
    count: usize,
}

/// The columns and the separator by which lines are cut and read.
struct Lines {
    columns: Vec<Cells>,
    separator: u8,
}

impl Lines {
    /// Returns the rows of a piece; `None` if a line is not plain.
    fn rows(&self, piece: &[u8]) -> Option<Rows> {
        if piece.contains(&b'"') || piece.contains(&0) {
            return None;
        }
        let text = std::str::from_utf8(piece).ok()?;
        let kept = |cells: &&Cells| matches!(cells, Cells::Text | Cells::Number { is_kept: true, .. });
        let kept = self.columns.iter().filter(kept).count();
        let mut rows = Rows { texts: vec![Vec::new(); kept], ..Rows::default() };
        let mut at = 0;
        while at < piece.len() {
            if let Some(length) = end_of_line(&piece[at..]) {
                at += length;
                continue;
            }
            at += self.row(&text[at..], &mut rows)?;
            rows.count += 1;
        }
        Some(rows)
    }

    /// Reads the row that a text begins with; returns its length with the line's end.
    fn row(&self, text: &str, rows: &mut Rows) -> Option<usize> {
        let (mut at, mut kept) = (0, 0);
        let last = self.columns.len().checked_sub(1)?;
        for (k, cells) in self.columns.iter().enumerate() {
            let length = self.cell(cells, text.get(at..)?, &mut kept, rows)?;
            at += length;
            let rest = text.as_bytes().get(at..)?;
            if k < last {
                rest.first().filter(|byte| **byte == self.separator)?;
                at += 1;
            } else if !rest.is_empty() {
                at += end_of_line(rest)?;
            }
        }
        Some(at)
    }

    /// Reads a cell; returns its length.
    fn cell(&self, cells: &Cells, text: &str, kept: &mut usize, rows: &mut Rows) -> Option<usize> {
        let is_end =
            |byte: Option<&u8>| byte.is_none_or(|b| *b == self.separator || *b == b'\n' || *b == b'\r');
        let bytes = text.as_bytes();
        if !matches!(cells, Cells::Text) {
            let plain = Plain::read(bytes);
            if is_end(bytes.get(plain.length)) {
                match cells {
                    Cells::Number { scale: 1.0, offset: 0.0, is_kept: false } => {
                        if let Some(number) = plain.number() {
                            rows.numbers.push(number);
                            return Some(plain.length);
                        }
                    }
                    Cells::Time { shift: Some(shift), .. } => {
                        if let Some(time) = plain.time(*shift) {
                            rows.times.push(time);
                            return Some(plain.length);
                        }
                    }
                    _ => {}
                }
            }
        }
        let length = (0..=bytes.len()).find(|k| is_end(bytes.get(*k)))?;
        let cell = text.get(..length)?.trim();
        match cells {
            Cells::Time { scale, .. } => rows.times.push(time::parse(cell, *scale)?),
            Cells::Number { scale, offset, .. } => {
                rows.numbers.push(super::number(cell, *scale, *offset).ok()?)
            }
            Cells::Text => {}
        }
        if matches!(cells, Cells::Text | Cells::Number { is_kept: true, .. }) {
            rows.texts.get_mut(*kept)?.push(cell.to_owned());
            *kept += 1;
        }
        Some(length)
    }
}

/// Returns the length of the line's end that a text begins with.
fn end_of_line(text: &[u8]) -> Option<usize> {
    match text {
        [b'\n', ..] => Some(1),
        [b'\r', b'\n', ..] => Some(2),
        _ => None,
    }
}

impl Reader<'_> {
    /// Appends the rows of a piece.
    fn append(&mut self, rows: Rows) {
        let Rows { numbers, mut times, texts, count } = rows;
        let mut texts = texts.into_iter();
        let width = self.columns.iter().filter(|c| matches!(c.sink, Sink::Number { .. })).count();
        let mut places = vec![Vec::new(); self.groups.len()];
        let mut number = 0;
        for column in &mut self.columns {
            match &mut column.sink {
                Sink::Time { times: all, .. } => all.append(&mut times),
                Sink::Number { group, known, cells, count: all, .. } => {
                    if let (Known::Member(_, k), Some(own)) = (known, places.get_mut(*group)) {
                        own.push((*k, number));
                    }
                    if let Some(cells) = cells {
                        cells.extend(texts.next().unwrap_or_default());
                    }
                    (*all, number) = (*all + count, number + 1);
                }
                Sink::Text(cells) => cells.extend(texts.next().unwrap_or_default()),
            }
        }
        for ((_, rows), mut own) in self.groups.iter_mut().zip(places) {
            own.sort_unstable();
            let own: Vec<usize> = own.into_iter().map(|(_, at)| at).collect();
            rows.extend(&numbers, width, &own);
        }
    }

    /// Returns true if every group has all of its columns.
    fn is_complete(&self) -> bool {
        self.groups.iter().enumerate().all(|(place, (group, _))| {
            let own = |c: &&Column| matches!(&c.sink, Sink::Number { group, .. } if *group == place);
            self.columns.iter().filter(own).count() == group.names().len()
        })
    }
}

/// Returns true if nothing but a decimal mark can be meant by a point: in the notation, between commas, or
/// where a number at the beginning of the file has not three digits after it.
fn has_sure_points(reader: &Reader<'_>, separator: u8, body: &str) -> bool {
    const ROWS: usize = 100;
    if reader.rig.recording.decimal == Some(DecimalMark::Comma) {
        return false;
    }
    let is_own = |column: &Column| Known::parse(&column.header).is_some();
    if separator == b',' || reader.columns.iter().any(is_own) {
        return true;
    }
    let cells = body.lines().take(ROWS).flat_map(|line| line.split(char::from(separator)));
    let mut forms = Forms::ALL;
    cells.into_iter().all(|cell| forms.see(cell.trim())) && forms.is_point()
}

/// Reads a file, piece by piece; `None` if it is to be read with care.
pub(super) fn read(label: &str, from: impl Read, rig: &RigFile) -> Option<Recording> {
    let mut pieces = Pieces::new(from);
    let first = pieces.next()?;
    let text = std::str::from_utf8(&first).ok().filter(|text| !text.contains('\0'))?;
    let (comments, body) = super::comments(text.strip_prefix('\u{feff}').unwrap_or(text));
    let mut reader = Reader::new(label, rig.clone(), comments);
    reader.apply_comments().ok()?;
    let body = body.trim_start_matches(['\n', '\r']);
    let (header, body) = body.split_once('\n')?;
    let header = header.strip_suffix('\r').unwrap_or(header);
    if header.contains(['"', '\r']) {
        return None;
    }
    let separator = separator(header);
    let names = super::header(header, separator)?;
    if names.len() > MOST_COLUMNS {
        return None;
    }
    reader.name_columns(names).ok()?;
    if !reader.is_complete() || !has_sure_points(&reader, separator, body) {
        return None;
    }
    let lines = Lines { columns: reader.columns.iter().map(Cells::of).collect(), separator };
    let mut rows = 0;
    let mut add = |reader: &mut Reader<'_>, piece: Option<Rows>| -> Option<()> {
        let piece = piece?;
        rows += piece.count;
        reader.append(piece);
        Some(())
    };
    add(&mut reader, lines.rows(body.as_bytes()))?;
    let threads = thread::available_parallelism().map_or(1, usize::from);
    loop {
        let mut some = Vec::new();
        while some.len() < threads {
            match pieces.next()? {
                piece if piece.is_empty() => break,
                piece => some.push(piece),
            }
        }
        if some.is_empty() {
            break;
        }
        for piece in on_all_cores(&lines, &some) {
            add(&mut reader, piece)?;
        }
    }
    if rows == 0 {
        return None;
    }
    reader.into_recording(true).ok()
}

/// Reads pieces at the same time; the rows of each in their order.
fn on_all_cores(lines: &Lines, pieces: &[Vec<u8>]) -> Vec<Option<Rows>> {
    thread::scope(|scope| {
        let Some((first, others)) = pieces.split_first() else { return Vec::new() };
        let others: Vec<_> = others.iter().map(|piece| scope.spawn(|| lines.rows(piece))).collect();
        let mut all = vec![lines.rows(first)];
        all.extend(others.into_iter().map(|other| other.join().ok().flatten()));
        all
    })
}
