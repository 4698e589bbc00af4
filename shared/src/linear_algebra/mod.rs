//! Small dense linear algebra: sums over slices and the one-sided Jacobi decomposition.
//!
//! Lives here: what [`crate::factor`], [`crate::whitening`] and the estimator all need, and nothing that
//! knows of rows or parameters.

mod jacobi;
pub(crate) mod vector;

pub(crate) use jacobi::{Jacobi, dot};
pub(crate) use vector::{add_scaled, copy, dot_slices, scale};

/// Parameters at most.
pub const ROOM: usize = 16;
