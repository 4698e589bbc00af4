//! Recordings as CSV.
//!
//! A plain file is read in pieces, on all cores ([`quick`]); any other with care, so that a mistake is named
//! with line and column.

mod assembled;
pub(super) mod careful;
mod group_rows;
mod named;
mod plain;
mod quick;
mod written;

use std::collections::BTreeMap;
use std::io::Read;

use self::group_rows::GroupRows;
use super::columns::{Group, Known, nearest_known};
pub use super::text::rows::separator;
use super::time::{self, Time};
use super::{Recording, RecordingError, sheet};
use crate::rig::{RecordingTable, RigFile};

/// The longest line, bytes.
const LONGEST_LINE: usize = 16 << 20;
/// More columns than these, of as many quantities, no recording has.
const MOST_COLUMNS: usize = 4096;

/// The destination of a column's cells.
enum Sink {
    /// The time.
    Time { scale: f64, times: Vec<Time> },
    /// A known quantity, with the number of its cells that are in a group's rows; the cells too where scaling
    /// loses their last digit.
    Number { known: Known, group: usize, scale: f64, offset: f64, count: usize, cells: Option<Vec<String>> },
    /// Anything else.
    Text(Vec<String>),
}

struct Column {
    /// Name in the file.
    header: String,
    sink: Sink,
}

/// The parts of a file before its rows, and the columns that these fill.
pub(super) struct Reader<'a> {
    label: &'a str,
    rig: RigFile,
    comments: Vec<(String, String)>,
    columns: Vec<Column>,
    /// Rows of the groups that its columns belong to.
    groups: Vec<(Group, GroupRows)>,
    /// Lines of the rows; none of arrays.
    lines: Vec<u64>,
    /// Units of the columns as far as a row of the file says, and lines above its header.
    units: Vec<Option<String>>,
    above: Vec<String>,
    /// Columns that hold times of day.
    clocks: Vec<usize>,
    /// By the place of a column that begins with neither number nor time of day: its first cell.
    strange: BTreeMap<usize, String>,
    /// The statement that its columns were found by their names and units.
    assumed: Option<String>,
    /// The program that wrote the file, where its way of writing counts.
    program: Option<&'static str>,
    /// The warnings.
    warnings: Vec<String>,
}

impl Recording {
    /// Reads a CSV file that is plain, piece by piece; `None` if it is not, or something is wrong with it:
    /// its bytes are then to be read by [`Recording::from_csv_bytes`]. `label` is the file's name.
    pub(super) fn from_plain_csv(label: &str, from: impl Read, rig: &RigFile) -> Option<Self> {
        quick::read(label, from, rig)
    }

    /// Reads the bytes of a CSV file. `label` is the file's name, for messages.
    ///
    /// # Errors
    /// [`RecordingError`] with line and column.
    pub fn from_csv_bytes(label: &str, bytes: &[u8], rig: &RigFile) -> Result<Self, RecordingError> {
        match Self::from_plain_csv(label, bytes, rig) {
            Some(recording) => Ok(recording),
            None => Self::from_csv_with_care(label, bytes, rig),
        }
    }

    /// Reads the bytes of a workbook.
    ///
    /// # Errors
    /// Fails as [`Recording::from_csv_bytes`] does.
    pub(super) fn from_workbook(label: &str, bytes: &[u8], rig: &RigFile) -> Result<Self, RecordingError> {
        let not = |reason: String| RecordingError::NotARecording { name: label.to_owned(), reason };
        let sheet = sheet::read(bytes, rig.recording.decimal).map_err(not)?;
        let mut recording = Self::from_sheet(label, &sheet.text, rig)?;
        recording.warnings.extend(sheet.warning());
        Ok(recording)
    }
}

impl<'a> Reader<'a> {
    /// Returns one that has no columns yet.
    pub(super) fn new(label: &'a str, rig: RigFile, comments: Vec<(String, String)>) -> Self {
        Self {
            label,
            rig,
            comments,
            columns: Vec::new(),
            groups: Vec::new(),
            lines: Vec::new(),
            units: Vec::new(),
            above: Vec::new(),
            clocks: Vec::new(),
            strange: BTreeMap::new(),
            assumed: None,
            program: None,
            warnings: Vec::new(),
        }
    }

    /// Returns one that knows the units of its columns, what a file says of itself line by line, and the
    /// columns that it says to be times, which are in s.
    pub(super) fn with_words(
        mut self,
        units: Vec<Option<String>>,
        above: Vec<String>,
        times: Vec<usize>,
    ) -> Self {
        (self.units, self.above, self.clocks) = (units, above, times);
        self
    }

    /// Finds out what each column is.
    ///
    /// # Errors
    /// The columns are not those of a recording.
    pub(super) fn name_columns(&mut self, header: Vec<String>) -> Result<(), RecordingError> {
        self.look_up(&header)?;
        let mut columns = self.assign(header)?;
        for column in &mut columns {
            let Sink::Number { known: Known::Member(group, _), group: place, .. } = &mut column.sink else {
                continue;
            };
            *place = self.groups.iter().position(|(own, _)| own == group).unwrap_or(self.groups.len());
            if *place == self.groups.len() {
                self.groups.push((*group, GroupRows::new(*group)));
            }
        }
        self.columns = columns;
        Ok(())
    }

    /// Takes the next cell of a column.
    ///
    /// # Errors
    /// Why the cell is no use.
    pub(super) fn take(&mut self, column: usize, cell: &str) -> Result<(), String> {
        let groups = &mut self.groups;
        self.columns.get_mut(column).map_or(Ok(()), |column| column.push(cell, groups))
    }

    fn columns_error(&self, reason: String) -> RecordingError {
        RecordingError::Columns { name: self.label.to_owned(), reason }
    }

    /// Applies comments: one that states a key of [recording] counts as if the rig file did.
    fn apply_comments(&mut self) -> Result<(), RecordingError> {
        let unset = RecordingTable::default();
        for (n, (key, value)) in self.comments.iter().enumerate() {
            if !matches!(key.as_str(), "rate_hz" | "wrench_sign" | "gravity_mps2" | "static") {
                continue;
            }
            let at = |reason: String| RecordingError::At {
                name: self.label.to_owned(),
                line: n as u64 + 1,
                column: None,
                reason,
            };
            let stated = RigFile::parse(&format!("[recording]\n{key} = {value}"))
                .map_err(|_| at(format!("comment {key} = {value} is not what the rig file's {key} can be")))?
                .recording;
            let rig = &mut self.rig.recording;
            let contradicts = |is_set: bool, differs: bool| {
                if is_set && differs {
                    Err(at(format!("comment {key} = {value} contradicts the rig file: correct one of them")))
                } else {
                    Ok(())
                }
            };
            match key.as_str() {
                "rate_hz" => {
                    contradicts(rig.rate_hz.is_some(), rig.rate_hz != stated.rate_hz)?;
                    rig.rate_hz = stated.rate_hz;
                }
                "wrench_sign" => {
                    contradicts(rig.wrench_sign != unset.wrench_sign, rig.wrench_sign != stated.wrench_sign)?;
                    rig.wrench_sign = stated.wrench_sign;
                }
                "gravity_mps2" => {
                    let differs = rig.gravity_mps2 != stated.gravity_mps2;
                    contradicts(rig.gravity_mps2 != unset.gravity_mps2, differs)?;
                    rig.gravity_mps2 = stated.gravity_mps2;
                }
                _ => {
                    contradicts(rig.is_static, !stated.is_static)?;
                    rig.is_static = stated.is_static;
                }
            }
        }
        Ok(())
    }
}

impl Column {
    fn push(&mut self, cell: &str, groups: &mut [(Group, GroupRows)]) -> Result<(), String> {
        match &mut self.sink {
            Sink::Text(cells) => cells.push(cell.to_owned()),
            Sink::Time { scale, times } => times.push(time::parse(cell, *scale).ok_or_else(|| refuse(cell))?),
            Sink::Number { known, group, scale, offset, count, cells } => {
                let value = number(cell, *scale, *offset)?;
                if let (Known::Member(_, k), Some((_, rows))) = (known, groups.get_mut(*group)) {
                    rows.set(*count, *k, value);
                }
                *count += 1;
                if let Some(cells) = cells {
                    cells.push(cell.to_owned());
                }
            }
        }
        Ok(())
    }
}

/// Reads a number in the unit of the notation.
///
/// # Errors
/// Why the cell is no use.
fn number(cell: &str, scale: f64, offset: f64) -> Result<f64, String> {
    let value: f64 = cell.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| refuse(cell))?;
    // Multiplying by one would change nothing but the sign of a zero.
    let value = if scale == 1.0 { value } else { value * scale };
    let value = if offset == 0.0 { value } else { value + offset };
    if value.is_finite() { Ok(value) } else { Err(format!("{cell} times {scale} is not a finite number")) }
}

/// Parts a file into its comments at the beginning, as keys with their values, and the rest.
fn comments(text: &str) -> (Vec<(String, String)>, &str) {
    let (mut comments, mut body) = (Vec::new(), text);
    while let Some(rest) = body.strip_prefix('#') {
        let (line, after) = rest.split_once('\n').unwrap_or((rest, ""));
        let pair = line.split_once('=').filter(|(key, _)| !key.trim().is_empty());
        let (key, value) = pair.unwrap_or(("", line));
        comments.push((key.trim().to_owned(), value.trim().to_owned()));
        body = after;
    }
    (comments, body)
}

/// Returns a reader of rows of any length whose first is the header.
fn csv_reader(body: &str, separator: u8) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new()
        .flexible(true)
        .trim(csv::Trim::All)
        .delimiter(separator)
        .from_reader(body.as_bytes())
}

/// Returns the names in a header of one line; `None` if it is none.
fn header(line: &str, separator: u8) -> Option<Vec<String>> {
    let mut reader = csv_reader(line, separator);
    Some(reader.headers().ok()?.iter().map(str::to_owned).collect())
}

/// Returns why a cell of a known column cannot be used.
fn refuse(cell: &str) -> String {
    let cell = shorten(cell);
    if cell.is_empty() {
        "the value is missing: fill it in, or remove the row".to_owned()
    } else if cell.starts_with(sheet::FORMULA) {
        format!(
            "{cell:?} is a formula, and its value is not in the file: open it in a program for spreadsheets \
             and save it"
        )
    } else if cell.parse::<f64>().is_ok() {
        format!("{cell} is not a finite number: correct it, or remove the row")
    } else if nearest_known(&cell).as_deref() == Some(cell.as_str()) {
        format!("{cell:?} is the name of a column: the header is repeated here; remove the line")
    } else {
        let marks = if cell.contains(',') { " (decimals have a point)" } else { "" };
        format!("{cell:?} is not a number{marks}: correct it, or remove the row")
    }
}

/// Shortens a text to the length that a message can carry.
fn shorten(text: &str) -> String {
    const MOST: usize = 120;
    if text.chars().count() <= MOST {
        text.to_owned()
    } else {
        text.chars().take(MOST).chain("…".chars()).collect()
    }
}

#[cfg(test)]
pub(super) mod exports_tests;
#[cfg(test)]
mod tests;
