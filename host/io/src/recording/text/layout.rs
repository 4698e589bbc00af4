//! The place of the header of a table, the separator of its cells, and the lines that are no rows.

use std::borrow::Cow;

use super::clock::Stamp;
use super::decimal;
use super::rows::{Rows, Separator};
use crate::rig::Unit;

/// Bytes and rows from which the layout is found.
const SAMPLE: usize = 256 << 10;
const MOST_ROWS: usize = 600;
/// Lines above the rows in which names, groups of names and units are sought.
const MOST_HEADERS: usize = 4;
/// The possible separators of cells; of equally good ones the first is taken.
const SEPARATORS: [Separator; 5] = [
    Separator::One(b'\t'),
    Separator::One(b';'),
    Separator::One(b'|'),
    Separator::One(b','),
    Separator::Blanks,
];

/// A table in a text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layout {
    /// The separator of its cells.
    pub(crate) separator: Separator,
    /// Names of its columns.
    pub(crate) names: Vec<String>,
    /// Units of its columns, as far as a row of units says.
    pub(crate) units: Vec<Option<String>>,
    /// Lines before the header that are not empty.
    pub(crate) preamble: Vec<String>,
    /// The place where the rows begin: bytes from the text's beginning.
    pub(crate) body: usize,
    /// The number of that line.
    pub(crate) line: u64,
    /// The file says that decimals have a comma, or a point.
    pub(crate) comma: Option<bool>,
    /// Numbers have a point before their decimals and nothing between thousands.
    pub(crate) is_plain: bool,
    /// A row may lack its last cells.
    pub(crate) may_be_short: bool,
    /// The way the time of a row is made, where no column has it.
    pub(crate) steps: Option<Steps>,
    /// The place where its rows end: bytes from the text's beginning; `None` of a text that ends with them.
    pub(crate) end: Option<usize>,
    /// The program that wrote it, where the file shows that and its own way of writing counts.
    pub(crate) program: Option<&'static str>,
    /// Counts for a unit, column by column, by which the cells are divided; empty where cells are in units.
    pub(crate) counts: Vec<Option<f64>>,
}

/// Times of rows that are written nowhere: `start_s + step_s n`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Steps {
    pub(crate) start_s: f64,
    pub(crate) step_s: f64,
    /// The column that the time takes the place of; `None`: one after the others, which the file does not
    /// have.
    pub(crate) column: Option<usize>,
    /// The columns that count n from the first row on; `None`: n is the number of the row.
    pub(crate) counter: Option<Counter>,
}

/// Columns that count the readings of a device.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Counter {
    pub(crate) column: usize,
    /// A column that counts within one count of the other, and how many there are in it.
    pub(crate) within: Option<(usize, u64)>,
    /// It begins at zero again after this many.
    pub(crate) wraps_at: u64,
}

/// Makes the times of rows one after the other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stepper {
    rows: u64,
    first: Option<u64>,
    before: u64,
    turns: u64,
}

impl Stepper {
    /// Returns the time of the next row, s, as text.
    ///
    /// # Errors
    /// The counter is no whole number, or runs backwards.
    pub(crate) fn next(&mut self, steps: &Steps, cells: &[Cow<'_, str>]) -> Result<String, String> {
        let row = self.rows;
        self.rows += 1;
        let Some(counter) = &steps.counter else {
            return Ok(format!("{:.9}", steps.start_s + steps.step_s * row as f64));
        };
        let of = |column: usize| {
            let cell = cells.get(column).map_or("", Cow::as_ref);
            cell.parse::<u64>().map_err(|_| format!("{cell:?} is not a number that counts readings"))
        };
        let whole = of(counter.column)?;
        if self.first.is_some() && whole < self.before {
            // It has begun anew if it was near its end.
            if self.before < counter.wraps_at / 4 * 3 || whole > counter.wraps_at / 4 {
                return Err(format!("the count of readings runs backwards, from {} to {whole}", self.before));
            }
            self.turns += 1;
        }
        self.before = whole;
        let count = self.turns.saturating_mul(counter.wraps_at).saturating_add(whole);
        let count = match counter.within {
            Some((column, parts)) => count.saturating_mul(parts).saturating_add(of(column)?),
            None => count,
        };
        let first = *self.first.get_or_insert(count);
        Ok(format!("{:.9}", steps.start_s + steps.step_s * count.saturating_sub(first) as f64))
    }
}

/// A line of the sample.
pub(super) struct Line<'a> {
    /// The place where it begins, with the line's number, and where the next one does.
    pub(super) from: (usize, u64),
    to: usize,
    pub(super) cells: Vec<Cow<'a, str>>,
    numbers: usize,
    others: usize,
}

impl Line<'_> {
    fn is_row(&self) -> bool {
        self.numbers >= 2 && self.numbers > self.others
    }

    /// Cells without empty ones at the end.
    pub(super) fn width(&self) -> usize {
        self.cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1)
    }

    /// Returns true if it names a table's columns.
    fn is_header(&self, width: usize) -> bool {
        let named = self.cells.iter().filter(|cell| !cell.is_empty()).count();
        self.width() == width && 2 * self.others > named
    }
}

/// Returns true for a line of a comment.
pub(crate) fn is_comment(cells: &[Cow<'_, str>]) -> bool {
    cells.first().is_some_and(|cell| cell.starts_with(['#', '%']) || cell.starts_with("//"))
}

/// Returns true if a cell is a number in some form, or a time of day.
pub(super) fn is_number(cell: &str) -> bool {
    decimal::is_number(cell) || Stamp::parse(cell).is_some()
}

/// Returns true if cells are the units of columns: `[s]`, `N`, `-`.
pub(super) fn are_units(cells: &[Cow<'_, str>]) -> bool {
    let is_unit = |cell: &str| Unit::parse(cell).is_some();
    let is_bracketed = |cell: &str| {
        (cell.starts_with('[') && cell.ends_with(']')) || (cell.starts_with('(') && cell.ends_with(')'))
    };
    let others = |cell: &str| cell.is_empty() || cell == "-" || is_bracketed(cell);
    cells.iter().filter(|cell| is_unit(cell)).count() >= 2
        && cells.iter().all(|cell| is_unit(cell) || others(cell))
}

/// Returns a row of units as each column's.
pub(super) fn units(cells: &[Cow<'_, str>], width: usize) -> Vec<Option<String>> {
    let bare = |cell: &Cow<'_, str>| {
        let text = cell.trim().trim_matches(['[', ']', '(', ')']).trim().to_owned();
        Some(text).filter(|text| !text.is_empty() && text != "-")
    };
    (0..width).map(|k| cells.get(k).and_then(bare)).collect()
}

impl Layout {
    /// Returns the layout of a text whose first row holds known names, cut by `separator`; `None` if it does
    /// not. A row of units may follow.
    pub(crate) fn of_header(
        text: &str,
        line: u64,
        separator: u8,
        is_known: impl Fn(&str) -> bool,
    ) -> Option<Self> {
        let separator = Separator::One(separator);
        let mut rows = Rows::new(text, line, separator);
        let mut cells = Vec::new();
        rows.next(&mut cells)?;
        if !cells.iter().any(|name| is_known(name)) {
            return None;
        }
        let mut names: Vec<String> = cells.iter().map(|name| name.to_string()).collect();
        let mut place = rows.place();
        let is_empty = |last: Option<&str>| last.is_none_or(str::is_empty);
        let is_more = rows.next(&mut cells).is_some();
        // A separator at the end makes no column, unless rows have a cell there.
        let last = cells.get(names.len().wrapping_sub(1)).map(Cow::as_ref);
        if is_more && names.len() > 1 && is_empty(names.last().map(String::as_str)) && is_empty(last) {
            names.pop();
        }
        let mut own = vec![None; names.len()];
        if is_more && cells.len() <= names.len() + 1 && are_units(&cells) {
            (place, own) = (rows.place(), units(&cells, names.len()));
        }
        Some(Self::new(separator, names, own, Vec::new(), place))
    }

    pub(super) fn new(
        separator: Separator,
        names: Vec<String>,
        units: Vec<Option<String>>,
        preamble: Vec<String>,
        (body, line): (usize, u64),
    ) -> Self {
        Self {
            separator,
            names,
            units,
            preamble,
            body,
            line,
            comma: None,
            is_plain: false,
            may_be_short: false,
            steps: None,
            end: None,
            program: None,
            counts: Vec::new(),
        }
    }

    /// Returns the rows of the text that the layout was found in.
    pub(crate) fn rows<'a>(&self, text: &'a str) -> Rows<'a> {
        let end = self.end.unwrap_or(text.len());
        Rows::new(text.get(self.body..end).unwrap_or_default(), self.line, self.separator)
    }

    /// Puts the time that is made into the cells of a row, and divides what is in counts.
    ///
    /// # Errors
    /// Says why no time can be made.
    pub(crate) fn complete(
        &self,
        cells: &mut Vec<Cow<'_, str>>,
        stepper: &mut Stepper,
    ) -> Result<(), String> {
        for (cell, counts) in cells.iter_mut().zip(&self.counts) {
            if let (Some(counts), Ok(value)) = (counts, cell.parse::<f64>()) {
                *cell = Cow::Owned(format!("{:?}", value / counts));
            }
        }
        let Some(steps) = &self.steps else { return Ok(()) };
        let time = stepper.next(steps, cells)?;
        let place = steps.column.unwrap_or(self.width());
        cells.resize(self.names.len().max(place + 1), Cow::Borrowed(""));
        if let Some(cell) = cells.get_mut(place) {
            *cell = Cow::Owned(time);
        }
        Ok(())
    }

    /// Returns how many cells a row of the file has: all columns but one that is made.
    pub(crate) fn width(&self) -> usize {
        let made = self.steps.as_ref().is_some_and(|steps| steps.column.is_none());
        self.names.len() - usize::from(made && !self.names.is_empty())
    }

    /// Finds the table in a text; `line` is its first line's number, `above` the last line of comment before
    /// it. `None` if nothing in it resembles a table of numbers with names.
    ///
    /// # Errors
    /// Says what is wrong with a file that names its own layout.
    pub(crate) fn find(text: &str, line: u64, above: Option<&str>) -> Result<Option<Self>, String> {
        if let Some(found) = super::lvm::find(text, line) {
            return found.map(Some);
        }
        if let Some(found) = super::vendors::find(text, line) {
            return found.map(Some);
        }
        let mut best: Option<(f64, Self)> = None;
        for separator in SEPARATORS {
            if let Some((score, layout)) = Self::by(text, line, separator, above)
                && best.as_ref().is_none_or(|(most, _)| score > *most)
            {
                best = Some((score, layout));
            }
        }
        Ok(best.map(|(_, layout)| layout))
    }

    /// Finds the table by one separator, with how good it is.
    fn by(text: &str, line: u64, separator: Separator, above: Option<&str>) -> Option<(f64, Self)> {
        let lines = sample(text, line, separator);
        let (start, end) = longest_run(&lines)?;
        let run = lines.get(start..end)?;
        let width = run.iter().map(Line::width).max()?;
        let numbers: usize = run.iter().map(|line| line.numbers).sum();
        let others: usize = run.iter().map(|line| line.others).sum();
        let score = numbers as f64 - 3.0 * others as f64;
        let header =
            |k: usize| start.checked_sub(k).and_then(|at| lines.get(at)).filter(|_| k <= MOST_HEADERS);
        // A row of units is below or above the names.
        let is_units =
            |line: Option<&Line<'_>>| line.is_some_and(|l| l.width() <= width && are_units(&l.cells));
        let is_header = |line: Option<&Line<'_>>| line.is_some_and(|line| line.is_header(width));
        let (named, united) = if is_units(header(1)) && is_header(header(2)) {
            (2, Some(1))
        } else if is_header(header(1)) {
            (1, is_units(header(2)).then_some(2))
        } else {
            (0, None)
        };
        let own = units(united.and_then(header).map_or(&[], |line| &line.cells), width);
        let body = run.first()?.from;
        let (names, top) = match header(named).filter(|_| named > 0) {
            Some(line) => {
                let group = header(named.max(united.unwrap_or(0)) + 1);
                let group = group.filter(|group| group.width() <= width && group.numbers == 0);
                (names(&line.cells, group.map(|group| group.cells.as_slice()), width), line.from.0)
            }
            // As numpy writes it: names in a comment.
            None => {
                let comment = header(1)
                    .filter(|line| is_comment(&line.cells))
                    .map(|line| text.get(line.from.0..line.to).unwrap_or_default());
                let names =
                    comment.or(above.filter(|_| start == 0)).and_then(|c| commented(c, separator, width));
                (names?, body.0)
            }
        };
        let top = header(united.unwrap_or(0)).map_or(top, |line| line.from.0.min(top));
        let above = text.get(..top).unwrap_or_default().lines().map(str::trim);
        let preamble = above.filter(|line| !line.is_empty()).map(str::to_owned).collect();
        Some((score, Self::new(separator, names, own, preamble, body)))
    }
}

/// Cuts the beginning of a text.
pub(super) fn sample(text: &str, line: u64, separator: Separator) -> Vec<Line<'_>> {
    let end = (0..=SAMPLE.min(text.len())).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0);
    let part = text.get(..end).unwrap_or_default();
    let mut rows = Rows::new(part, line, separator);
    let mut lines: Vec<Line<'_>> = Vec::new();
    loop {
        let (from, mut cells) = (rows.place(), Vec::new());
        if lines.len() >= MOST_ROWS || rows.next(&mut cells).is_none() {
            break;
        }
        let filled = cells.iter().filter(|cell| !cell.is_empty());
        let numbers =
            if is_comment(&cells) { 0 } else { filled.clone().filter(|cell| is_number(cell)).count() };
        let others = filled.count() - numbers;
        lines.push(Line { from, to: rows.place().0, cells, numbers, others });
    }
    // The last line may be cut.
    if end < text.len() && lines.len() > 2 {
        lines.pop();
    }
    lines
}

/// Returns the longest run of rows of one width.
pub(super) fn longest_run(lines: &[Line<'_>]) -> Option<(usize, usize)> {
    let (mut best, mut k) = (None, 0);
    while k < lines.len() {
        let first = lines.get(k)?;
        if !first.is_row() {
            k += 1;
            continue;
        }
        let start = k;
        let count = first.cells.len();
        while let Some(line) = lines.get(k)
            && (is_comment(&line.cells) || (line.is_row() && line.cells.len() == count))
        {
            k += 1;
        }
        if best.is_none_or(|(from, to): (usize, usize)| k - start > to - from) {
            best = Some((start, k));
        }
    }
    best
}

/// Returns the names of columns; those that are empty or there twice begin with the group above them.
pub(super) fn names(cells: &[Cow<'_, str>], group: Option<&[Cow<'_, str>]>, width: usize) -> Vec<String> {
    let cell = |k: usize| cells.get(k).map_or("", |cell| cell.as_ref());
    let is_clear = |k: usize| !cell(k).is_empty() && (0..width).filter(|j| cell(*j) == cell(k)).count() == 1;
    let mut above = "";
    (0..width)
        .map(|k| {
            above = group.and_then(|g| g.get(k)).map(Cow::as_ref).filter(|g| !g.is_empty()).unwrap_or(above);
            match (is_clear(k), cell(k), above) {
                (true, name, _) => name.to_owned(),
                (false, "", "") => format!("column {}", k + 1),
                (false, name, above) => format!("{above} {name}").trim().to_owned(),
            }
        })
        .collect()
}

/// Returns the names in a line of comment; `None` if there are not as many as columns.
fn commented(line: &str, separator: Separator, width: usize) -> Option<Vec<String>> {
    let bare = line.trim().trim_start_matches(['#', '%', '/']).trim();
    let mut cells = Vec::new();
    Rows::new(bare, 1, separator).next(&mut cells)?;
    let are_names = cells.len() == width && cells.iter().all(|cell| !cell.is_empty() && !is_number(cell));
    are_names.then(|| cells.iter().map(|cell| cell.to_string()).collect())
}
