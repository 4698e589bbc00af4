//! Recordings as tables of columns: Parquet and MAT files. Their columns are read as those of a CSV are.
//!
//! Lives here: how the files hold columns. May not live here: what columns mean ([`super::csv`]).

mod mat;
mod parquet;

use super::columns::Cells;
use super::error::RecordingError;

/// The most cells of a table.
const MOST_CELLS: usize = 1 << 28;

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
