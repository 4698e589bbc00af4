//! Why a person's segments are not found.

use crate::person::PersonError;
use rigident_fit::FitError;
use rigident_fit::motion_selection::SelectionError;
use rigident_fit::pool::PoolError;
use rigident_model::ModelError;
use rigident_rows::tree::TreeSourceError;

/// The reason that a person's segments are not found.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The trials make no person.
    #[error(transparent)]
    Person(#[from] PersonError),
    /// The frames make no rows.
    #[error(transparent)]
    Source(#[from] TreeSourceError),
    /// The rows cannot be fitted.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// A person with other joints has no rows.
    #[error(transparent)]
    Draws(#[from] DrawError),
    /// Motions do not fit together.
    #[error(transparent)]
    Pool(#[from] PoolError),
    /// There is nothing to choose from.
    #[error(transparent)]
    Selection(#[from] SelectionError),
    /// The table has no bodies of this model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A motion does not repeat.
    #[error("{0}: there are no strides: its joints do not come back to themselves; give `parts` N")]
    NoStrides(String),
    /// No frame of any trial can be used.
    #[error("no frame can be used: {0}")]
    NoFrames(String),
}

/// The reason that a person with other joints has no rows.
#[derive(Debug, thiserror::Error)]
pub enum DrawError {
    /// The frames make no rows.
    #[error(transparent)]
    Source(#[from] TreeSourceError),
    /// They cannot be filtered.
    #[error(transparent)]
    Fit(#[from] FitError),
}
