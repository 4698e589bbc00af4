//! Why there is no recording: what happened, where, and what to do.

use crate::rig::RigFileError;

/// Why a recording cannot be read or written.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RecordingError {
    /// It cannot be read.
    #[error("{path} cannot be read: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// The message of the system.
        reason: String,
    },
    /// It cannot be written.
    #[error("{path} cannot be written: {reason}; nothing was left half-written")]
    Unwritable {
        /// The file.
        path: String,
        /// The message of the system.
        reason: String,
    },
    /// A file of that name is there.
    #[error("{0} is there already, and nothing is overwritten: give another name, or move it away")]
    Exists(String),
    /// The ending says none of the kinds that are read.
    #[error(
        "{0} is no recording by its name: it must end in .csv, .mcap, .db3, .bag, .parquet, .mat, .tdms or \
         .xlsx (text also in .tsv, .txt, .lvm, .asc, .dat or .log)"
    )]
    UnknownKind(String),
    /// The ending says a kind that another program saves as text.
    #[error("{path} is not read: save it as {advice}")]
    SavedElsewhere {
        /// The file.
        path: String,
        /// The form in which it must be saved.
        advice: &'static str,
    },
    /// The ending says none of the kinds that are written.
    #[error("{0} cannot be written: a recording is written as .csv or .mcap")]
    NotWritten(String),
    /// Not a recording.
    #[error("{name} is not a recording: {reason}")]
    NotARecording {
        /// The recording.
        name: String,
        /// Why not.
        reason: String,
    },
    /// Something is wrong at a place.
    #[error("{name}, line {line}{}: {reason}", column.as_ref().map_or_else(String::new, |c| format!(", \
        column {c}")))]
    At {
        /// The recording.
        name: String,
        /// Line of the file, from 1.
        line: u64,
        /// Name of the column.
        column: Option<String>,
        /// The fault, and the advice.
        reason: String,
    },
    /// Something is wrong with a number of an array.
    #[error("{name}: {column}[{index}]: {reason}")]
    Cell {
        /// The recording.
        name: String,
        /// Index in the array, from 0.
        index: u64,
        /// Name of the column.
        column: String,
        /// The fault, and the advice.
        reason: String,
    },
    /// The columns are not those of a recording.
    #[error("{name}: {reason}")]
    Columns {
        /// The recording.
        name: String,
        /// The fault, and the advice.
        reason: String,
    },
    /// A message of an MCAP file.
    #[error("{name}, topic {topic}, message {message}: {reason}")]
    Message {
        /// The recording.
        name: String,
        /// The topic of the message.
        topic: String,
        /// The number of the message on the topic, from 1.
        message: usize,
        /// The fault, and the advice.
        reason: String,
    },
    /// The rig file.
    #[error(transparent)]
    Rig(#[from] RigFileError),
}
