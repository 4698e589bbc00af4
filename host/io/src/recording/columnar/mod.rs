//! Recordings as tables of columns: Parquet and MAT files. Their columns are read as those of a CSV are.
//!
//! Lives here: how the files hold columns. May not live here: what columns mean ([`super::csv`]).

mod mat;
mod parquet;

use super::columns::Cells;
use super::error::RecordingError;

/// What is unpacked of a file may be this many times as large as the file, as of an MCAP file's chunks.
const MOST_TIMES: usize = 64;
/// What is unpacked of a small file, bytes.
const LEAST_ROOM: usize = 256 << 20;
/// Memory of a cell beside its text, bytes.
const CELL: usize = 48;

/// The bytes that a file's columns may still take.
struct Room(usize);

impl Room {
    fn of_file(bytes: usize) -> Self {
        Self(bytes.saturating_mul(MOST_TIMES).saturating_add(LEAST_ROOM))
    }

    fn take(&mut self, bytes: usize) -> Result<(), String> {
        self.0 = self.0.checked_sub(bytes).ok_or(
            "it unpacks to far more than a recording of its size: it is packed in a way that no recording is",
        )?;
        Ok(())
    }

    /// Takes room for cells of `bytes` of text in all.
    fn take_cells(&mut self, count: usize, bytes: usize) -> Result<(), String> {
        self.take(count.saturating_mul(CELL).saturating_add(bytes))
    }
}

/// Returns true for the ending of a file of columns.
pub(super) fn is_columnar(ending: &str) -> bool {
    matches!(ending, "parquet" | "mat")
}

/// Returns the columns of a file.
///
/// # Errors
/// [`RecordingError::NotARecording`] says why there are none to be had.
pub(super) fn columns(label: &str, ending: &str, bytes: Vec<u8>) -> Result<Vec<Cells>, RecordingError> {
    let columns = match ending {
        "parquet" => parquet::columns(bytes),
        _ => mat::columns(&bytes),
    };
    columns.map_err(|reason| RecordingError::NotARecording { name: label.to_owned(), reason })
}

/// A number with as many digits as it takes to read the same one back.
fn number(value: f64) -> String {
    format!("{value:?}")
}

#[cfg(test)]
mod tests;
