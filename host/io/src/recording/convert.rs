//! Recordings from one form to the other, without loss.

use std::io::Error;
use std::path::{Path, PathBuf};

use super::error::RecordingError;
use super::mcap::write::WriteError;
use super::new_file::{RefusedWrite, write_new, write_new_text};
use super::{Recording, extension, rig_path};

/// The output of a conversion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Converted {
    /// The new recording and, beside a CSV file, its rig file.
    pub files: Vec<PathBuf>,
    /// Rows in it.
    pub rows: usize,
    /// The warnings of the reading.
    pub warnings: Vec<String>,
}

impl From<WriteError> for RefusedWrite {
    fn from(error: WriteError) -> Self {
        Self(match error {
            WriteError::Io(error) => error,
            other => Error::other(other.to_string()),
        })
    }
}

/// Reads a recording and writes it under another name; the endings say which forms. Columns, units and signs
/// become those of the notation. A rig file goes with it: into an MCAP file, beside a CSV file.
///
/// # Errors
/// [`RecordingError`]; nothing is overwritten, and nothing half-written is left.
pub fn convert(from: &Path, to: &Path, rig: Option<&Path>) -> Result<Converted, RecordingError> {
    let recording = Recording::load(from, rig)?;
    let mut files = vec![to.to_owned()];
    match extension(to).as_str() {
        "mcap" => write_new(to, |file| recording.write_mcap(file))?,
        "csv" => {
            let beside = rig_path(to);
            let (_, text) = recording.rig_in_notation();
            let there = std::fs::read_to_string(&beside).ok();
            if beside.symlink_metadata().is_ok() && there != text {
                // It would be taken for this recording's.
                return Err(RecordingError::Exists(beside.display().to_string()));
            }
            write_new(to, |file| recording.write_csv(file))?;
            if let Some(text) = text.filter(|_| there.is_none()) {
                if let Err(error) = write_new_text(&beside, &text) {
                    // Without its rig file it would be read wrongly; it is ours, made just now.
                    let _ = std::fs::remove_file(to);
                    return Err(error);
                }
                files.push(beside);
            }
        }
        _ => return Err(RecordingError::NotWritten(to.display().to_string())),
    }
    let rows = recording.rows();
    Ok(Converted { files, rows, warnings: recording.warnings.into_iter().chain(recording.assumed).collect() })
}

#[cfg(test)]
mod tests;
