//! Files that are whole or not there, and never take another's place: [`rigident_files::new_file`], with a
//! recording's errors.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

pub use rigident_files::new_file::RefusedWrite;
use rigident_files::new_file::{self, NewFileError};

use super::error::RecordingError;

/// Writes a new file.
///
/// # Errors
/// Fails as [`rigident_files::new_file::write_new`] does.
pub fn write_new<E: Into<RefusedWrite>>(
    path: &Path,
    write: impl FnOnce(BufWriter<File>) -> Result<BufWriter<File>, E>,
) -> Result<(), RecordingError> {
    Ok(new_file::write_new(path, write)?)
}

/// Writes a new file from text that is in memory.
///
/// # Errors
/// Fails as [`write_new`] does.
pub fn write_new_text(path: &Path, text: &str) -> Result<(), RecordingError> {
    Ok(new_file::write_new_text(path, text)?)
}

/// Writes a new file from bytes that are in memory.
///
/// # Errors
/// Fails as [`write_new`] does.
pub fn write_new_bytes(path: &Path, bytes: &[u8]) -> Result<(), RecordingError> {
    Ok(new_file::write_new_bytes(path, bytes)?)
}

impl From<NewFileError> for RecordingError {
    fn from(error: NewFileError) -> Self {
        match error {
            NewFileError::Exists(path) => Self::Exists(path),
            NewFileError::Unwritable { path, reason } => Self::Unwritable { path, reason },
        }
    }
}
