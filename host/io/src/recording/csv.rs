//! Recordings as CSV.
//!
//! A plain file is read in pieces, on all cores ([`quick`]); any other with care, so that a mistake is named
//! with line and column.

pub(super) mod careful;
mod group_rows;
mod plain;
mod quick;

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::{Read, Write};

use rigident_shared::printable;

use self::group_rows::GroupRows;
use super::columns::{Group, Known, TIME, is_printable, nearest_known, other_unit};
use super::text::one_line;
pub use super::text::rows::separator;
use super::time::{self, Time};
use super::{Recording, RecordingError, conventions, sheet, stem};
use crate::rig::spelling::nearest;
use crate::rig::{ColumnSource, Quantity, RecordingTable, RigFile, Unit, WrenchSign};

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
    /// As [`Recording::from_csv_bytes`].
    pub(super) fn from_workbook(label: &str, bytes: &[u8], rig: &RigFile) -> Result<Self, RecordingError> {
        let not = |reason: String| RecordingError::NotARecording { name: label.to_owned(), reason };
        let sheet = sheet::read(bytes, rig.recording.decimal).map_err(not)?;
        let mut recording = Self::from_sheet(label, &sheet.text, rig)?;
        recording.warnings.extend(sheet.warning());
        Ok(recording)
    }

    /// Writes CSV that holds the recording without loss, in the notation's names, units and signs.
    ///
    /// # Errors
    /// The system refuses to write.
    pub fn write_csv<W: Write>(&self, mut to: W) -> std::io::Result<W> {
        for (key, value) in &self.comments {
            let comment = if key.is_empty() { value.clone() } else { format!("{key} = {value}") };
            // A line's end inside would end the comment, a zero byte the text.
            writeln!(to, "# {}", one_line(&comment))?;
        }
        let extra: HashMap<&str, &Vec<String>> =
            self.extra.iter().map(|(name, cells)| (name.as_str(), cells)).collect();
        let names = self.column_names();
        // A first name that begins as a comment does is quoted, or the header would be read as one.
        let mark = names.first().and_then(|name| name.starts_with('#').then_some(b'#'));
        // Quoted, too, are names with what another file has between its columns.
        let quotes = if names.iter().any(|name| name.contains(['|', '\t', ';'])) {
            csv::QuoteStyle::Always
        } else {
            csv::QuoteStyle::Necessary
        };
        let mut header = csv::WriterBuilder::new().comment(mark).quote_style(quotes).from_writer(to);
        header.write_record(&names).map_err(of_system)?;
        let mut writer =
            csv::Writer::from_writer(header.into_inner().map_err(csv::IntoInnerError::into_error)?);
        for row in 0..self.rows() {
            for name in &names {
                let written = match (extra.get(name.as_str()), Known::parse(name)) {
                    (Some(cells), _) => writer.write_field(cells.get(row).map_or("", String::as_str)),
                    (None, Some(Known::Time)) => writer.write_field(self.time_text(row)),
                    (None, known) => {
                        let value = known.and_then(|known| self.number(known, row));
                        // As many digits as it takes to read the same number back.
                        writer.write_field(value.map_or_else(String::new, |v| format!("{v:?}")))
                    }
                };
                written.map_err(of_system)?;
            }
            writer.write_record(None::<&[u8]>).map_err(of_system)?;
        }
        writer.into_inner().map_err(csv::IntoInnerError::into_error)
    }

    /// The text of [`Recording::write_csv`].
    pub fn to_csv(&self) -> String {
        // Writing into memory has no way to fail.
        self.write_csv(Vec::new()).map(|b| String::from_utf8_lossy(&b).into_owned()).unwrap_or_default()
    }

    fn time_text(&self, row: usize) -> String {
        match self.exact_time_s.as_ref().and_then(|t| t.get(row)) {
            Some(seconds) => format!("{seconds:?}"),
            None => self.time_ns.get(row).map_or_else(String::new, |ns| time::text(*ns)),
        }
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

    /// A comment that states a key of [recording] counts as if the rig file did.
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

    /// Finds columns by the names and units that other programs give them, where the rig file names none and
    /// no name is known.
    fn look_up(&mut self, header: &[String]) -> Result<(), RecordingError> {
        let is_known = |name: &String| matches!(Known::parse(name), Some(Known::Member(..)));
        if !self.rig.recording.columns.is_empty() || header.iter().any(is_known) {
            return Ok(());
        }
        let meanings = conventions::meanings(header, &self.units, &self.above);
        let is_clock = |k: usize| self.clocks.contains(&k);
        let columns = conventions::columns(header, &meanings, is_clock).map_err(|without| {
            let first = without.first().map_or("Fx", String::as_str);
            let of_first = conventions::meaning(first, None);
            self.columns_error(format!(
                "its columns are named as elsewhere, and the unit of {} is written nowhere: name the columns \
                 in [recording] columns of a rig file, as in {} = {{ name = {first:?}, unit = \"{}\" }}",
                shorten(&without.join(", ")),
                of_first.as_ref().map_or("fx_n", |meaning| meaning.known.as_str()),
                of_first.as_ref().map_or("N", |meaning| meaning.quantity.si())
            ))
        })?;
        let is_group = |known: &String| known != TIME;
        if !columns.keys().any(is_group) {
            return Ok(());
        }
        let said = columns.iter().map(|(known, source)| match source.parts() {
            (name, 1.0) => format!("{known} = {name:?}"),
            (name, scale) => format!("{known} = {name:?} times {scale:?}"),
        });
        let program = self.program.map_or_else(String::new, |program| format!(" as {program} writes them"));
        self.assumed = Some(format!(
            "columns taken by their names and units{program}: {}",
            said.collect::<Vec<_>>().join(", ")
        ));
        self.rig.recording.columns = columns;
        Ok(())
    }

    /// Returns what each column is, by its name or by the rig file.
    fn assign(&self, header: Vec<String>) -> Result<Vec<Column>, RecordingError> {
        let mapping = &self.rig.recording.columns;
        let mut sources = BTreeMap::new();
        for (known, source) in mapping {
            let ((name, scale), offset) = (source.parts(), source.offset());
            if !header.iter().any(|h| h == name) {
                let near = nearest(name, header.iter().map(String::as_str));
                return Err(self.columns_error(format!(
                    "the rig file says that {known} is in column {name:?}, and there is none{}; the columns \
                     are {}",
                    near.map_or_else(String::new, |n| format!(" (is it {n:?}?)")),
                    header.join(", ")
                )));
            }
            if let Some((other, _)) = sources.insert(name, (known.as_str(), (scale, offset))) {
                return Err(self.columns_error(format!(
                    "the rig file names column {name:?} for {other} and for {known}: it can be one of them"
                )));
            }
        }
        if !printable::is_name(self.label) {
            return Err(self.columns_error("its name has control characters: give it another one".to_owned()));
        }
        if let Some(n) = header.iter().position(|name| !is_printable(name)) {
            return Err(self.columns_error(format!(
                "the name of its column {} has control characters, or is longer than {} bytes: {:?}",
                n + 1,
                printable::LONGEST_NAME,
                printable::name(&header[n]).to_string()
            )));
        }
        let mut columns: Vec<Column> = Vec::new();
        let mut known_columns = Vec::new();
        for (place, name) in header.into_iter().enumerate() {
            if columns.iter().any(|c| c.header == name) {
                return Err(self.columns_error(format!("column {name:?} appears twice: rename one")));
            }
            let source = sources.get(name.as_str()).copied();
            let known = source.map_or_else(|| Known::parse(&name), |(known, _)| Known::parse(known));
            let (scale, offset) = source.map_or((1.0, 0.0), |(_, unit)| unit);
            let sink = match known {
                Some(Known::Time) if self.rig.recording.is_static => Sink::Text(Vec::new()),
                Some(Known::Time) => Sink::Time { scale, times: Vec::new() },
                Some(known) => {
                    let cells = (scale != 1.0 || offset != 0.0).then(Vec::new);
                    Sink::Number { known, group: 0, scale, offset, count: 0, cells }
                }
                None => {
                    if let Some(meant) = other_unit(&name) {
                        return Err(self.columns_error(format!(
                            "column {name} is a known quantity in an unknown unit: it must be {meant}, or be \
                             named with its scale in the rig file, [recording] columns = \
                             {{ {meant} = {{ name = \"{name}\", scale = … }} }}"
                        )));
                    }
                    Sink::Text(Vec::new())
                }
            };
            if let Some(known) = known {
                self.check_unit(
                    place,
                    &name,
                    known,
                    source.is_some_and(|(own, _)| mapping.get(own).is_some_and(has_unit)),
                )?;
                if known_columns.contains(&known) {
                    return Err(self.columns_error(format!(
                        "{} is in two columns, {name:?} and another one: the file or the rig file must name \
                         one",
                        known.name()
                    )));
                }
                known_columns.push(known);
            }
            columns.push(Column { header: name, sink });
        }
        if known_columns.is_empty() {
            return Err(RecordingError::NotARecording {
                name: self.label.to_owned(),
                reason: format!(
                    "none of its columns is known ({}); name them in [recording] columns of a rig file",
                    shorten(&columns.iter().map(|c| c.header.as_str()).collect::<Vec<_>>().join(", "))
                ),
            });
        }
        Ok(columns)
    }

    /// Refuses a column whose unit in the file is another than the one it is read in.
    fn check_unit(
        &self,
        place: usize,
        header: &str,
        known: Known,
        is_given: bool,
    ) -> Result<(), RecordingError> {
        let name = known.name();
        let Some(own) = Quantity::of_name(&name).filter(|_| !is_given && !self.clocks.contains(&place))
        else {
            return Ok(());
        };
        let unit = |text: &str| Unit::parse(text).filter(|unit| unit.quantity == own);
        // A unit over the numbers that is not known is another one, too; the end of a name may be anything.
        let above = self.units.get(place).and_then(Option::as_deref);
        let above = above.filter(|text| unit(text).is_none_or(|unit| unit.scale != 1.0));
        let named = conventions::unit_of(header);
        let named = named.filter(|text| unit(text).is_some_and(|unit| unit.scale != 1.0));
        let Some(stated) = above.or(named) else { return Ok(()) };
        Err(self.columns_error(format!(
            "{name} is read in {}, and the file says {stated:?} of column {header:?}: write its unit in \
             [recording] columns of the rig file",
            own.si()
        )))
    }

    /// Puts the columns together; they are of a file or of arrays.
    ///
    /// # Errors
    /// A column is missing, times do not increase, or the rig file contradicts them.
    pub(super) fn into_recording(mut self, of_file: bool) -> Result<Recording, RecordingError> {
        let headers: Vec<String> = self.columns.iter().map(|c| c.header.clone()).collect();
        let mut recording = Recording {
            name: stem(self.label),
            assumed: self.assumed.take(),
            warnings: std::mem::take(&mut self.warnings),
            ..Recording::default()
        };
        let usual = 2 + self.comments.len() as u64;
        recording.first_line = self.lines.first().copied().filter(|line| *line != usual);
        let mut members: BTreeMap<Group, BTreeSet<usize>> = BTreeMap::new();
        let mut times = None;
        for column in std::mem::take(&mut self.columns) {
            match column.sink {
                Sink::Time { times: found, .. } => {
                    recording.order.push(TIME.to_owned());
                    times = Some(found);
                }
                Sink::Number { known: Known::Member(group, k), cells, .. } => {
                    recording.order.push(Known::Member(group, k).name());
                    members.entry(group).or_default().insert(k);
                    if let Some(cells) = cells {
                        // The number before scaling, so that nothing is lost in a conversion.
                        recording.extra.push((raw_name(&column.header, &headers), cells));
                    }
                }
                Sink::Number { .. } => {}
                Sink::Text(cells) => {
                    recording.order.push(column.header.clone());
                    recording.extra.push((column.header, cells));
                }
            }
        }
        let mut groups = std::mem::take(&mut self.groups);
        groups.sort_by_key(|(group, _)| *group);
        for (group, rows) in groups {
            let (names, own) = (group.names(), members.remove(&group).unwrap_or_default());
            let missing: Vec<&str> = names
                .iter()
                .enumerate()
                .filter(|(k, _)| !own.contains(k))
                .map(|(_, name)| name.as_str())
                .collect();
            if !missing.is_empty() {
                return Err(self.missing(&missing, &names, &headers));
            }
            rows.put_into(group, &mut recording);
        }
        match times {
            Some(times) => self.set_times(&mut recording, &times)?,
            None if self.rig.recording.is_static => {}
            None => {
                let near = headers.iter().find(|h| {
                    let h = h.to_lowercase();
                    h == "t" || h.contains("time") || h.contains("stamp")
                });
                return Err(self.columns_error(format!(
                    "column t_s is missing: {}, or say static = true there if every row is a still pose",
                    near.map_or_else(
                        || "name the column of the time in [recording] columns of the rig file".to_owned(),
                        |n| format!(
                            "is it {n:?}? then say so in the rig file, [recording] columns = \
                             {{ t_s = {{ name = {n:?}, scale = … }} }}"
                        )
                    )
                )));
            }
        }
        // The sign is applied below; stated again it would be applied again.
        if self.rig.recording.wrench_sign == WrenchSign::OnSensor {
            self.comments.retain(|(key, _)| key != "wrench_sign");
        }
        // What is above the header is retained; an equals sign would make it a key.
        let above = self.above.iter().map(|line| (String::new(), line.replace('=', ":")));
        recording.comments = self.comments.into_iter().chain(above).collect();
        if !of_file {
            // There is no file whose lines could be named.
            recording.order.clear();
        }
        recording.rig = self.rig;
        recording.settle(self.label)
    }

    fn missing(&self, missing: &[&str], names: &[String], headers: &[String]) -> RecordingError {
        let there: Vec<&str> =
            names.iter().map(String::as_str).filter(|name| !missing.contains(name)).collect();
        let strangers = headers.iter().map(String::as_str).filter(|h| Known::parse(h).is_none());
        let near = missing.first().and_then(|name| nearest(name, strangers));
        self.columns_error(format!(
            "{} {} missing beside {}{}: add what is missing, or name it in [recording] columns of the rig \
             file",
            if missing.len() == 1 {
                format!("column {}", missing[0])
            } else {
                format!("columns {}", missing.join(", "))
            },
            if missing.len() == 1 { "is" } else { "are" },
            there.join(", "),
            near.map_or_else(String::new, |n| format!(" (is it {n:?}?)"))
        ))
    }

    /// Checks that times increase and brings them to nanoseconds.
    fn set_times(&self, recording: &mut Recording, times: &[Time]) -> Result<(), RecordingError> {
        let name = self.label.to_owned();
        let at = |row: usize, reason: String| match self.lines.get(row).copied() {
            Some(line) => {
                RecordingError::At { name: name.clone(), line, column: Some(TIME.to_owned()), reason }
            }
            None => RecordingError::Cell {
                name: name.clone(),
                index: row as u64,
                column: TIME.to_owned(),
                reason,
            },
        };
        let line = |row: usize| self.lines.get(row).map_or_else(String::new, |line| format!(", line {line}"));
        for (row, pair) in times.windows(2).enumerate() {
            let increases = pair[1].nanoseconds() > pair[0].nanoseconds();
            if !increases {
                let (before, after) = (pair[0].seconds(), pair[1].seconds());
                return Err(at(
                    row + 1,
                    format!(
                        "time {} from {before:?} s (row {}{}) to {after:?} s (row {}): t_s must increase; \
                         sort the rows, or split the file where the clock starts anew",
                        if after < before { "runs backwards" } else { "stands still" },
                        row + 1,
                        line(row),
                        row + 2,
                    ),
                ));
            }
        }
        let first = times.first().map_or(0, |t| t.nanoseconds());
        // Nanoseconds have no sign: a recording that begins before zero counts from its first row.
        let origin = first.min(0);
        recording.time_ns.reserve_exact(times.len());
        for (row, t) in times.iter().enumerate() {
            let ns = t.nanoseconds().saturating_sub(origin);
            let ns = u64::try_from(ns).ok().filter(|ns| *ns < i64::MAX as u64).ok_or_else(|| {
                at(row, format!("{:?} s is centuries away: check the scale of the time", t.seconds()))
            })?;
            recording.time_ns.push(ns);
        }
        if origin < 0 || times.iter().any(|t| matches!(t, Time::Seconds(_))) {
            recording.exact_time_s = Some(times.iter().map(|t| t.seconds()).collect());
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

/// Returns true if a rig file says in which unit a column is.
fn has_unit(source: &ColumnSource) -> bool {
    matches!(source, ColumnSource::Scaled(column) if column.unit.is_some() || column.scale != 1.0)
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

/// Returns what the system said, as it said it: a full disk is distinguished from other failures by its kind.
fn of_system(error: csv::Error) -> std::io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => std::io::Error::other(format!("{other:?}")),
    }
}

/// Why a cell of a known column is no use.
fn refuse(cell: &str) -> String {
    let cell = shorten(cell);
    if cell.is_empty() {
        "the value is missing: fill it in, or remove the row".to_owned()
    } else if cell.parse::<f64>().is_ok() {
        format!("{cell} is not a finite number: correct it, or remove the row")
    } else if nearest_known(&cell).as_deref() == Some(cell.as_str()) {
        format!("{cell:?} is the name of a column: the header is repeated here; remove the line")
    } else {
        let marks = if cell.contains(',') { " (decimals have a point)" } else { "" };
        format!("{cell:?} is not a number{marks}: correct it, or remove the row")
    }
}

/// A name for the unscaled cells that no other column has.
fn raw_name(header: &str, headers: &[String]) -> String {
    let mut name = format!("raw_{header}");
    while headers.contains(&name) {
        name.insert_str(0, "raw_");
    }
    name
}

/// Not more of a text than a message can carry.
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
