//! Errors on the way from a recording to the rows of a tree.

use rigident_shared::tree::TreeError;

use crate::body::input_checks::Implausible;
use rigident_model::ModelError;

/// The reason that a recording cannot be used with a model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TreePrepareError {
    /// Columns, tables or keys are missing.
    #[error("{name}: {missing} missing: {advice}")]
    Missing {
        /// The recording.
        name: String,
        /// The missing part, with its verb.
        missing: String,
        /// The advice.
        advice: String,
    },
    /// A cell cannot be used.
    #[error("{name}: column {column}, {row}: {reason}")]
    Cell {
        /// The recording.
        name: String,
        /// The column.
        column: String,
        /// The line of a CSV, or the row, from 1.
        row: String,
        /// Why.
        reason: String,
    },
    /// Recording and model contradict each other.
    #[error("{name} does not fit the model {model}: {why}")]
    Fit {
        /// The recording.
        name: String,
        /// The model.
        model: String,
        /// Why, and what to do.
        why: String,
    },
    /// Readings that cannot be what they are said to be.
    #[error("{name}: {error}")]
    Implausible {
        /// The recording.
        name: String,
        /// Why not.
        error: Implausible,
    },
    /// Something asked for that is not done for trees.
    #[error("{0}")]
    Unsupported(String),
}

/// The reason that frames make no rows.
#[derive(Debug, thiserror::Error)]
pub enum TreeSourceError {
    /// The model has no base parameters.
    #[error("{0}")]
    Model(#[from] ModelError),
    /// Frames do not fit the tree: a mistake of the program's.
    #[error("the frames do not fit the model ({0:?})")]
    Frames(TreeError),
}
