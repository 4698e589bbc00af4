//! MOT and STO: columns over time as text.

use super::error::{OpenSimError, at, number};

/// A table over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Storage {
    /// Its name: the first line.
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

impl Storage {
    /// Reads a file. Without a line that says so angles are in degrees if one says that in words. The header's number of columns is
    /// not looked at: programs leave an old one there, and the names say it.
    ///
    /// # Errors
    /// It has no header, is cut off, or contradicts itself.
    pub fn parse(text: &str) -> Result<Self, OpenSimError> {
        let mut lines = text.lines().enumerate().map(|(k, line)| (k + 1, line));
        let (mut rows, mut in_degrees, mut name) = (None, None, String::new());
        let mut in_words = false;
        loop {
            let (line, text) = lines.next().ok_or_else(|| {
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
                "nrows" | "datarows" => rows = Some(count()?),
                "indegrees" => in_degrees = Some(value.trim().eq_ignore_ascii_case("yes")),
                _ => {}
            }
        }
        let names = lines.by_ref().find(|(_, text)| !text.trim().is_empty());
        let (line, names) = names.ok_or_else(|| {
            OpenSimError::Missing("the file ends before the names of its columns".to_owned())
        })?;
        let mut columns: Vec<String> = names.split_whitespace().map(str::to_owned).collect();
        if !columns.first().is_some_and(|first| first.eq_ignore_ascii_case("time")) {
            return Err(at(line, "the first column is not time"));
        }
        columns.remove(0);
        let mut table = Self {
            name,
            in_degrees: in_degrees.unwrap_or(in_words),
            columns,
            times_s: Vec::new(),
            values: Vec::new(),
        };
        for (line, text) in lines.filter(|(_, text)| !text.trim().is_empty()) {
            table.row(text, line)?;
        }
        if rows.is_some_and(|rows| rows != table.times_s.len()) {
            return Err(OpenSimError::Missing(format!(
                "{} rows, and the header says {}: the file is cut off, or its header is of another",
                table.times_s.len(),
                rows.unwrap_or(0)
            )));
        }
        Ok(table)
    }

    fn row(&mut self, text: &str, line: usize) -> Result<(), OpenSimError> {
        let mut cells = text.split_whitespace();
        let time = number(cells.next().unwrap_or_default(), line, "the time")?;
        if !time.is_finite() || self.times_s.last().is_some_and(|last| *last >= time) {
            return Err(at(line, format!("the time {time} s is not after the one before")));
        }
        let before = self.values.len();
        for cell in cells {
            self.values.push(number(cell, line, "a value")?);
        }
        let count = self.values.len() - before;
        if count != self.columns.len() {
            return Err(at(line, format!("{count} values for {} columns", self.columns.len())));
        }
        self.times_s.push(time);
        Ok(())
    }

    /// Returns the values of a column over time.
    pub fn column(&self, name: &str) -> Option<impl Iterator<Item = f64> + '_> {
        let k = self.columns.iter().position(|c| c == name)?;
        Some(self.values.iter().skip(k).step_by(self.columns.len().max(1)).copied())
    }
}
