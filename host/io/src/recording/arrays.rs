//! Recordings from columns in memory: read as the same columns of a CSV file are, so that the numbers are the
//! same.

use std::fmt::Write as _;

use super::columnar::Table;
use super::columns::Cells;
use super::csv::Reader;
use super::{Recording, RecordingError};
use crate::rig::RigFile;

/// Holds the numbers of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Numbers<'a> {
    /// Floating-point numbers.
    Floats(&'a [f64]),
    /// Whole numbers, as stamps in nanoseconds are.
    Integers(&'a [i64]),
    /// Cells as text, empty where there is no value.
    Cells(&'a [String]),
}

impl Numbers<'_> {
    /// Returns how many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Floats(numbers) => numbers.len(),
            Self::Integers(numbers) => numbers.len(),
            Self::Cells(cells) => cells.len(),
        }
    }

    /// Returns true if there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Puts number `row` into `cell` with as many digits as it takes to read the same number back.
    fn write(&self, row: usize, cell: &mut String) {
        cell.clear();
        // Writing into memory has no way to fail.
        let _ = match self {
            Self::Floats(numbers) => numbers.get(row).map(|number| write!(cell, "{number:?}")),
            Self::Integers(numbers) => numbers.get(row).map(|number| write!(cell, "{number}")),
            Self::Cells(cells) => cells.get(row).map(|text| cell.write_str(text)),
        };
    }
}

impl Recording {
    /// Makes a recording of columns, names with their numbers; `name` is the recording's. `text` is that of
    /// the rig file, if there is one.
    ///
    /// # Errors
    /// [`RecordingError::Columns`] if columns are of different lengths, or not those of a recording;
    /// [`RecordingError::Cell`] with column and index if a number is not finite, or times do not increase.
    pub fn from_arrays(
        name: &str,
        arrays: &[(String, Numbers<'_>)],
        rig: &RigFile,
        text: Option<&str>,
    ) -> Result<Self, RecordingError> {
        let mut recording = Self::of_columns(name, arrays, rig)?;
        recording.rig_text = text.map(str::to_owned);
        if text.is_none() && !recording.imus.is_empty() {
            recording.warnings.push(
                "no rig is given: the IMU is taken to sit in the origin of S with its axes, the wrench to be \
                 that on the body"
                    .to_owned(),
            );
        }
        Ok(recording)
    }

    /// Makes a recording from columns as [`Recording::from_arrays`] does, with no remark about a rig file.
    ///
    /// # Errors
    /// Fails as [`Recording::from_arrays`] does.
    pub fn of_columns(
        name: &str,
        arrays: &[(String, Numbers<'_>)],
        rig: &RigFile,
    ) -> Result<Self, RecordingError> {
        Self::read_columns(name, arrays, Reader::new(name, rig.clone(), Vec::new()))
    }

    /// Reads columns by a reader that knows what else is said of them.
    fn read_columns(
        name: &str,
        arrays: &[(String, Numbers<'_>)],
        mut reader: Reader<'_>,
    ) -> Result<Self, RecordingError> {
        let rows = arrays.first().map_or(0, |(_, numbers)| numbers.len());
        if let (Some((first, _)), Some((other, numbers))) =
            (arrays.first(), arrays.iter().find(|(_, numbers)| numbers.len() != rows))
        {
            return Err(RecordingError::Columns {
                name: name.to_owned(),
                reason: format!(
                    "column {other} has {} rows and column {first} has {rows}: give all columns the same \
                     rows",
                    numbers.len()
                ),
            });
        }
        if rows == 0 {
            let reason = "there are no rows in its columns".to_owned();
            return Err(RecordingError::NotARecording { name: name.to_owned(), reason });
        }
        reader.name_columns(arrays.iter().map(|(name, _)| name.clone()).collect())?;
        let mut cell = String::new();
        for (column, (column_name, numbers)) in arrays.iter().enumerate() {
            for row in 0..rows {
                numbers.write(row, &mut cell);
                reader.take(column, &cell).map_err(|reason| RecordingError::Cell {
                    name: name.to_owned(),
                    index: row as u64,
                    column: column_name.clone(),
                    reason,
                })?;
            }
        }
        reader.into_recording(false)
    }

    /// Makes a recording from columns of cells.
    ///
    /// # Errors
    /// Fails as [`Recording::from_arrays`] does.
    pub fn of_cells(name: &str, columns: &[Cells], rig: &RigFile) -> Result<Self, RecordingError> {
        let columns: Vec<_> =
            columns.iter().map(|(name, cells)| (name.clone(), Numbers::Cells(cells))).collect();
        Self::of_columns(name, &columns, rig)
    }

    /// Makes a recording from a file's table.
    ///
    /// # Errors
    /// Fails as [`Recording::from_arrays`] does.
    pub(super) fn of_table(name: &str, table: Table, rig: &RigFile) -> Result<Self, RecordingError> {
        let rig = table.rig(name, rig)?;
        // What the file says to be times is in s here, whatever unit a name has.
        let is_time = |name: &String| table.times.iter().any(|(own, _)| own == name);
        let times = table.columns.iter().enumerate().filter(|(_, (name, _))| is_time(name)).map(|(k, _)| k);
        let times = times.collect();
        let reader = Reader::new(name, rig, Vec::new()).with_words(table.units, table.above, times);
        let columns = table.columns.iter().map(|(name, cells)| (name.clone(), Numbers::Cells(cells)));
        let mut recording = Self::read_columns(name, &columns.collect::<Vec<_>>(), reader)?;
        recording.warnings.extend(table.warnings);
        Ok(recording)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 7] = ["t_s", "fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"];

    fn columns(rows: usize) -> Vec<Vec<f64>> {
        let number = |k: usize, row: usize| match k {
            0 => row as f64 * 0.001 + 1.0 / 3.0,
            k => ((row * 7 + k) as f64).sin() * 10.0,
        };
        (0..NAMES.len()).map(|k| (0..rows).map(|row| number(k, row)).collect()).collect()
    }

    fn of(columns: &[Vec<f64>]) -> Result<Recording, RecordingError> {
        let arrays: Vec<_> =
            NAMES.iter().zip(columns).map(|(n, c)| ((*n).to_owned(), Numbers::Floats(c))).collect();
        Recording::from_arrays("run", &arrays, &RigFile::default(), None)
    }

    #[test]
    fn arrays_are_the_bits_of_the_same_csv() {
        let columns = columns(50);
        let from_arrays = of(&columns).unwrap();
        let mut text = NAMES.join(",");
        for row in 0..50 {
            text.push('\n');
            text += &columns.iter().map(|c| format!("{:?}", c[row])).collect::<Vec<_>>().join(",");
        }
        let from_csv = Recording::from_csv_bytes("run.csv", text.as_bytes(), &RigFile::default()).unwrap();
        assert_eq!(Recording { order: Vec::new(), ..from_csv }, from_arrays);
        // Stamps in whole nanoseconds keep every digit.
        let stamps: Vec<i64> = (0..50).map(|k| 1_700_000_000_000_000_001 + k * 1_000_000).collect();
        let rig =
            RigFile::parse("[recording]\ncolumns = { t_s = { name = \"stamp\", scale = 1e-9 } }\n").unwrap();
        let mut arrays = vec![("stamp".to_owned(), Numbers::Integers(&stamps))];
        arrays
            .extend(NAMES[1..].iter().zip(&columns[1..]).map(|(n, c)| ((*n).to_owned(), Numbers::Floats(c))));
        let stamped = Recording::from_arrays("run", &arrays, &rig, None).unwrap();
        assert_eq!(stamped.time_ns[0], 1_700_000_000_000_000_001);
    }

    #[test]
    fn faults_are_reported_with_column_and_index() {
        let good = columns(20);
        let mut bad = good.clone();
        bad[3][17] = f64::NAN;
        let error = of(&bad).unwrap_err();
        assert!(
            matches!(&error, RecordingError::Cell { index: 17, column, .. } if column == "fz_n"),
            "{error}"
        );
        let mut bad = good.clone();
        bad[0][9] = bad[0][8];
        let error = of(&bad).unwrap_err();
        assert!(
            matches!(&error, RecordingError::Cell { index: 9, column, .. } if column == "t_s"),
            "{error}"
        );
        let mut bad = good.clone();
        bad[5].pop();
        assert!(
            matches!(of(&bad).unwrap_err(), RecordingError::Columns { reason, .. } if reason.contains("my_nm"))
        );
        let empty = vec![Vec::new(); NAMES.len()];
        assert!(matches!(of(&empty).unwrap_err(), RecordingError::NotARecording { .. }));
        let arrays =
            [("t_s".to_owned(), Numbers::Floats(&good[0])), ("fx_lbf".to_owned(), Numbers::Floats(&good[1]))];
        let error = Recording::from_arrays("run", &arrays, &RigFile::default(), None).unwrap_err();
        assert!(error.to_string().contains("fx_n"), "{error}");
    }
}
