//! The faults of a model, and what is only suspicious.

use std::fmt;
use std::path::PathBuf;

use rigident_files::new_file::NewFileError;
use rigident_shared::printable;

/// Why there is no model: what, where, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The message of the system.
        source: std::io::Error,
    },
    /// A file cannot be written, or is there already.
    #[error(transparent)]
    Write(#[from] NewFileError),
    /// The text is no description of a robot.
    #[error("{what} is no robot description that can be read: {}", printable::line(.reason))]
    Syntax {
        /// The file's name.
        what: String,
        /// The message of the reader.
        reason: String,
    },
    /// There is no model of this name.
    #[error("{0}: neither a file nor a built-in model; the built-in ones are human34 and human58")]
    Unknown(String),
    /// A rig file that cannot be read or used.
    #[error("{0}")]
    RigFile(String),
    /// The links make no tree.
    #[error("{what}: {}", printable::line(.problem))]
    Structure {
        /// The model's name.
        what: String,
        /// The problem, its place, and the advice.
        problem: String,
    },
    /// An option that does not fit the model.
    #[error("{0}")]
    Option(String),
}

/// Begins what is reported of attributes that are read and written, and say nothing of links.
pub(crate) const NOT_USED: &str = "the answer does not use what the file states of its ";

/// Something strange that does not keep the model from being used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The link or joint.
    pub place: String,
    /// The suspicious part, and its meaning.
    pub text: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", printable::name(&self.place), printable::line(&self.text))
    }
}
