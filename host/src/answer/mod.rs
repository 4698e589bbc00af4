//! From the information factor to an answer with an uncertainty.
//!
//! Lives here: what is identified and what is not ([`identifiability`]), the quantities derived from the ten
//! parameters and their intervals ([`derived`]). May not live here: raw data, files, printing. Before this:
//! [`crate::identification`] or the firmware's factor; after it: [`crate::formats`] and [`crate::report`].

pub mod assemble;
pub mod consistent;
pub mod derived;
pub mod identifiability;

use nalgebra::DMatrix;
use rigident_shared::factor::InformationFactor;
use statrs::distribution::{ContinuousCDF, StudentsT};

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
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Ten parameters, or sixteen with the wrench offset; SI, in S.
    pub values: Vec<f64>,
    /// Covariance; rows of parameters that are not determined are meaningless.
    pub covariance: DMatrix<f64>,
    /// Whether the rows alone determine the parameter.
    pub determined: Vec<bool>,
    /// 2-norm condition number of the column-scaled, whitened rows over what is determined.
    pub condition_number: f64,
    /// Coverage factor of a 95 % interval.
    pub coverage_factor: f64,
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
        }
    }

    /// The 95 % expanded uncertainty of parameter `j`; infinite if it is not determined.
    pub fn u95(&self, j: usize) -> f64 {
        if self.determined.get(j) == Some(&true) {
            self.coverage_factor * self.covariance[(j, j)].max(0.0).sqrt()
        } else {
            f64::INFINITY
        }
    }

    /// The first ten parameters.
    pub fn body(&self) -> [f64; 10] {
        std::array::from_fn(|j| self.values.get(j).copied().unwrap_or(0.0))
    }
}

/// Two-sided 95 % coverage factor: 1.96, or Student's t.
fn coverage_factor(noise: Noise) -> f64 {
    const NORMAL: f64 = 1.959_963_984_540_054;
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
