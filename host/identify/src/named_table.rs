//! Small tables that people type: CSV with named columns, `#` before comments.

/// The cells of a table.
#[derive(Clone, Debug)]
pub(crate) struct NamedTable {
    /// Names of the columns.
    pub(crate) header: Vec<String>,
    /// Line in the file and cells of each row.
    pub(crate) rows: Vec<(u64, Vec<String>)>,
}

impl NamedTable {
    /// Reads the text of a file.
    ///
    /// # Errors
    /// Says which line cannot be read, or which column is there twice.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut reader =
            csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).from_reader(text.as_bytes());
        let header: Vec<String> =
            reader.headers().map_err(|error| error.to_string())?.iter().map(str::to_owned).collect();
        for (k, name) in header.iter().enumerate() {
            if header.iter().take(k).any(|other| other == name) {
                return Err(format!("column {name} is there twice"));
            }
        }
        let mut rows = Vec::new();
        for record in reader.records() {
            let record = record.map_err(|error| error.to_string())?;
            let line = record.position().map_or(0, csv::Position::line);
            rows.push((line, record.iter().map(str::to_owned).collect()));
        }
        Ok(Self { header, rows })
    }

    /// Returns the place of a column by its name.
    pub(crate) fn column(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|own| own == name)
    }
}
