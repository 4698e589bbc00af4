//! Least squares for skews: the solution, its covariance where residuals are coloured, and what the rows do
//! not determine.

use nalgebra::{DMatrix, DVector};

/// Lags of the covariance, as a fraction of the rows, and the two-sided 95 % factor that belongs to it:
/// `1.96 + 2.9694 b + 0.4160 b² − 0.5324 b³`.
const FRACTION: f64 = 0.1;
const FACTOR: f64 = 1.96 + FRACTION * (2.9694 + FRACTION * (0.4160 - FRACTION * 0.5324));
/// Directions whose scaled eigenvalue is below this are not determined.
const SINGULAR: f64 = 1e-10;

/// A linearised fit, each channel weighted by what it leaves.
pub(super) struct Fit {
    /// The skews' steps, then the other parameters.
    pub(super) solution: DVector<f64>,
    /// Influence of each instant on the skews.
    influence: Vec<DVector<f64>>,
    /// Variances of the skews for rows that are independent.
    pub(super) independent: Vec<f64>,
    /// Skews that the rows do not determine.
    pub(super) lost: Vec<bool>,
}

impl Fit {
    /// Solves rows `a θ = y`, an instant each, of which the first `skews` columns are of skews.
    pub(super) fn new(design: &[(DMatrix<f64>, DVector<f64>)], skews: usize) -> Self {
        let (channels, parameters) = design.first().map_or((0, skews), |(a, _)| a.shape());
        let mut sigma = vec![1.0; channels];
        let mut solution = DVector::zeros(parameters);
        let mut inverse = DMatrix::zeros(parameters, parameters);
        let mut lost = vec![design.is_empty(); skews];
        for _ in 0..3 {
            let mut gram = DMatrix::<f64>::zeros(parameters, parameters);
            let mut right = DVector::<f64>::zeros(parameters);
            for (a, y) in design {
                for (c, sigma) in sigma.iter().enumerate() {
                    let row = a.row(c).transpose() / *sigma;
                    gram.ger(1.0, &row, &row, 1.0);
                    right.axpy(y[c] / sigma, &row, 1.0);
                }
            }
            (inverse, lost) = pseudo_inverse(&gram, skews);
            solution = &inverse * right;
            let mut squares = vec![0.0; channels];
            for (a, y) in design {
                let e = y - a * &solution;
                for (square, e) in squares.iter_mut().zip(e.iter()) {
                    *square += e * e;
                }
            }
            let worst = squares.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
            sigma =
                squares.iter().map(|s| (s.max(1e-12 * worst) / design.len().max(1) as f64).sqrt()).collect();
        }
        let influence = design
            .iter()
            .map(|(a, y)| {
                let e = y - a * &solution;
                let mut score = DVector::zeros(parameters);
                for (c, sigma) in sigma.iter().enumerate() {
                    score.axpy(e[c] / (sigma * sigma), &a.row(c).transpose(), 1.0);
                }
                (&inverse * score).rows(0, skews).into_owned()
            })
            .collect();
        let spent =
            design.len() as f64 / (design.len() as f64 - parameters as f64 / channels as f64).max(1.0);
        let independent = (0..skews).map(|i| inverse[(i, i)] * spent).collect();
        Self { solution, influence, independent, lost }
    }

    /// As [`sandwich`], of its own rows.
    pub(super) fn covariance(&self, skews: usize, noise_gain: f64) -> DMatrix<f64> {
        sandwich(&self.influence, &self.independent, skews, noise_gain)
    }
}

/// Sandwich with Bartlett's weights over the influence of each instant, scaled so that 1.96 σ are 95 %; its
/// variances at least those of noise that was white before a filter of this noise gain, of which
/// `independent` are those of rows that are independent.
pub(super) fn sandwich(
    influence: &[DVector<f64>],
    independent: &[f64],
    skews: usize,
    noise_gain: f64,
) -> DMatrix<f64> {
    let count = influence.len();
    let lags = ((FRACTION * count as f64).ceil() as usize).max(1);
    let mut sum = DMatrix::zeros(skews, skews);
    for lag in 0..lags.min(count) {
        let weight = 1.0 - lag as f64 / lags as f64;
        let mut gamma = DMatrix::<f64>::zeros(skews, skews);
        for (now, before) in influence.iter().skip(lag).zip(influence) {
            gamma.ger(weight, now, before, 1.0);
        }
        if lag > 0 {
            gamma += gamma.transpose();
        }
        sum += gamma;
    }
    sum *= (FACTOR / 1.96_f64).powi(2);
    let wider: Vec<f64> = independent
        .iter()
        .enumerate()
        .map(|(i, independent)| (independent / noise_gain / sum[(i, i)]).max(1.0).sqrt())
        .collect();
    DMatrix::from_fn(skews, skews, |i, j| sum[(i, j)] * wider[i] * wider[j])
}

/// Inverse over what the rows determine, columns scaled; and which of the first parameters they do not.
fn pseudo_inverse(gram: &DMatrix<f64>, first: usize) -> (DMatrix<f64>, Vec<bool>) {
    let scale = gram.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(gram.nrows(), gram.ncols(), |i, j| gram[(i, j)] * scale[i] * scale[j]);
    let eigen = scaled.symmetric_eigen();
    let mut inverse = DMatrix::zeros(gram.nrows(), gram.ncols());
    let mut inside = vec![0.0; first];
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > SINGULAR {
            inverse.ger(1.0 / value, &vector, &vector, 1.0);
            for (inside, v) in inside.iter_mut().zip(vector.iter()) {
                *inside += v * v;
            }
        }
    }
    let inverse = DMatrix::from_fn(gram.nrows(), gram.ncols(), |i, j| inverse[(i, j)] * scale[i] * scale[j]);
    (inverse, inside.iter().zip(scale.iter()).map(|(inside, s)| *s == 0.0 || *inside < 0.999).collect())
}
