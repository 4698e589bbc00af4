//! MOT and STO: columns over time as text.

use std::io::BufRead;

use super::error::{OpenSimError, at, number};
use super::lines::Lines;

/// A table over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Storage {
    /// The name of the table: the first line.
    pub name: String,
    /// Angles are in degrees.
    pub in_degrees: bool,
    /// Names of the columns after `time`, as they are in the file.
    pub columns: Vec<String>,
    /// Times of the rows, s.
    pub times_s: Vec<f64>,
    /// Values, row by row.
    pub values: Vec<f64>,
}

/// Goes through the rows of a file.
pub struct Rows<R> {
    /// The name of the table: the first line.
    pub name: String,
    /// Angles are in degrees.
    pub in_degrees: bool,
    /// Names of the columns after `time`, as they are in the file.
    pub columns: Vec<String>,
    lines: Lines<R>,
    values: Vec<f64>,
    last_s: Option<f64>,
    /// Rows that were read, and as the header says it.
    count: usize,
    expected: Option<usize>,
}

impl<R: BufRead> Rows<R> {
    /// Reads the header. Without a line that says so angles are in degrees if one says that in words. The
    /// header's number of columns is not examined: programs leave an old one there, and the names say it.
    ///
    /// # Errors
    /// There is none, or it is cut off.
    pub fn new(reader: R) -> Result<Self, OpenSimError> {
        let mut lines = Lines::new(reader);
        let (mut expected, mut in_degrees, mut name) = (None, None, String::new());
        let mut in_words = false;
        loop {
            let (line, text) = lines.next()?.ok_or_else(|| {
                OpenSimError::Missing("no line says endheader: this is no MOT or STO file".to_owned())
            })?;
            let text = text.trim();
            if line == 1 {
                text.clone_into(&mut name);
            }
            in_words |= text.eq_ignore_ascii_case("Angles are in degrees.");
            if text.eq_ignore_ascii_case("endheader") {
                break;
            }
            let Some((key, value)) = text.split_once('=') else { continue };
            let count =
                || value.trim().parse::<usize>().map_err(|_| at(line, format!("{text:?} has no count")));
            match key.trim().to_ascii_lowercase().as_str() {
                "nrows" | "datarows" => expected = Some(count()?),
                "indegrees" => in_degrees = Some(value.trim().eq_ignore_ascii_case("yes")),
                _ => {}
            }
        }
        let (line, names) = lines.next_filled()?.ok_or_else(|| {
            OpenSimError::Missing("the file ends before the names of its columns".to_owned())
        })?;
        let mut columns: Vec<String> = names.split_whitespace().map(str::to_owned).collect();
        if !columns.first().is_some_and(|first| first.eq_ignore_ascii_case("time")) {
            return Err(at(line, "the first column is not time"));
        }
        columns.remove(0);
        let in_degrees = in_degrees.unwrap_or(in_words);
        let values = Vec::with_capacity(columns.len());
        Ok(Self { name, in_degrees, columns, lines, values, last_s: None, count: 0, expected })
    }

    /// Returns time, s, and values of the next row; `None` at the end.
    ///
    /// # Errors
    /// The row is none, or there are other rows than the header says.
    pub fn next_row(&mut self) -> Result<Option<(f64, &[f64])>, OpenSimError> {
        let Some((line, text)) = self.lines.next_filled()? else {
            return match self.expected.filter(|expected| *expected != self.count) {
                Some(expected) => Err(OpenSimError::Missing(format!(
                    "{} rows, and the header says {expected}: the file is cut off, or its header is of \
                     another",
                    self.count
                ))),
                None => Ok(None),
            };
        };
        let mut cells = text.split_whitespace();
        let time = number(cells.next().unwrap_or_default(), line, "the time")?;
        if !time.is_finite() || self.last_s.is_some_and(|last| last >= time) {
            return Err(at(line, format!("the time {time} s is not after the one before")));
        }
        self.values.clear();
        for cell in cells {
            self.values.push(number(cell, line, "a value")?);
        }
        let count = self.values.len();
        if count != self.columns.len() {
            return Err(at(line, format!("{count} values for {} columns", self.columns.len())));
        }
        self.last_s = Some(time);
        self.count += 1;
        Ok(Some((time, &self.values)))
    }
}

impl Storage {
    /// Reads a text: see [`Rows`].
    ///
    /// # Errors
    /// It has no header, is cut off, or contradicts itself.
    pub fn parse(text: &str) -> Result<Self, OpenSimError> {
        let mut rows = Rows::new(text.as_bytes())?;
        let mut table = Self {
            name: rows.name.clone(),
            in_degrees: rows.in_degrees,
            columns: rows.columns.clone(),
            times_s: Vec::new(),
            values: Vec::new(),
        };
        while let Some((time, values)) = rows.next_row()? {
            table.times_s.push(time);
            table.values.extend_from_slice(values);
        }
        Ok(table)
    }
}
