//! Rows read one by one: texts as other programs write them, and every mistake named with line and column.

use std::borrow::Cow;

use super::{LONGEST_LINE, MOST_COLUMNS, Reader, Sink, comments, refuse, separator};
use crate::recording::columns::Known;
use crate::recording::text::clock::{Clock, Stamp, Survey};
use crate::recording::text::decimal::{Form, Forms, Unclear, is_number};
use crate::recording::text::encoding::decode;
use crate::recording::text::layout::{Layout, Stepper, is_comment};
use crate::recording::text::rows::{Rows, Separator};
use crate::recording::time::Time;
use crate::recording::{Recording, RecordingError};
use crate::rig::{DecimalMark, RigFile};

/// Lines in which a table's columns are counted before anything is searched.
const LOOKED_AT: usize = 600;

/// The text of a file with the layout of its table.
pub(in crate::recording) struct Found<'a> {
    pub(in crate::recording) layout: Layout,
    pub(in crate::recording) comments: Vec<(String, String)>,
    pub(in crate::recording) body: &'a str,
}

/// Finds the table in a text.
///
/// # Errors
/// There is nothing in it, or it is not what it says.
pub(in crate::recording) fn find<'a>(
    label: &str,
    text: &'a str,
    rig: &RigFile,
) -> Result<Found<'a>, RecordingError> {
    let not = |reason: String| RecordingError::NotARecording { name: label.to_owned(), reason };
    if let Some(line) = text.lines().position(|line| line.len() > LONGEST_LINE) {
        return Err(not(format!(
            "its line {} is longer than {LONGEST_LINE} bytes: a row of a recording takes a line of its own",
            line + 1
        )));
    }
    let separators = |line: &str| [',', ';', '\t'].map(|mark| line.matches(mark).count()).into_iter().max();
    if let Some(columns) =
        text.lines().take(LOOKED_AT).filter_map(separators).max().filter(|count| *count >= MOST_COLUMNS)
    {
        return Err(not(format!(
            "it has {} columns, and recordings of up to {MOST_COLUMNS} are read: leave out what no quantity \
             needs",
            columns + 1
        )));
    }
    let body = text.strip_prefix('\u{feff}').unwrap_or(text);
    if body.trim().is_empty() {
        return Err(not("it is empty".to_owned()));
    }
    let (comments, body) = comments(body);
    let line = comments.len() as u64 + 1;
    let mapping = &rig.recording.columns;
    let is_known =
        |name: &str| Known::parse(name).is_some() || mapping.values().any(|source| source.parts().0 == name);
    let own = separator(body);
    // How many of the columns that the rig file names a layout has.
    let named = |layout: &Layout| {
        let names = mapping.values().map(|source| source.parts().0);
        names.filter(|name| layout.names.iter().any(|own| own == name)).count()
    };
    let above = comments
        .last()
        .map(|(key, value)| if key.is_empty() { value.clone() } else { format!("{key} = {value}") });
    let search = || Layout::find(body, line, above.as_deref());
    let found = match Layout::of_header(body, line, own, is_known) {
        // A line of groups above the names may have one of them.
        Some(first) if named(&first) < mapping.len() => {
            let other = search().ok().flatten();
            other.filter(|other| named(other) > named(&first)).or(Some(first))
        }
        Some(first) => Some(first),
        None => search().map_err(not)?,
    };
    // Of no table of numbers the first line is taken for the header, whatever it says.
    let layout = found.or_else(|| Layout::of_header(body, line, own, |_| true));
    let layout = layout.ok_or_else(|| not("it is empty".to_owned()))?;
    Ok(Found { layout, comments, body })
}

/// Returns in words how the numbers of a table are written, by all columns that hold nothing else.
pub(in crate::recording) fn numbers(found: &Found<'_>) -> String {
    let layout = &found.layout;
    let reader = Reader::new("", RigFile::default(), Vec::new());
    let seen = reader.survey(layout.rows(found.body), layout);
    let columns =
        seen.into_iter().flatten().filter(|seen| seen.stamps.is_none()).filter_map(|seen| seen.forms);
    let first = match layout.comma {
        _ if layout.is_plain => Forms::PLAIN,
        Some(comma) => Forms::with_decimal(comma),
        None => Forms::ALL,
    };
    match columns.fold(first, Forms::join).form(reader.has_points(layout)) {
        Ok(form) => form.name(),
        Err(_) => "unclear: decimals or thousands".to_owned(),
    }
}

/// The destination of a column's cells.
enum Way {
    /// They are times of day.
    Clock(Clock),
    /// They are numbers, written as the file writes them.
    Numbers,
    /// They are stored as they are.
    Kept,
}

/// The findings in the cells of a column.
#[derive(Default)]
struct Seen {
    /// Forms of the column's numbers, while all of its cells are numbers.
    forms: Option<Forms>,
    /// The column's times of day, while all of its cells are such.
    stamps: Option<Survey>,
    /// The column's first cell, if it is neither.
    strange: Option<String>,
}

/// The way the cells of a table are read.
struct Ways {
    form: Form,
    columns: Vec<Way>,
}

impl Recording {
    /// Reads the bytes of a CSV file row by row.
    pub(super) fn from_csv_with_care(
        label: &str,
        bytes: &[u8],
        rig: &RigFile,
    ) -> Result<Self, RecordingError> {
        let not = |reason: String| RecordingError::NotARecording { name: label.to_owned(), reason };
        if bytes.starts_with(&crate::recording::mcap::container::MAGIC) {
            return Err(not("it is an MCAP file: give it the ending .mcap".to_owned()));
        }
        let (text, _) = decode(bytes).map_err(not)?;
        Self::from_found(label, find(label, &text, rig)?, rig)
    }

    /// Reads the rows of a sheet, whose numbers have points and nothing between thousands.
    pub(super) fn from_sheet(label: &str, text: &str, rig: &RigFile) -> Result<Self, RecordingError> {
        let mut rig = rig.clone();
        // Which mark cells of text have is settled.
        rig.recording.decimal = None;
        let mut found = find(label, text, &rig)?;
        found.layout.is_plain = true;
        Self::from_found(label, found, &rig)
    }

    fn from_found(label: &str, found: Found<'_>, rig: &RigFile) -> Result<Self, RecordingError> {
        let Found { layout, comments, body } = found;
        let mut reader = Reader::new(label, rig.clone(), comments);
        reader.apply_comments()?;
        reader.read(&layout, body)?;
        reader.into_recording(true)
    }
}

impl Reader<'_> {
    fn at(&self, line: u64, column: Option<&str>, reason: String) -> RecordingError {
        let name = self.label.to_owned();
        RecordingError::At { name, line, column: column.map(str::to_owned), reason }
    }

    /// Reads the rows of a text.
    fn read(&mut self, layout: &Layout, body: &str) -> Result<(), RecordingError> {
        let rows = || layout.rows(body);
        let width = layout.names.len();
        self.program = layout.program;
        self.units.clone_from(&layout.units);
        self.above.clone_from(&layout.preamble);
        let seen = self.survey(rows(), layout)?;
        let clocks = seen.iter().enumerate().filter(|(_, seen)| seen.stamps.is_some());
        self.clocks = clocks.map(|(k, _)| k).collect();
        let strange = seen.iter().enumerate().filter_map(|(k, seen)| Some((k, seen.strange.clone()?)));
        self.strange = strange.collect();
        self.name_columns(layout.names.clone())?;
        let mut ways = self.ways(rows(), layout, seen)?;
        let (mut rows, mut cells, mut stepper) = (rows(), Vec::new(), Stepper::default());
        while let Some(line) = rows.next(&mut cells) {
            if cells.len() != layout.width() && is_comment(&cells) {
                continue;
            }
            self.check_width(layout, &cells, line)?;
            layout.complete(&mut cells, &mut stepper).map_err(|reason| self.at(line, None, reason))?;
            for k in 0..width {
                let cell = cells.get(k).map_or("", Cow::as_ref);
                let Some(way) = ways.columns.get_mut(k) else { continue };
                self.take_cell(k, cell, way, ways.form).map_err(|reason| {
                    let header = layout.names.get(k).map(String::as_str);
                    self.at(line, header, reason)
                })?;
            }
            self.lines.push(line);
        }
        if self.lines.is_empty() {
            let reason = "it has a header and no rows".to_owned();
            return Err(RecordingError::NotARecording { name: self.label.to_owned(), reason });
        }
        Ok(())
    }

    fn check_width(&self, layout: &Layout, cells: &[Cow<'_, str>], line: u64) -> Result<(), RecordingError> {
        let width = layout.width();
        let is_rest_empty = cells.iter().skip(width).all(|cell| cell.is_empty());
        if (cells.len() == width || (cells.len() > width && is_rest_empty))
            || (cells.len() < width && layout.may_be_short)
        {
            return Ok(());
        }
        let count = cells.len();
        if !cells.iter().any(|cell| is_number(cell)) {
            let text: String = cells.join(" ").chars().take(40).collect();
            let reason =
                format!("{text:?} is text after the rows of the table: remove the line, or begin it with #");
            return Err(self.at(line, None, reason));
        }
        Err(self.at(
            line,
            None,
            format!(
                "the row has {count} values, the header {width} names: was the file cut off here? remove or \
                 correct the row"
            ),
        ))
    }

    fn take_cell(&mut self, k: usize, cell: &str, way: &mut Way, form: Form) -> Result<(), String> {
        match way {
            Way::Clock(clock) => {
                let ns = Stamp::parse(cell).and_then(|stamp| clock.ns(&stamp)).ok_or_else(|| refuse(cell))?;
                if let Some(Sink::Time { times, .. }) = self.columns.get_mut(k).map(|column| &mut column.sink)
                {
                    times.push(Time::Nanoseconds(ns));
                }
                Ok(())
            }
            Way::Numbers => self.take(k, &form.plain(cell)?),
            Way::Kept => self.take(k, cell),
        }
    }

    /// Examines every cell once.
    fn survey(&self, mut rows: Rows<'_>, layout: &Layout) -> Result<Vec<Seen>, RecordingError> {
        let whole = || Seen { forms: Some(Forms::ALL), stamps: Some(Survey::default()), strange: None };
        let mut all: Vec<Seen> = layout.names.iter().map(|_| whole()).collect();
        let mut cells = Vec::new();
        let mut count = 0;
        while rows.next(&mut cells).is_some() {
            if cells.len() != layout.width() && is_comment(&cells) {
                continue;
            }
            count += 1;
            for (seen, cell) in all.iter_mut().take(layout.width()).zip(&cells) {
                if let Some(survey) = &mut seen.stamps {
                    match Stamp::parse(cell) {
                        Some(stamp) => survey.see(&stamp),
                        // A column that begins as times of day is one; a cell that is none is named then.
                        None if count == 1 => seen.stamps = None,
                        None => {}
                    }
                }
                if seen.stamps.is_some() || cell.is_empty() {
                    continue;
                }
                if let Some(forms) = &mut seen.forms
                    && !forms.see_number(cell)
                {
                    seen.forms = None;
                    seen.strange = (count == 1).then(|| cell.to_string());
                }
            }
        }
        // A column that is made holds no times of day.
        let made = layout.steps.as_ref().and_then(|steps| steps.column);
        let is_made = |k: usize| k >= layout.width() || made == Some(k);
        let columns = all.iter_mut().enumerate().filter(|(k, _)| is_made(*k));
        columns.for_each(|(_, seen)| *seen = Seen::default());
        if count == 0 {
            all.iter_mut().for_each(|seen| *seen = Seen::default());
        }
        Ok(all)
    }

    /// Decides how the cells of each column are read.
    fn ways(&mut self, rows: Rows<'_>, layout: &Layout, seen: Vec<Seen>) -> Result<Ways, RecordingError> {
        let stated = match self.rig.recording.decimal {
            Some(mark) => Some(mark == DecimalMark::Comma),
            None => layout.comma,
        };
        let first = match stated {
            _ if layout.is_plain => Forms::PLAIN,
            Some(comma) => Forms::with_decimal(comma),
            None => Forms::ALL,
        };
        let has_numbers = |k: usize| {
            let sink = self.columns.get(k).map(|column| &column.sink);
            matches!(sink, Some(Sink::Number { .. } | Sink::Time { .. })) && !self.clocks.contains(&k)
        };
        let form = match self.form(rows, layout, first, has_numbers)? {
            Ok(form) => form,
            Err((unclear, forms)) => {
                // Other columns of numbers may show it.
                let others = seen.iter().filter_map(|seen| seen.forms);
                let forms = others.fold(forms, Forms::and);
                forms.form(self.has_points(layout)).map_err(|_| self.unclear(unclear))?
            }
        };
        let mut columns = Vec::new();
        for (k, seen) in seen.into_iter().enumerate() {
            let sink = self.columns.get(k).map(|column| &column.sink);
            let is_all_numbers = seen.forms.is_some_and(|forms| forms.has(form));
            columns.push(match (sink, seen.stamps) {
                (Some(Sink::Time { .. }), Some(survey)) => {
                    let (clock, said) = survey.clock().map_err(|reason| {
                        self.columns_error(format!("column {}: {reason}", layout.names[k]))
                    })?;
                    self.warnings.extend(said.map(|said| format!("column {}: {said}", layout.names[k])));
                    Way::Clock(clock)
                }
                (Some(Sink::Text(_)), _) if !is_all_numbers || form == Form::PLAIN => Way::Kept,
                (Some(Sink::Time { .. }), None) if layout.steps.is_some() => Way::Kept,
                _ => Way::Numbers,
            });
        }
        Ok(Ways { form, columns })
    }

    /// Returns true if numbers with three digits after a point have decimals: by the notation, or because
    /// nothing but a quoted cell could hold a comma.
    fn has_points(&self, layout: &Layout) -> bool {
        let is_own = layout.names.iter().any(|name| Known::parse(name).is_some());
        is_own || layout.separator == Separator::One(b',')
    }

    /// Returns the form that all numbers of the known columns agree with, or the forms that are left.
    fn form(
        &self,
        mut rows: Rows<'_>,
        layout: &Layout,
        mut forms: Forms,
        has_numbers: impl Fn(usize) -> bool,
    ) -> Result<Result<Form, (Unclear, Forms)>, RecordingError> {
        let numbers: Vec<usize> = (0..layout.names.len()).filter(|k| has_numbers(*k)).collect();
        let mut cells = Vec::new();
        while let Some(line) = rows.next(&mut cells) {
            if cells.len() != layout.width() && is_comment(&cells) {
                continue;
            }
            for k in numbers.iter().filter(|k| **k < layout.width()) {
                let Some(cell) = cells.get(*k) else { continue };
                if !forms.see(cell) {
                    let header = layout.names.get(*k).map(String::as_str);
                    return Err(self.at(
                        line,
                        header,
                        format!(
                            "{cell:?} is not a number as those before it are written: decimals have a point, \
                             or a comma, in all of a file; correct it, or remove the row"
                        ),
                    ));
                }
            }
        }
        Ok(forms.form(self.has_points(layout)).map_err(|unclear| (unclear, forms)))
    }

    fn unclear(&self, unclear: Unclear) -> RecordingError {
        let (example, mark) = match unclear {
            Unclear::Comma => ("1,234", "commas"),
            Unclear::Point => ("1.234", "points"),
        };
        self.columns_error(format!(
            "nothing shows whether {example} is more than a thousand or has decimals: all its numbers with \
             {mark} have three digits after them. Write decimal = \"comma\" or decimal = \"point\" in \
             [recording] of its rig file"
        ))
    }
}
