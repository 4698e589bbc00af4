//! Recordings as tables of columns: Parquet, MAT and TDMS files. Their columns are read as those of a CSV
//! are.
//!
//! Lives here: how the files hold columns. May not live here: what columns mean ([`super::csv`]).

mod mat;
mod parquet;
mod tdms;

use super::columns::Cells;
use super::error::RecordingError;
use crate::rig::{ColumnSource, RigFile};

/// The size of unpacked data may be this many times as large as the file, as of an MCAP file's chunks.
const MOST_TIMES: usize = 64;
/// The room for the unpacked data of a small file, bytes.
const LEAST_ROOM: usize = 256 << 20;
/// Memory of a cell beside its text, bytes.
const CELL: usize = 48;

/// The bytes that a file's columns may still take.
pub(super) struct Room(usize);

impl Room {
    pub(super) fn of_file(bytes: usize) -> Self {
        Self(bytes.saturating_mul(MOST_TIMES).saturating_add(LEAST_ROOM))
    }

    pub(super) fn take(&mut self, bytes: usize) -> Result<(), String> {
        self.0 = self.0.checked_sub(bytes).ok_or(
            "it unpacks to far more than a recording of its size: it is packed in a way that no recording is",
        )?;
        Ok(())
    }

    /// Takes room for cells of `bytes` of text in all.
    pub(super) fn take_cells(&mut self, count: usize, bytes: usize) -> Result<(), String> {
        self.take(count.saturating_mul(CELL).saturating_add(bytes))
    }
}

/// Returns true for the ending of a file of columns.
pub(super) fn is_columnar(ending: &str) -> bool {
    matches!(ending, "parquet" | "mat" | "tdms")
}

/// The content of a file.
#[derive(Debug, Default)]
pub(super) struct Table {
    /// The columns of the file.
    pub(super) columns: Vec<Cells>,
    /// Columns that the file says are times, which are in s here, with the unit that they have in the file,
    /// s.
    pub(super) times: Vec<(String, f64)>,
    /// Units of its columns, as far as the file says; empty where it cannot.
    pub(super) units: Vec<Option<String>>,
    /// The file's statements about itself, line by line.
    pub(super) above: Vec<String>,
    /// The parts left out of it.
    pub(super) warnings: Vec<String>,
}

impl Table {
    /// Returns a rig file as it fits the columns here: a scale of a time that says what the file says is
    /// applied already.
    ///
    /// # Errors
    /// [`RecordingError::Columns`] if it says something else.
    pub(super) fn rig(&self, label: &str, rig: &RigFile) -> Result<RigFile, RecordingError> {
        let mut rig = rig.clone();
        for source in rig.recording.columns.values_mut() {
            let (name, scale) = source.parts();
            let Some((_, unit)) = self.times.iter().find(|(own, _)| own == name) else { continue };
            if scale == *unit {
                *source = ColumnSource::Name(name.to_owned());
            } else if scale != 1.0 {
                return Err(RecordingError::Columns {
                    name: label.to_owned(),
                    reason: format!(
                        "the rig file scales column {name:?} by {scale:?}, and the file itself says that its \
                         unit is {unit:?} s: leave the scale out"
                    ),
                });
            }
        }
        Ok(rig)
    }
}

/// Returns the columns of a file.
///
/// # Errors
/// [`RecordingError::NotARecording`] says why there are none to be had.
pub(super) fn columns(label: &str, ending: &str, bytes: Vec<u8>) -> Result<Table, RecordingError> {
    let table = match ending {
        "parquet" => parquet::table(bytes),
        "tdms" => tdms::table(&bytes),
        _ => mat::table(&bytes),
    };
    table.map_err(|reason| RecordingError::NotARecording { name: label.to_owned(), reason })
}

/// Returns a number with the digits that are needed to read the same number back.
fn number(value: f64) -> String {
    format!("{value:?}")
}

#[cfg(test)]
mod tests;
