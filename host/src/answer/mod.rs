//! From the information factor to an answer with an uncertainty.
//!
//! Lives here: what is identified and what is not ([`identifiability`]), what the motion lacks ([`weakest`]), the
//! quantities derived from the ten parameters and their intervals ([`derived`]). May not live here: raw data,
//! files, printing. Before this: [`crate::identification`] or the firmware's factor; after it:
//! [`crate::recording`] and [`crate::present`].

pub mod assemble;
pub mod consistent;
pub mod derived;
pub mod identifiability;
pub mod result;
pub mod weakest;

use nalgebra::DMatrix;
use rigident_shared::factor::InformationFactor;
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::answer::result::Measured;
use crate::identification::Factor;
use crate::identification::known::{self, Known, KnownError};

/// How the noise that scales the covariance is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise {
    /// σ of every channel was given: `k = 1.96`.
    Given,
    /// σ was estimated from residuals with so many degrees of freedom: k from Student's t.
    Estimated {
        /// Degrees of freedom of the residuals.
        degrees_of_freedom: f64,
    },
}

/// Estimate and covariance of the parameters of a factor, in f64, with what the rows determine.
///
/// Its numbers leave the crate as [`ParameterState`](crate::answer::result::ParameterState)s only, see
/// [`identifiability::states`]: what is not identified has none.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Ten parameters, or sixteen with the wrench offset; SI, in S. Of what is not determined, whatever fits.
    pub(crate) values: Vec<f64>,
    /// Covariance; rows of parameters that are not determined are meaningless.
    pub(crate) covariance: DMatrix<f64>,
    /// Whether the rows alone determine the parameter.
    pub(crate) determined: Vec<bool>,
    /// 2-norm condition number of the column-scaled, whitened rows over what is determined.
    pub condition_number: f64,
    /// Coverage factor of a 95 % interval.
    pub coverage_factor: f64,
    /// Rows whitened by their true σ, and how the noise is known; `None` for a model that takes no known quantities.
    rows: Option<(Factor, Noise)>,
    /// What was known beforehand, and what the data alone say.
    beforehand: Option<(Vec<Known>, Box<Estimate>)>,
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
        Self {
            values: solution.estimate.to_vec(),
            covariance: DMatrix::from_fn(N, N, |i, j| covariance[i][j] * variance_scale),
            determined: solution.determined.to_vec(),
            condition_number: solution.condition_number,
            coverage_factor: coverage_factor(noise),
            rows: Factor::from_entries(
                N,
                factor.cast(|v| v / variance_scale.sqrt()).entries().collect(),
                factor.rows(),
            )
            .map(|factor| (factor, noise)),
            beforehand: None,
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
            let factor = |j: usize| by.get(j).copied().unwrap_or(1.0);
            let covariance = &self.covariance;
            let covariance = DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |i, j| {
                covariance[(i, j)] * factor(i) * factor(j)
            });
            return Self { covariance, ..self.clone() };
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
        Self {
            values,
            covariance,
            determined,
            condition_number,
            coverage_factor: coverage_factor(noise),
            rows: None,
            beforehand: None,
        }
    }

    /// What was known beforehand.
    pub fn known(&self) -> &[Known] {
        self.beforehand.as_ref().map_or(&[], |(known, _)| known)
    }

    /// What the data alone say.
    pub fn of_data_alone(&self) -> &Self {
        self.beforehand.as_ref().map_or(self, |(_, data)| data)
    }

    /// From numbers that no rows stand behind, as a bound or a design gives them; σ is given. Known quantities
    /// do not change it.
    #[cfg(any(test, feature = "simulator"))]
    pub(crate) fn from_parts(values: Vec<f64>, covariance: DMatrix<f64>, determined: Vec<bool>) -> Self {
        Self {
            values,
            covariance,
            determined,
            condition_number: 1.0,
            coverage_factor: coverage_factor(Noise::Given),
            rows: None,
            beforehand: None,
        }
    }

    /// Parameter `j` if the rows determine it. Whether they do so finely enough to be worth a number,
    /// [`identifiability::states`] says.
    pub(crate) fn measured(&self, j: usize) -> Option<Measured> {
        let determined = self.determined.get(j) == Some(&true);
        self.values.get(j).filter(|_| determined).map(|value| Measured { value: *value, u95: self.u95(j) })
    }

    /// Covariance of parameters `i` and `j`, SI; `None` unless the rows determine both.
    pub fn covariance(&self, i: usize, j: usize) -> Option<f64> {
        let determined = |k: usize| self.determined.get(k) == Some(&true);
        (determined(i) && determined(j)).then(|| self.covariance[(i, j)])
    }

    /// The 95 % expanded uncertainty of parameter `j`; infinite if it is not determined.
    pub(crate) fn u95(&self, j: usize) -> f64 {
        if self.determined.get(j) == Some(&true) {
            self.coverage_factor * self.covariance[(j, j)].max(0.0).sqrt()
        } else {
            f64::INFINITY
        }
    }

    /// The first ten parameters, determined or not.
    pub(crate) fn body(&self) -> [f64; 10] {
        std::array::from_fn(|j| self.values.get(j).copied().unwrap_or(0.0))
    }
}

/// Two-sided 95 % coverage factor of a normal deviate.
pub(crate) const NORMAL_COVERAGE: f64 = 1.959_963_984_540_054;

/// Two-sided 95 % coverage factor: 1.96, or Student's t.
fn coverage_factor(noise: Noise) -> f64 {
    const NORMAL: f64 = NORMAL_COVERAGE;
    match noise {
        Noise::Given => NORMAL,
        // t − z ≈ z (z² + 1) / 4ν: 2e-4 here, and statrs' inverse loses its digits far above.
        Noise::Estimated { degrees_of_freedom } if degrees_of_freedom > 1e4 => NORMAL,
        Noise::Estimated { degrees_of_freedom } => {
            StudentsT::new(0.0, 1.0, degrees_of_freedom.max(1.0)).map_or(NORMAL, |t| t.inverse_cdf(0.975))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_factors_are_those_of_the_tables() {
        for (dof, k) in [(1.0, 12.706), (10.0, 2.228), (134.0, 1.978), (9e3, 1.960), (1e7, 1.960)] {
            let got = coverage_factor(Noise::Estimated { degrees_of_freedom: dof });
            assert!((got - k).abs() < 6e-4, "{dof}: {got}");
        }
    }
}
