//! Writing a recording as CSV.

use std::collections::HashMap;
use std::io::Write;

use crate::recording::Recording;
use crate::recording::columns::Known;
use crate::recording::text::one_line;
use crate::recording::time;

impl Recording {
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

    /// Returns the text that [`Recording::write_csv`] writes.
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

/// Returns what the system said, as it said it: a full disk is distinguished from other failures by its kind.
fn of_system(error: csv::Error) -> std::io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => std::io::Error::other(format!("{other:?}")),
    }
}
