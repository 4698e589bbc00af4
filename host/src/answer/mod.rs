//! From a fit to the answer: one object for one body, two links and trees, of which text, JSON and page are made.
//!
//! Lives here: the answer ([`result`]) and its making ([`Answer::new`]), states of parameters ([`states`]), what must be
//! identified ([`selection`]), quantities derived from the ten parameters of a body ([`derived`]), physical consistency
//! ([`physical_consistency`], [`nearest_body`]), standard parameters of links ([`standard_parameters`]), and what the motion
//! lacks ([`excitation_advice`]). May not live here: raw data, files, screens. Before this: [`crate::fit`]; after it:
//! [`crate::present`].
//!
//! [`assemble`], [`identifiability`], [`schema_1`], [`weakest`] and [`Estimate`] serve the engine for one body alone and go
//! with it.

pub mod assemble;
mod context;
pub mod derived;
pub mod excitation_advice;
pub mod identifiability;
pub mod nearest_body;
mod new;
#[cfg(test)]
mod old_fit;
pub mod physical_consistency;
mod read;
mod remarks;
pub mod result;
pub mod schema_1;
pub mod selection;
pub mod standard_parameters;
pub mod states;
#[cfg(test)]
pub(crate) mod tests;
pub mod weakest;

pub use context::{Context, Links, StandardRequest};
pub use new::AnswerError;
pub use read::ReadError;
pub use result::{Answer, Drift, DriftChange, Source, Status, TimeBase, Tracking};

use nalgebra::DMatrix;
use rigident_shared::factor::InformationFactor;

use crate::fit;
pub use crate::fit::Noise;
use crate::identification::Factor;
use crate::identification::known::{self, Known, KnownError};

/// A [`fit::Estimate`] with the rows that it was made of; it goes with `crate::identification`.
///
/// Its numbers leave the crate as [`ParameterState`](crate::answer::result::ParameterState)s only, see
/// [`identifiability::states`]: what is not identified has none.
#[derive(Clone, Debug)]
pub struct Estimate {
    inner: fit::Estimate,
    /// Coverage factor of a 95 % interval.
    pub coverage_factor: f64,
    /// Rows whitened by their true σ, and how the noise is known; `None` for a model that takes no known quantities.
    rows: Option<(Factor, Noise)>,
    /// What was known beforehand, and what the data alone say.
    beforehand: Option<(Vec<Known>, Box<Estimate>)>,
}

impl std::ops::Deref for Estimate {
    type Target = fit::Estimate;

    fn deref(&self) -> &fit::Estimate {
        &self.inner
    }
}

#[cfg(test)]
impl std::ops::DerefMut for Estimate {
    fn deref_mut(&mut self) -> &mut fit::Estimate {
        &mut self.inner
    }
}

impl Estimate {
    /// Solves a factor of whitened rows. `variance_scale` multiplies the covariance (1 if the σ were right).
    pub fn new<const N: usize>(
        factor: &InformationFactor<f64, N>,
        variance_scale: f64,
        noise: Noise,
    ) -> Self {
        let solution = factor.solve();
        let covariance = factor.covariance();
        let rows = Factor::from_entries(
            N,
            factor.cast(|v| v / variance_scale.sqrt()).entries().collect(),
            factor.rows(),
        );
        Self {
            rows: rows.map(|factor| (factor, noise)),
            ..Self::of_numbers(
                solution.estimate.to_vec(),
                DMatrix::from_fn(N, N, |i, j| covariance[i][j] * variance_scale),
                solution.determined.to_vec(),
                solution.condition_number,
                noise,
            )
        }
    }

    /// The estimate from the same data and what is known beforehand. Its intervals keep the coverage factor of
    /// the data's noise.
    ///
    /// # Errors
    /// [`KnownError`] if a known quantity cannot be used or contradicts the rest.
    pub fn with_known(&self, known: &[Known]) -> Result<Self, KnownError> {
        let Some((factor, noise)) = self.rows.as_ref().filter(|_| !known.is_empty()) else {
            return Ok(self.clone());
        };
        let mut factor = factor.clone();
        known::absorb_into(&mut factor, known, *noise)?;
        let mut joint = factor.estimate(1.0, *noise);
        joint.beforehand = Some((known.to_vec(), Box::new(self.clone())));
        Ok(joint)
    }

    /// The same estimate with standard deviations so many times as large.
    pub(crate) fn stretched(&self, by: &[f64]) -> Self {
        let Some((factor, noise)) = &self.rows else {
            return Self { inner: self.inner.inflate(by), ..self.clone() };
        };
        let stretched = factor.stretched(&self.values, by).estimate(1.0, *noise);
        Self { coverage_factor: self.coverage_factor, ..stretched }
    }

    /// From numbers of a factor whose size is not one of [`Factor`]'s; it takes no known quantities.
    pub(crate) fn of_numbers(
        values: Vec<f64>,
        covariance: DMatrix<f64>,
        determined: Vec<bool>,
        condition_number: f64,
        noise: Noise,
    ) -> Self {
        let null_directions = Vec::new();
        let inner =
            fit::Estimate { values, covariance, determined, null_directions, condition_number, noise };
        Self { coverage_factor: inner.coverage_factor(), inner, rows: None, beforehand: None }
    }

    /// What was known beforehand.
    pub fn known(&self) -> &[Known] {
        self.beforehand.as_ref().map_or(&[], |(known, _)| known)
    }

    /// What the data alone say.
    pub fn of_data_alone(&self) -> &Self {
        self.beforehand.as_ref().map_or(self, |(_, data)| data)
    }

    /// The first ten parameters, determined or not.
    pub(crate) fn body(&self) -> [f64; 10] {
        std::array::from_fn(|j| self.values.get(j).copied().unwrap_or(0.0))
    }
}

/// Two-sided 95 % coverage factor of a normal deviate.
pub(crate) use crate::fit::COVERAGE_95 as NORMAL_COVERAGE;
