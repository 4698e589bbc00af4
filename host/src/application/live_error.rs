//! Why live sources make no answer.

use std::path::PathBuf;

use rigident_identify::problem::clocks::StreamError;
use rigident_io::sources::{Role, SourceError};

/// Appended where nothing was written.
const NOTHING: &str = "\nNothing was recorded.";

/// Why live sources make no answer.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// An address is none.
    #[error("`{role}` {error}")]
    Address {
        /// The role of the address.
        role: Role,
        /// Why it is none.
        error: SourceError,
    },
    /// A source that cannot be read.
    #[error("{0}{end}", end = if matches!(.0, SourceError::Url { .. }) { "" } else { NOTHING })]
    Source(SourceError),
    /// One line with two settings.
    #[error(
        "`{role}` {url} and `{other_role}` {other} are one line with two settings: give the same address \
         for both"
    )]
    TwoSettings {
        /// The role of the first address.
        role: Role,
        /// The first address.
        url: String,
        /// The role of the second address.
        other_role: Role,
        /// The second address.
        other: String,
    },
    /// No source brings a specific force.
    #[error(
        "no accelerometer is among the sources: add `imu` ADDRESS; of `pose` the attitude takes the place \
         of a gyro, and no more{NOTHING}"
    )]
    NoAccelerometer,
    /// Two sources bring the same.
    #[error(
        "{first} and {second} both bring {columns}: give the columns that are not to be used other names, \
         by ?columns={NOTHING}"
    )]
    Twice {
        /// The address of the first source.
        first: String,
        /// The address of the second source.
        second: String,
        /// The columns.
        columns: String,
    },
    /// A rig file of something else than one body in motion.
    #[error("{} has {has}", rig.display())]
    Rig {
        /// The rig file.
        rig: PathBuf,
        /// The content that does not fit, and the remedy.
        has: &'static str,
    },
    /// The duration is none.
    #[error("`at_most_s` {0}: a positive number of seconds")]
    Duration(f64),
    /// It was stopped before anything was fed to the device.
    #[error("stopped during the first look at the sources")]
    StoppedLooking,
    /// The streams have too little in common.
    #[error(transparent)]
    Streams(#[from] StreamError),
    /// A clock that goes wrong, clocks that are not one, or a file that cannot be made; in words.
    #[error("{0}")]
    Clock(String),
    /// A source broke off, fell silent or began its time anew, or a file cannot be written; in words.
    #[error("{0}")]
    Broken(String),
}

impl LiveError {
    /// Returns true if a source failed, false if something was asked for that cannot be.
    pub fn is_of_the_link(&self) -> bool {
        match self {
            Self::Source(error) => !matches!(error, SourceError::Url { .. }),
            Self::Broken(_) => true,
            _ => false,
        }
    }
}
