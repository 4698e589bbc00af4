//! The normal distribution of named quantities: what is known of parameters and errors together, before rows
//! or after.

use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};

use super::Agreement;

/// A correlation matrix is singular where an eigenvalue is below this: what is known of that direction is
/// then contradictory or exact to rounding.
const LEAST_EIGENVALUE: f64 = 1e-12;

/// A normal distribution of named quantities.
///
/// ```
/// use nalgebra::{DMatrix, DVector};
/// use rigident_fit::Gaussian;
///
/// let names = vec!["m".to_owned(), "gain_fz".to_owned()];
/// let known = Gaussian::new(names, DVector::from_vec(vec![3.2, 0.0]), DMatrix::identity(2, 2)).unwrap();
/// assert_eq!(known.sd("gain_fz"), Some(1.0));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Gaussian {
    names: Vec<String>,
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Gaussian {
    /// Builds the distribution of n names with a mean of n and a covariance of n × n.
    ///
    /// Returns `None` if the sizes differ, a name occurs twice, a number is not finite or the covariance is
    /// not positive definite.
    pub fn new(names: Vec<String>, mean: DVector<f64>, covariance: DMatrix<f64>) -> Option<Self> {
        let n = names.len();
        let fits = mean.len() == n && covariance.shape() == (n, n);
        let finite = mean.iter().chain(covariance.iter()).all(|v| v.is_finite());
        let twice = names.iter().enumerate().any(|(k, name)| names.iter().take(k).any(|other| other == name));
        if n == 0 || !fits || !finite || twice || covariance.diagonal().iter().any(|v| *v <= 0.0) {
            return None;
        }
        let covariance = 0.5 * (&covariance + covariance.transpose());
        let built = Self { names, mean, covariance };
        let least = built.correlations().eigenvalues.min();
        (least > LEAST_EIGENVALUE).then_some(built)
    }

    /// Builds the distribution of names without correlation.
    ///
    /// Returns `None` if a standard deviation is not finite and positive or a name occurs twice.
    pub fn independent(entries: &[(String, f64, f64)]) -> Option<Self> {
        let names = entries.iter().map(|(name, _, _)| name.clone()).collect();
        let mean = DVector::from_iterator(entries.len(), entries.iter().map(|(_, mean, _)| *mean));
        let variance = DVector::from_iterator(entries.len(), entries.iter().map(|(_, _, sd)| sd * sd));
        Self::new(names, mean, DMatrix::from_diagonal(&variance))
    }

    /// Returns the names.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns the means, in the order of the names.
    pub fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    /// Returns the covariance, in the order of the names.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// Returns the place of a name.
    pub fn place(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|own| own == name)
    }

    /// Returns the mean of a name.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.place(name).map(|k| self.mean[k])
    }

    /// Returns the standard deviation of a name.
    pub fn sd(&self, name: &str) -> Option<f64> {
        self.place(name).map(|k| self.covariance[(k, k)].sqrt())
    }

    /// Returns the distribution of those names that `keep` selects, whatever the others are.
    #[must_use]
    pub fn only(&self, keep: impl Fn(&str) -> bool) -> Self {
        let kept: Vec<usize> =
            (0..self.names.len()).filter(|k| self.names.get(*k).is_some_and(|name| keep(name))).collect();
        Self {
            names: kept.iter().filter_map(|k| self.names.get(*k).cloned()).collect(),
            mean: self.mean.select_rows(&kept),
            covariance: self.covariance.select_rows(&kept).select_columns(&kept),
        }
    }

    fn correlations(&self) -> SymmetricEigen<f64, Dyn> {
        let sd = self.covariance.diagonal().map(f64::sqrt);
        let n = sd.len();
        SymmetricEigen::new(DMatrix::from_fn(n, n, |i, j| self.covariance[(i, j)] / (sd[i] * sd[j])))
    }

    /// Returns a power of the correlation matrix; of nothing nothing, which has no eigenvalues.
    fn correlations_to(&self, power: f64) -> DMatrix<f64> {
        if self.names.is_empty() {
            return DMatrix::zeros(0, 0);
        }
        let SymmetricEigen { eigenvectors, eigenvalues } = self.correlations();
        let values = eigenvalues.map(|v| v.max(LEAST_EIGENVALUE).powf(power));
        &eigenvectors * DMatrix::from_diagonal(&values) * eigenvectors.transpose()
    }

    /// Returns W with `WᵀW` the inverse of the covariance: rows `W x = W mean` of unit σ say what the
    /// distribution says. Row k belongs to quantity k: of all roots of the inverse, that of the correlations'
    /// symmetric one keeps the whitened quantities nearest to the own (A. Kessy, A. Lewin, K. Strimmer,
    /// *Optimal whitening and decorrelation*, 2018).
    pub fn whitening(&self) -> DMatrix<f64> {
        let sd = self.covariance.diagonal().map(f64::sqrt);
        self.correlations_to(-0.5) * DMatrix::from_diagonal(&sd.map(|sd| 1.0 / sd))
    }

    /// Returns the distribution as rows of unit σ with their values, over `columns` columns of which quantity
    /// k is `at[k]`.
    pub fn rows(&self, columns: usize, at: &[usize]) -> Vec<(Vec<f64>, f64)> {
        let whitening = self.whitening();
        let row = |row: nalgebra::DVector<f64>| {
            let mut all = vec![0.0; columns];
            at.iter().zip(row.iter()).for_each(|(to, value)| all[*to] = *value);
            (all, row.dot(&self.mean))
        };
        whitening.row_iter().map(|own| row(own.transpose())).collect()
    }

    /// Returns the inverse of [`Gaussian::whitening`].
    pub fn colouring(&self) -> DMatrix<f64> {
        let sd = self.covariance.diagonal().map(f64::sqrt);
        DMatrix::from_diagonal(&sd) * self.correlations_to(0.5)
    }

    /// Returns the distribution of `map x + shift` under other names; `None` if that is not one of
    /// [`Gaussian::new`].
    pub fn mapped(&self, names: Vec<String>, map: &DMatrix<f64>, shift: &DVector<f64>) -> Option<Self> {
        Self::new(names, map * &self.mean + shift, map * &self.covariance * map.transpose())
    }

    /// Compares this distribution with what rows made of it; `None` if they tell nothing, or it is of other
    /// names.
    pub fn agreement(&self, after: &Self) -> Option<Agreement> {
        if self.names != after.names {
            return None;
        }
        let sd = self.covariance.diagonal().map(f64::sqrt);
        let n = sd.len();
        let taken = &self.covariance - &after.covariance;
        let learned = DMatrix::from_fn(n, n, |i, j| taken[(i, j)] / (sd[i] * sd[j]));
        Agreement::new(&(&after.mean - &self.mean).component_div(&sd), learned)
    }

    /// Returns the distribution after something has informed of `y = map x + shift`, whose distribution was
    /// `before` and is `after`: `K = Σ mapᵀ S⁻¹`, `x̂ + K (y′ − y)`, `Σ − K (S − S′) Kᵀ`.
    ///
    /// Returns `None` if sizes differ or the result is not one of [`Gaussian::new`].
    pub fn informed(&self, map: &DMatrix<f64>, before: &Self, after: &Self) -> Option<Self> {
        let m = before.names.len();
        if before.names != after.names || map.shape() != (m, self.names.len()) {
            return None;
        }
        let whitening = before.whitening();
        let gain = &self.covariance * map.transpose() * whitening.tr_mul(&whitening);
        let mean = &self.mean + &gain * (&after.mean - &before.mean);
        let covariance =
            &self.covariance - &gain * (&before.covariance - &after.covariance) * gain.transpose();
        Self::new(self.names.clone(), mean, covariance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn correlated() -> Gaussian {
        let names = ["a", "b", "c"].map(str::to_owned).to_vec();
        let l = DMatrix::from_row_slice(3, 3, &[2.0, 0.0, 0.0, 0.3, 0.01, 0.0, -1.0, 5.0, 40.0]);
        Gaussian::new(names, DVector::from_vec(vec![1.0, -2.0, 3.0]), &l * l.transpose()).unwrap()
    }

    #[test]
    fn rows_of_the_whitening_agree_with_the_covariance() {
        let known = correlated();
        let w = known.whitening();
        let back = (w.tr_mul(&w)).try_inverse().unwrap();
        for (found, covariance) in back.iter().zip(known.covariance().iter()) {
            assert!((found - covariance).abs() < 1e-9 * (1.0 + covariance.abs()));
        }
        assert!((w * known.colouring() - DMatrix::identity(3, 3)).norm() < 1e-9);
        let apart = Gaussian::independent(&[("a".into(), 0.0, 0.5), ("b".into(), 1.0, 4.0)]).unwrap();
        assert_eq!(apart.whitening(), DMatrix::from_diagonal(&DVector::from_vec(vec![2.0, 0.25])));
    }

    /// A measurement of `y = a + b`, once by the normal equations, once by what it does to the distribution
    /// of y.
    #[test]
    fn information_on_a_part_moves_the_whole() {
        let known = correlated();
        let map = DMatrix::from_row_slice(1, 3, &[1.0, 1.0, 0.0]);
        let (value, sigma) = (0.5, 0.2);
        let before = known.mapped(vec!["y".into()], &map, &DVector::zeros(1)).unwrap();
        let variance = 1.0 / (1.0 / before.covariance()[(0, 0)] + 1.0 / (sigma * sigma));
        let mean = variance * (before.mean()[0] / before.covariance()[(0, 0)] + value / (sigma * sigma));
        let after = Gaussian::independent(&[("y".into(), mean, variance.sqrt())]).unwrap();
        let informed = known.informed(&map, &before, &after).unwrap();

        let w = known.whitening();
        let normal = w.tr_mul(&w) + map.tr_mul(&map) / (sigma * sigma);
        let right =
            w.tr_mul(&w) * known.mean() + map.transpose() * DVector::from_element(1, value / (sigma * sigma));
        let covariance = normal.try_inverse().unwrap();
        let mean = &covariance * right;
        for (found, expected) in informed.mean().iter().zip(mean.iter()) {
            assert!((found - expected).abs() < 1e-8 * (1.0 + expected.abs()), "{found} {expected}");
        }
        for (found, expected) in informed.covariance().iter().zip(covariance.iter()) {
            assert!((found - expected).abs() < 1e-8 * (1.0 + expected.abs()), "{found} {expected}");
        }
    }

    #[test]
    fn matrices_that_are_no_distribution_are_refused() {
        let names = || vec!["a".to_owned(), "b".to_owned()];
        let zero = DVector::zeros(2);
        let of = |v: [f64; 4]| Gaussian::new(names(), zero.clone(), DMatrix::from_row_slice(2, 2, &v));
        assert!(of([1.0, 0.5, 0.5, 1.0]).is_some());
        assert!(of([1.0, 1.0, 1.0, 1.0]).is_none() && of([1.0, 0.0, 0.0, -1.0]).is_none());
        assert!(of([1.0, f64::NAN, f64::NAN, 1.0]).is_none());
        assert!(Gaussian::independent(&[]).is_none());
        let nothing = correlated().only(|_| false);
        assert_eq!((nothing.whitening().len(), nothing.colouring().len()), (0, 0));
        let twice = vec!["a".to_owned(), "a".to_owned()];
        assert!(Gaussian::new(twice, zero, DMatrix::identity(2, 2)).is_none());
    }
}
