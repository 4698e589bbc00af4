//! Estimate, covariance and interval of the parameters of a factor.

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::{Factor, RigRows};

/// An estimate with its 95 % expanded uncertainty, SI.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct Measured {
    /// Value.
    pub value: f64,
    /// 95 % expanded uncertainty.
    pub u95: f64,
}

/// How the noise that scales the covariance is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise {
    /// σ of every channel was given: the coverage factor is the normal distribution's.
    Given,
    /// σ was estimated from residuals: the coverage factor is Student's.
    Estimated {
        /// Degrees of freedom of the residuals.
        degrees_of_freedom: f64,
    },
}

impl Noise {
    /// Returns the two-sided 95 % coverage factor.
    pub fn coverage_factor(self) -> f64 {
        match self {
            Self::Given => COVERAGE_95,
            // t − z ≈ z (z² + 1) / 4ν: 2e-4 here, and the inverse loses its digits far above.
            Self::Estimated { degrees_of_freedom } if degrees_of_freedom > 1e4 => COVERAGE_95,
            Self::Estimated { degrees_of_freedom } => StudentsT::new(0.0, 1.0, degrees_of_freedom.max(1.0))
                .map_or(COVERAGE_95, |t| t.inverse_cdf(0.975)),
        }
    }

    /// Returns the coverage factor of a quantity of whose variance this noise has a `share`, 0 to 1, and what
    /// is known beforehand the rest, as a normal distribution: each part has its own factor, and expanded
    /// parts add in squares.
    ///
    /// The effective degrees of freedom of Welch and Satterthwaite (JCGM 100:2008, G.4), `ν / share²`, have
    /// the same limits; with a share from the same few data they cover one to two per cent less.
    #[must_use]
    pub fn coverage_factor_of(self, share: f64) -> f64 {
        let share = share.clamp(0.0, 1.0);
        (share * self.coverage_factor().powi(2) + (1.0 - share) * COVERAGE_95.powi(2)).sqrt()
    }

    /// Returns the one of two that knows less of the noise.
    #[must_use]
    pub fn less_certain(self, other: Self) -> Self {
        match (self, other) {
            (Self::Given, other) | (other, Self::Given) => other,
            (Self::Estimated { degrees_of_freedom: a }, Self::Estimated { degrees_of_freedom: b }) => {
                Self::Estimated { degrees_of_freedom: a.min(b) }
            }
        }
    }
}

/// Two-sided 95 % coverage factor of the normal distribution.
pub const COVERAGE_95: f64 = 1.959_963_984_540_054;

/// Estimate and covariance of N parameters, with what the rows determine.
///
/// [`Estimate::measured`] gives a number where the rows determine it; all numbers are in
/// [`Estimate::unjudged`], which an answer is judged from.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// N values, SI; meaningless where not determined.
    pub(crate) values: Vec<f64>,
    /// Covariance, N × N; rows of parameters that are not determined are meaningless.
    pub(crate) covariance: DMatrix<f64>,
    /// The part of the covariance that does not come from noise, but from what is known of errors beforehand,
    /// N × N; `None`: nothing is known apart from noise.
    pub(crate) beforehand: Option<DMatrix<f64>>,
    /// True where the rows alone determine the parameter.
    pub(crate) determined: Vec<bool>,
    /// Directions that the rows do not determine: parameters and their shares in column-scaled units.
    pub(crate) null_directions: Vec<Vec<(usize, f64)>>,
    /// 2-norm condition number of the column-scaled, whitened rows over what is determined.
    pub condition_number: f64,
    /// How the noise is known.
    pub noise: Noise,
}

/// The numbers of an [`Estimate`] as the solution has them: nobody has judged whether they say anything.
#[derive(Clone, Copy, Debug)]
pub struct Unjudged<'a> {
    /// N values, SI; meaningless where not determined.
    pub values: &'a [f64],
    /// Covariance, N × N; rows of parameters that are not determined are meaningless.
    pub covariance: &'a DMatrix<f64>,
    /// The part of it that does not come from noise; `None`: nothing is known apart from noise.
    pub beforehand: Option<&'a DMatrix<f64>>,
    /// True where the rows alone determine the parameter.
    pub determined: &'a [bool],
    /// Directions that the rows do not determine: parameters and their shares in column-scaled units.
    pub null_directions: &'a [Vec<(usize, f64)>],
}

impl Estimate {
    /// Solves a factor of whitened rows; `variance_scale` multiplies the covariance (1 if the σ were right),
    /// `rounding` is the source's ([`super::RowSource::rounding`]).
    pub fn new(factor: &Factor, rounding: f64, variance_scale: f64, noise: Noise) -> Self {
        let solution = factor.solve(rounding);
        Self {
            values: solution.estimate,
            covariance: solution.covariance * variance_scale,
            beforehand: None,
            determined: solution.determined,
            null_directions: solution.null_directions,
            condition_number: solution.condition_number,
            noise,
        }
    }

    /// Builds the estimate that a bound or a design gives: no rows are behind it, and everything is
    /// determined.
    pub fn of_bound(values: Vec<f64>, covariance: DMatrix<f64>) -> Self {
        let determined = vec![true; values.len()];
        let null_directions = Vec::new();
        Self {
            values,
            covariance,
            beforehand: None,
            determined,
            null_directions,
            condition_number: 1.0,
            noise: Noise::Given,
        }
    }

    /// Returns all numbers, also of what the rows do not determine: for code that judges them.
    pub fn unjudged(&self) -> Unjudged<'_> {
        Unjudged {
            values: &self.values,
            covariance: &self.covariance,
            beforehand: self.beforehand.as_ref(),
            determined: &self.determined,
            null_directions: &self.null_directions,
        }
    }

    /// Returns the same with the part of the covariance apart that what is known of errors beforehand brings,
    /// of the rows that it solves: `C L Lᵀ C` with L of [`RigRows::beforehand_in_scores`].
    #[must_use]
    pub(crate) fn beside(mut self, rows: &[RigRows]) -> Self {
        if self.noise == Noise::Given || rows.iter().all(|own| own.errors().is_empty()) {
            return self;
        }
        let brought = rows.iter().map(|own| &self.covariance * own.beforehand_in_scores());
        let n = self.len();
        self.beforehand = Some(brought.fold(DMatrix::zeros(n, n), |sum, own| sum + &own * own.transpose()));
        self
    }

    /// Adds to the covariance by what else the values may be off; N × N.
    pub fn widen(&mut self, by: &DMatrix<f64>) {
        self.covariance += by;
    }

    /// Returns the same about other values.
    #[must_use]
    pub fn at(mut self, values: Vec<f64>) -> Self {
        self.values = values;
        self
    }

    /// Returns the same with parameter `j` as one that the rows do not determine.
    #[must_use]
    pub fn without(mut self, j: usize) -> Self {
        self.determined.iter_mut().skip(j).take(1).for_each(|own| *own = false);
        self
    }

    /// Returns the number of parameters.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Returns true if there are no parameters.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Returns the coverage factor of a 95 % interval that rests on the noise alone: the largest of all.
    pub fn coverage_factor(&self) -> f64 {
        self.noise.coverage_factor()
    }

    /// Returns the coverage factor of a 95 % interval of a sum of the parameters with these weights, N.
    pub fn coverage_factor_of(&self, weights: &[f64]) -> f64 {
        let Some(beforehand) = &self.beforehand else { return self.coverage_factor() };
        let used: Vec<usize> =
            (0..self.len()).filter(|j| weights.get(*j).is_some_and(|w| *w != 0.0)).collect();
        let variance = |of: &DMatrix<f64>| {
            let row = |i: &usize| used.iter().map(|j| weights[*i] * weights[*j] * of[(*i, *j)]).sum::<f64>();
            used.iter().map(row).sum::<f64>()
        };
        let share = 1.0 - variance(beforehand) / variance(&self.covariance);
        self.noise.coverage_factor_of(if share.is_nan() { 1.0 } else { share.clamp(0.0, 1.0) })
    }

    /// Returns the number of parameters that the rows determine.
    pub fn rank(&self) -> usize {
        self.determined.iter().filter(|d| **d).count()
    }

    /// Returns true if the rows determine parameter `j`.
    pub fn is_determined(&self, j: usize) -> bool {
        self.determined.get(j) == Some(&true)
    }

    /// Returns parameter `j` if the rows determine it, however coarsely: an answer withholds what is too
    /// coarse to be called identified.
    pub fn measured(&self, j: usize) -> Option<Measured> {
        let value = self.values.get(j).filter(|_| self.is_determined(j))?;
        Some(Measured { value: *value, u95: self.u95(j) })
    }

    /// Returns the 95 % expanded uncertainty of parameter `j`; infinite if it is not determined.
    pub fn u95(&self, j: usize) -> f64 {
        if self.is_determined(j) {
            let mut weights = vec![0.0; self.len()];
            weights[j] = 1.0;
            self.coverage_factor_of(&weights) * self.covariance[(j, j)].max(0.0).sqrt()
        } else {
            f64::INFINITY
        }
    }

    /// Returns the covariance of parameters `i` and `j`, SI; `None` unless the rows determine both.
    pub fn covariance(&self, i: usize, j: usize) -> Option<f64> {
        (self.is_determined(i) && self.is_determined(j)).then(|| self.covariance[(i, j)])
    }

    /// Returns the largest difference of the parameters from another estimate's, in standard deviations.
    pub fn largest_step(&self, other: &Self) -> f64 {
        let step = |j: usize| {
            let sd = self.covariance[(j, j)].max(0.0).sqrt();
            let step = (self.values[j] - other.values[j]).abs();
            if step == 0.0 { 0.0 } else { step / sd }
        };
        (0..self.len()).filter(|j| self.is_determined(*j)).map(step).fold(0.0, f64::max)
    }

    /// Returns the same estimate with standard deviations `by` times as large, with the same correlations.
    #[must_use]
    pub fn inflate(&self, by: &[f64]) -> Self {
        let by = |j: usize| by.get(j).copied().unwrap_or(1.0);
        let n = self.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| self.covariance[(i, j)] * by(i) * by(j));
        Self { covariance, ..self.clone() }
    }
}
