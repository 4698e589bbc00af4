//! The choice of motions to identify from: by conditions of parts of the rows, by their information, or by
//! chance.
//!
//! Lives here: what a motion's factor tells of groups of columns ([`conditions`]), the choice by it that the
//! human paper makes ([`published`]), greedy choices by the determinant and the least eigenvalue of the
//! information ([`greedy`]), and the comparison of choices of equal size ([`compare`]). All from the factors:
//! no row is examined. May not live here: where factors come from.

pub mod compare;
pub mod conditions;
pub mod greedy;
pub mod published;
#[cfg(test)]
mod tests;

use crate::Factor;

/// A motion that may be chosen.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Its name.
    pub name: String,
    /// Its rows, whitened; all candidates have the same columns.
    pub factor: Factor,
}

/// The reason that nothing can be chosen.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SelectionError {
    /// There is nothing to choose from.
    #[error("there are no motions to choose from")]
    Nothing,
    /// A factor has other columns than the first.
    #[error("motion {0} has other parameters than the first one")]
    Columns(String),
    /// A factor is not finite, or has no rows.
    #[error("motion {0} has no usable rows")]
    Empty(String),
    /// Nothing is to be chosen.
    #[error("give a number of motions of at least one")]
    Zero,
}

/// Checks candidates; returns the number of their columns.
///
/// # Errors
/// [`SelectionError`] names the first that cannot be used.
pub fn check(candidates: &[Candidate]) -> Result<usize, SelectionError> {
    let columns = candidates.first().ok_or(SelectionError::Nothing)?.factor.parameters();
    for candidate in candidates {
        if candidate.factor.parameters() != columns {
            return Err(SelectionError::Columns(candidate.name.clone()));
        }
        let is_zero = candidate.factor.r().iter().all(|v| *v == 0.0);
        if !candidate.factor.is_finite() || candidate.factor.rows() == 0 || is_zero {
            return Err(SelectionError::Empty(candidate.name.clone()));
        }
    }
    Ok(columns)
}
