//! Sheets of Excel workbooks (`.xlsx`, `.xlsm`) as text with tabs, a row a line, so that they are read as any
//! table is.
//!
//! Numbers are written with a point and all their digits, times as ISO 8601. Cells that hold numbers as text
//! are brought to the same form, or refused where it is not clear which they are.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::Cursor;

use calamine::{Cell, DataRef, ExcelDateTime, Reader as _, Xlsx, XlsxError};

use super::columnar::Room;
use super::text::decimal::{self, Forms};
use super::text::layout::Layout;
use super::text::one_line;
use crate::parquet_file::guarded_as;
use crate::rig::DecimalMark;

const TORN: &str = "as a workbook it is damaged or cut off";
/// Sheets that are examined.
const MOST_SHEETS: usize = 256;
/// The last column up to which rows are filled with empty cells.
const MOST_PADDED: u32 = 1024;
/// Microseconds of a day.
const DAY_US: i64 = 86_400_000_000;
/// Days from Excel's day 0 (1899-12-30) to 1970, and from the day 0 of old Macintoshes (1904-01-01).
const EPOCH: i64 = 25_569;
const EPOCH_1904: i64 = 24_107;

/// The table of a workbook.
#[derive(Debug)]
pub(super) struct Sheet {
    /// The rows of the sheet, cells by tabs; the line is the number of the row in the sheet.
    pub(super) text: String,
    /// The sheet's name.
    pub(super) name: String,
    /// Names of other sheets that hold tables of numbers too.
    pub(super) others: Vec<String>,
}

impl Sheet {
    /// Says which other sheets are not read.
    pub(super) fn warning(&self) -> Option<String> {
        (!self.others.is_empty()).then(|| {
            format!(
                "sheet {:?} is read; {} hold tables too: save each to a file of its own for [[stream]] if \
                 they belong to it",
                self.name,
                self.others.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ")
            )
        })
    }
}

/// Returns true for the ending of a workbook that is read.
pub(super) fn is_workbook(ending: &str) -> bool {
    matches!(ending, "xlsx" | "xlsm")
}

/// Begins a cell with a formula whose value is not stored.
pub(super) const FORMULA: char = '=';

/// A cell: its row, its column, and its text.
type Place = (u32, u32, String);

/// Returns the first sheet of a workbook that holds a table of numbers; `stated` is the mark of decimals in
/// cells of text.
///
/// # Errors
/// Says why there is none.
pub(super) fn read(bytes: &[u8], stated: Option<DecimalMark>) -> Result<Sheet, String> {
    guarded_as(TORN, || unguarded(bytes, stated))
}

fn unguarded(bytes: &[u8], stated: Option<DecimalMark>) -> Result<Sheet, String> {
    let mut room = Room::of_file(bytes.len());
    check_unpacked(bytes, &mut room)?;
    let mut room = Room::of_file(bytes.len());
    let mut workbook = Xlsx::new(Cursor::new(bytes)).map_err(damaged)?;
    let names: Vec<String> = workbook.sheet_names().into_iter().take(MOST_SHEETS).collect();
    let (mut found, mut others): (Option<Sheet>, Vec<String>) = (None, Vec::new());
    for name in names {
        let cells = match cells(&mut workbook, &name, &mut room) {
            Ok(cells) => cells,
            // A sheet that is a chart.
            Err(None) => continue,
            Err(Some(reason)) => return Err(reason),
        };
        let text = text(cells, stated, &mut room).map_err(|reason| format!("sheet {name:?}: {reason}"))?;
        if !Layout::find(&text, 1, None).is_ok_and(|layout| layout.is_some()) {
            continue;
        }
        match found {
            None => found = Some(Sheet { text, name, others: Vec::new() }),
            Some(_) => others.push(name),
        }
    }
    let found = found.ok_or("none of its sheets holds a table of numbers under names of columns")?;
    Ok(Sheet { others, ..found })
}

fn damaged(error: XlsxError) -> String {
    match error {
        XlsxError::Password => "it is protected by a password: save it without one".to_owned(),
        other => format!("{TORN}: {other}"),
    }
}

/// Refuses a file that unpacks to more than a recording of its size.
fn check_unpacked(bytes: &[u8], room: &mut Room) -> Result<(), String> {
    use std::io::Read as _;
    let torn = |error: &dyn std::fmt::Display| format!("{TORN}: {error}");
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(|e| torn(&e))?;
    let mut piece = vec![0; 1 << 16];
    for k in 0..archive.len() {
        let mut entry = archive.by_index(k).map_err(|e| torn(&e))?;
        loop {
            match entry.read(&mut piece).map_err(|e| torn(&e))? {
                0 => break,
                count => room.take(count)?,
            }
        }
    }
    Ok(())
}

/// Returns the cells of a sheet in order; the error is `None` of a sheet that has none.
fn cells(
    workbook: &mut Xlsx<Cursor<&[u8]>>,
    name: &str,
    room: &mut Room,
) -> Result<Vec<Place>, Option<String>> {
    let of = |error: XlsxError| match error {
        XlsxError::NotAWorksheet(_) => None,
        other => Some(damaged(other)),
    };
    let mut reader = workbook.worksheet_cells_reader(name).map_err(of)?;
    let mut all: Vec<Place> = Vec::new();
    while let Some(cell) = reader.next_cell().map_err(of)? {
        let text = cell_text(&cell);
        if text.is_empty() {
            continue;
        }
        room.take_cells(1, text.len()).map_err(Some)?;
        let (row, column) = cell.get_position();
        all.push((row, column, text));
    }
    drop(reader);
    if !all.is_sorted_by_key(|(row, column, _)| (*row, *column)) {
        all.sort_by_key(|(row, column, _)| (*row, *column));
    }
    all.dedup_by_key(|(row, column, _)| (*row, *column));
    add_formulas(workbook, name, &mut all, room)?;
    Ok(all)
}

/// Adds the formulas whose values are not stored, as text: no cell of a row is empty because of them.
fn add_formulas(
    workbook: &mut Xlsx<Cursor<&[u8]>>,
    name: &str,
    all: &mut Vec<Place>,
    room: &mut Room,
) -> Result<(), Option<String>> {
    let mut reader = workbook.worksheet_cells_reader(name).map_err(|error| Some(damaged(error)))?;
    let mut missing: Vec<Place> = Vec::new();
    while let Some(cell) = reader.next_formula().map_err(|error| Some(damaged(error)))? {
        let place = cell.get_position();
        if all.binary_search_by_key(&place, |(row, column, _)| (*row, *column)).is_err() {
            let text = format!("{FORMULA}{}", one_line(cell.get_value()));
            room.take_cells(1, text.len()).map_err(Some)?;
            missing.push((place.0, place.1, text));
        }
    }
    if !missing.is_empty() {
        all.append(&mut missing);
        all.sort_by_key(|(row, column, _)| (*row, *column));
        all.dedup_by_key(|(row, column, _)| (*row, *column));
    }
    Ok(())
}

/// Marks a cell of text, which may be a number that somebody wrote.
const WRITTEN: char = '\u{1}';

fn cell_text(cell: &Cell<DataRef<'_>>) -> String {
    let written = |text: &str| match one_line(text).trim() {
        "" => String::new(),
        bare => format!("{WRITTEN}{bare}"),
    };
    match cell.get_value() {
        DataRef::Int(value) => value.to_string(),
        DataRef::Float(value) => format!("{value:?}"),
        DataRef::Bool(value) => u8::from(*value).to_string(),
        DataRef::DateTime(time) => stamp(time),
        DataRef::String(text) => written(text),
        DataRef::SharedString(text) => written(text),
        DataRef::DateTimeIso(text) | DataRef::DurationIso(text) => written(text),
        DataRef::Error(error) => written(&error.to_string()),
        DataRef::Empty => String::new(),
    }
}

/// Returns a time as ISO 8601 has it, to the microsecond; one of less than a day is a time of day.
fn stamp(time: &ExcelDateTime) -> String {
    let serial = time.as_f64();
    if !(-1e6..=1e7).contains(&serial) {
        return format!("{serial:?}");
    }
    let us = (serial * DAY_US as f64).round() as i64;
    // The serial number of a day has 0.6 µs: a whole millisecond is meant where one is that near.
    let ms = (us + 500).div_euclid(1000) * 1000;
    let us = if us.abs_diff(ms) <= 1 { ms } else { us };
    let (mut day, within) = (us.div_euclid(DAY_US), us.rem_euclid(DAY_US));
    let seconds = within / 1_000_000;
    let clock = format!(
        "{:02}:{:02}:{:02}.{:06}",
        seconds / 3600,
        seconds / 60 % 60,
        seconds % 60,
        within % 1_000_000
    );
    if day == 0 && time.is_datetime() {
        return clock;
    }
    // Which day is the first is not stated directly: both ways of counting are four years apart.
    let (shown, ..) = time.to_ymd_hms_milli();
    let (year, ..) = date(day - EPOCH);
    day -= if (i64::from(shown) - year).abs() >= 3 { EPOCH_1904 } else { EPOCH };
    let (year, month, date) = date(day);
    format!("{year:04}-{month:02}-{date:02}T{clock}")
}

/// Returns year, month and day of a day counted from 1970, after Hinnant's *chrono-Compatible Low-Level Date
/// Algorithms*.
fn date(days: i64) -> (i64, i64, i64) {
    let z = days + 719_468;
    let (era, doe) = (z.div_euclid(146_097), z.rem_euclid(146_097));
    let yoe = (doe - doe / 1460 + doe / 36_524 - doe / 146_096) / 365;
    let doy = doe - (365 * yoe + yoe / 4 - yoe / 100);
    let mp = (5 * doy + 2) / 153;
    let month = if mp < 10 { mp + 3 } else { mp - 9 };
    (yoe + era * 400 + i64::from(month <= 2), month, doy - (153 * mp + 2) / 5 + 1)
}

/// Writes cells as lines, numbers in cells of text brought to the form of the others.
fn text(cells: Vec<Place>, stated: Option<DecimalMark>, room: &mut Room) -> Result<String, String> {
    let mut forms = stated.map_or(Forms::ALL, |mark| Forms::with_decimal(mark == DecimalMark::Comma));
    // Digits alone are one number in every form; a number beside a word is not one of a table.
    let has_mark = |cell: &str| cell.contains(|c: char| !c.is_ascii_digit() && !matches!(c, '-' | '+'));
    let is_number = |cell: &str| decimal::is_number(cell.strip_prefix(WRITTEN).unwrap_or(cell));
    let is_row = |row: &[Place]| 2 * row.iter().filter(|(.., cell)| is_number(cell)).count() > row.len();
    for row in cells.chunk_by(|a, b| a.0 == b.0).filter(|row| is_row(row)) {
        for (row, column, cell) in row {
            let Some(own) = cell.strip_prefix(WRITTEN).filter(|own| has_mark(own)) else { continue };
            if decimal::is_number(own) && !forms.see(own) {
                return Err(format!(
                    "{own:?} in column {} of row {} is a number written as text in another way than those \
                     before it: make them numbers",
                    column + 1,
                    row + 1
                ));
            }
        }
    }
    let form = forms.form(false).map_err(|_| {
        "numbers are written in it as text, and nothing shows whether their marks are of decimals or of \
         thousands: make them numbers, or write decimal = \"comma\" or \"point\" in [recording] of its rig \
         file"
            .to_owned()
    })?;
    let width = cells.iter().map(|(_, column, _)| *column).max().unwrap_or(0).min(MOST_PADDED);
    let (mut text, mut at) = (String::new(), (0, 0));
    for (row, column, cell) in cells {
        if row > at.0 {
            // All rows have the same cells.
            let (rest, lines) = (width.saturating_sub(at.1) as usize, (row - at.0) as usize);
            room.take(lines + rest)?;
            text.extend(std::iter::repeat_n('\t', rest));
            text.extend(std::iter::repeat_n('\n', lines));
            at = (row, 0);
        }
        let tabs = column.saturating_sub(at.1) as usize;
        room.take(tabs + cell.len() + 2)?;
        text.extend(std::iter::repeat_n('\t', tabs));
        at.1 = at.1.max(column);
        let plain = match cell.strip_prefix(WRITTEN) {
            Some(own) if form.fits(own) => form.plain(own)?.into_owned(),
            Some(own) => quoted(own).into_owned(),
            None => cell,
        };
        text.push_str(&plain);
    }
    text.extend(std::iter::repeat_n('\t', width.saturating_sub(at.1) as usize));
    text.push('\n');
    Ok(text)
}

/// Puts a text with quotes in it into quotes, as a table in text has it.
fn quoted(text: &str) -> Cow<'_, str> {
    if !text.contains('"') {
        return Cow::Borrowed(text);
    }
    let mut all = String::from("\"");
    // Writing into memory has no way to fail.
    let _ = write!(all, "{}\"", text.replace('"', "\"\""));
    Cow::Owned(all)
}

#[cfg(test)]
mod tests;
