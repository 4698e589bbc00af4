//! Gains by rows over parameters and the errors of a rig.

use nalgebra::DMatrix;

use super::COARSEST;
use rigident_fit::{Factor, RigError};

/// Relative errors of gains, of efforts as they are scaled: a drive reads `1 + g` times its torque.
#[derive(Clone, Debug, PartialEq)]
pub struct Errors {
    /// The estimates, by drives.
    pub values: Vec<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
}

impl Errors {
    /// Returns the errors of the gains of these joints by rows over this many parameters and the errors of a
    /// rig, with all that is known of either; `None` if one of the joints has none, or the rows are no
    /// numbers.
    pub fn of(rows: &Factor, parameters: usize, errors: &[RigError], joints: &[String]) -> Option<Self> {
        let place = |joint: &String| {
            let name = format!("gain_{joint}");
            errors.iter().position(|error| error.name == name).map(|k| parameters + k)
        };
        let kept: Vec<usize> = joints.iter().map(place).collect::<Option<_>>()?;
        let solution = rows.eliminate_others(&kept).solve(rows.rounding());
        let finite = solution.estimate.iter().chain(solution.covariance.iter()).all(|v| v.is_finite());
        finite.then_some(Self { values: solution.estimate, covariance: solution.covariance })
    }

    /// Returns the standard deviation of a gain, relative.
    pub fn sd(&self, k: usize) -> f64 {
        self.covariance[(k, k)].max(0.0).sqrt()
    }

    /// Returns the standard deviation of the ratio of two gains, relative.
    pub fn sd_of_ratio(&self, k: usize, to: usize) -> f64 {
        let c = &self.covariance;
        (c[(k, k)] + c[(to, to)] - 2.0 * c[(k, to)]).max(0.0).sqrt()
    }

    /// Returns the standard deviation of what all gains have in common, relative: of their mean.
    pub fn sd_in_common(&self) -> f64 {
        self.covariance.sum().max(0.0).sqrt() / self.values.len().max(1) as f64
    }

    /// Returns what is left of the errors without what all have in common.
    #[must_use]
    pub fn apart(&self) -> Self {
        let count = self.values.len();
        let share = 1.0 / count.max(1) as f64;
        let mean = share * self.values.iter().sum::<f64>();
        let left = DMatrix::from_fn(count, count, |i, j| f64::from(u8::from(i == j)) - share);
        let values = self.values.iter().map(|value| value - mean).collect();
        Self { values, covariance: &left * &self.covariance * &left }
    }

    /// Returns standard deviations that, taken as independent, are no smaller than these errors together in
    /// any combination: a diagonal of the absolute sums of rows exceeds a covariance by a matrix with a
    /// dominant diagonal.
    pub fn independent(&self) -> Vec<f64> {
        let sum = |row: usize| self.covariance.row(row).iter().map(|v| v.abs()).sum::<f64>().sqrt();
        (0..self.values.len()).map(sum).collect()
    }

    /// Returns the gain that most others have an identified ratio to, if any has, at this coverage factor.
    pub fn reference(&self, coverage: f64) -> Option<usize> {
        let count = self.values.len();
        let known = |to: usize| {
            (0..count).filter(|k| *k != to && coverage * self.sd_of_ratio(*k, to) <= COARSEST).count()
        };
        let best = (0..count).rev().max_by_key(|to| known(*to))?;
        (known(best) > 0).then_some(best)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(covariance: DMatrix<f64>) -> Errors {
        Errors { values: vec![0.0; covariance.nrows()], covariance }
    }

    /// Three gains with one large error in common: none is known, two ratios are, and independent errors
    /// cover every combination.
    #[test]
    fn an_error_in_common_leaves_ratios() {
        let mut covariance = DMatrix::from_element(3, 3, 0.09);
        for (k, own) in [1e-4, 4e-4, 0.04].into_iter().enumerate() {
            covariance[(k, k)] += own;
        }
        covariance[(2, 0)] = -0.05;
        covariance[(0, 2)] = -0.05;
        let found = errors(covariance.clone());
        assert!(2.0 * found.sd(0) > COARSEST);
        assert!((found.sd_of_ratio(0, 1) - 5e-4_f64.sqrt()).abs() < 1e-12);
        assert_eq!(found.reference(1.96), Some(0));
        assert!((found.sd_in_common().powi(2) - covariance.sum() / 9.0).abs() < 1e-12);
        assert!(found.apart().sd_in_common() < 1e-9 && found.apart().values.iter().all(|v| *v == 0.0));
        let cover = DMatrix::from_diagonal(
            &found.independent().into_iter().map(|s| s * s).collect::<Vec<_>>().into(),
        );
        assert!((cover - covariance).symmetric_eigenvalues().min() > -1e-12);
        assert_eq!(errors(DMatrix::from_diagonal_element(2, 2, 1.0)).reference(1.96), None);
    }
}
