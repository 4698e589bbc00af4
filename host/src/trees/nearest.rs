//! Standard parameters from what was identified of a tree.

pub use crate::answer::standard_parameters::{Full, FullLink, divergence};

use super::TreeIdentification;
use crate::answer::standard_parameters::{self, BaseEstimate};
use crate::model::{Model, ModelError};

impl TreeIdentification {
    /// Returns the base parameters by themselves.
    pub(crate) fn base_estimate(&self) -> BaseEstimate<'_> {
        let factor = &self.factor;
        let n = factor.parameters();
        let r = factor.r();
        let upper = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
        let mut entries: Vec<f64> = upper.map(|(i, j)| r[(i, j)]).collect();
        entries.extend_from_slice(factor.z());
        entries.push(factor.residual_sum_of_squares());
        let factor = crate::fit::Factor::from_entries(n, &entries, factor.rows())
            .unwrap_or_else(|| crate::fit::Factor::new(n));
        BaseEstimate::of_factor(&factor, &self.base, self.variance_scale, self.noise)
    }
}

/// See [`standard_parameters::nearest`].
///
/// # Errors
/// [`ModelError`] if a body has no nominal parameters or impossible ones, or there are no pairs.
pub fn nearest(
    model: &Model,
    found: &TreeIdentification,
    trust: f64,
    symmetric: bool,
) -> Result<Full, ModelError> {
    standard_parameters::nearest(model, &found.base_estimate(), trust, symmetric)
}
