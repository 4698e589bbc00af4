//! The score test of further columns, and of a step in some columns at every time, beside the common fit of
//! all.
//!
//! With the residuals r of the common fit, the score of a step from bin t on is `S_t = Σ_{b≥t} D_bᵀ (W r)_b`,
//! D being the columns that may step and W the inverse of the noise's covariance with a line and a curve in
//! time taken out of every channel. Its covariance is `V_t = D_tᵀ W D_t − D_tᵀ W X (XᵀWX)⁺ XᵀW D_t`, and
//! `S_tᵀ V_t⁺ S_t` is χ² with as many degrees of freedom as V_t has rank (D. W. K. Andrews, Econometrica 61,
//! 1993).
//!
//! Noise Δ of the signals is in D and in r alike: a bin's score is less by `κ φ`, `κ = E[ΔᵀΔ]`, which is
//! given back, and taken off the information of the common fit, `G = XᵀWX − K`. With `H_t = D_tᵀWX − K_t` the
//! score is `S_t = s_t − H_t G⁻¹ s`, its covariance
//! `D_tᵀWD_t − D_tᵀWX G⁻¹ H_tᵀ − H_t G⁻¹ XᵀWD_t + H_t G⁻¹ XᵀWX G⁻¹ H_tᵀ`. A bin's own varies by `κφ (κφ)ᵀ`
//! more.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::bins::Bins;
use super::directions::{LEAST, filled, seen};
use super::metric::{Inverse, Metric, product};
use super::noise::PowerLaw;
use super::noise_filled::Quiet;
use crate::compensation::{MOST_UNCERTAIN, possible, uncertainty};

/// A column with less than this part in a direction, of that of the largest, that noise could fill has its
/// step by itself.
const MOST_PART: f64 = 0.5;
/// The part that a column has to explain by itself.
pub(super) const PER_COLUMN: f64 = 7.0;

/// The score of a step from a bin on, and its covariance.
#[derive(Clone)]
pub(super) struct Score {
    pub(super) bin: usize,
    score: DVector<f64>,
    information: DMatrix<f64>,
    /// `G⁺ H_tᵀ`: what the common fit gives of a step.
    taken: DMatrix<f64>,
}

impl Score {
    /// Returns the score beside steps in some directions, which explain what they can and are no evidence.
    pub(super) fn beside(mut self, directions: &[DVector<f64>]) -> Self {
        take_out(&mut self.score, &mut self.information, directions);
        self
    }
}

/// Takes out of a score and its covariance what some directions explain.
fn take_out(score: &mut DVector<f64>, information: &mut DMatrix<f64>, directions: &[DVector<f64>]) {
    let whole = information.diagonal();
    for direction in directions {
        let along = &*information * direction;
        let own = direction.dot(&along);
        let scale = whole.dot(&direction.component_mul(direction));
        if own > LEAST * scale {
            score.axpy(-direction.dot(score) / own, &along, 1.0);
            information.ger(-1.0 / own, &along, &along, 1.0);
        }
    }
}

/// Further columns in the bins of a channel.
pub(super) struct Further {
    pub(super) columns: DMatrix<f64>,
    /// Mean product with the channel's own columns that noise of the signals makes in a bin.
    pub(super) expected: DMatrix<f64>,
}

/// Further columns, by channels.
pub(super) type Candidate = Vec<Further>;

/// Further columns, as they explain the residuals.
pub(super) struct Added {
    /// Decrease of χ².
    pub(super) square: f64,
    /// Its degrees of freedom.
    pub(super) rank: usize,
    /// The factors of the columns.
    pub(super) factors: DVector<f64>,
}

/// The common fit, from which scores follow.
pub(super) struct Common<'a> {
    bins: &'a Bins,
    metrics: &'a [Metric],
    /// Columns that may step.
    steps: &'a [usize],
    weighted: Vec<DMatrix<f64>>,
    /// `XᵀWX`.
    gram: DMatrix<f64>,
    /// `G⁻¹` over what is determined.
    inverse: DMatrix<f64>,
    /// Directions that noise of the signals fills, each as long as its parameter may be wrong.
    loose: Vec<DVector<f64>>,
    /// The common fit of the residuals.
    pub(super) fitted: DVector<f64>,
    /// `κ (φ̂ + x̂)`, by channels.
    drawn: Vec<DVector<f64>>,
    /// `W r`, by channels.
    left: Vec<DVector<f64>>,
    /// Information of each column that may step, in all bins.
    whole: Vec<f64>,
    /// Whether noise of the signals is in the columns.
    is_noisy: bool,
}

impl<'a> Common<'a> {
    /// Returns the fit of all columns to the residuals in the bins.
    pub(super) fn new(bins: &'a Bins, metrics: &'a [Metric], steps: &'a [usize]) -> Self {
        let p = bins.columns;
        let (mut gram, mut right) = (DMatrix::zeros(p, p), DVector::zeros(p));
        let mut less = DMatrix::zeros(p, p);
        let mut weighted = Vec::with_capacity(bins.channels);
        let channels = bins.rows.iter().zip(&bins.residuals).zip(&bins.noise);
        for (metric, ((rows, residuals), noise)) in metrics.iter().zip(channels) {
            let own = metric.apply(rows);
            gram += product(rows, &own);
            right += own.tr_mul(residuals);
            weighted.push(own);
            let sum = (0..bins.len()).map(|b| metric.of_bin(b)).sum::<f64>();
            less += noise.gram.columns(0, p) * sum;
            right += &noise.gram * &bins.about * sum;
        }
        let uncertain = bins.noise.iter().map(|noise| noise.uncertain).fold(0.0, f64::max);
        let doubt = bins.noise.iter().map(|noise| noise.doubt).fold(0.0, f64::max);
        let spread = (2.0 * uncertain / bins.len().max(1) as f64).sqrt().hypot(doubt);
        let (inverse, loose) = determined(&gram, &less, &right, spread);
        let fitted = &inverse * right;
        let about = &bins.about + fitted.push(0.0);
        let drawn: Vec<DVector<f64>> = bins.noise.iter().map(|noise| &noise.gram * &about).collect();
        for (metric, (noise, drawn)) in metrics.iter().zip(bins.noise.iter().zip(&drawn)) {
            let squares = (0..bins.len()).map(|b| metric.of_bin(b).powi(2)).sum::<f64>();
            gram.ger(noise.uncertain * squares, drawn, drawn, 1.0);
        }
        let left =
            metrics.iter().zip(bins.rows.iter().zip(&bins.residuals)).map(|(metric, (rows, residuals))| {
                metric.apply(&DMatrix::from_column_slice(
                    residuals.len(),
                    1,
                    (residuals - rows * &fitted).as_slice(),
                ))
            });
        let left = left.map(|m| m.column(0).into_owned()).collect();
        let whole = steps.iter().map(|j| gram[(*j, *j)]).collect();
        let is_noisy = bins.noise.iter().any(|noise| noise.gram.iter().any(|v| *v != 0.0));
        Self { bins, metrics, steps, weighted, gram, inverse, loose, fitted, drawn, left, whole, is_noisy }
    }

    /// Returns what the common fit gives of further columns, and what it adds to the covariance of their
    /// score: `shared` is `DᵀWX`, `true_shared` the same without noise.
    fn eliminated(&self, shared: &DMatrix<f64>, true_shared: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let taken = &self.inverse * true_shared.transpose();
        let across = shared * &taken;
        if !self.is_noisy {
            // G⁺ G G⁺ = G⁺
            return (taken, -across);
        }
        let mut sum = taken.tr_mul(&(&self.gram * &taken)) - &across - across.transpose();
        for direction in &self.loose {
            let moved = true_shared * direction;
            sum.ger(1.0, &moved, &moved, 1.0);
        }
        (taken, sum)
    }

    /// Returns what the common fit leaves of a channel.
    pub(super) fn residual(&self, channel: usize) -> DVector<f64> {
        &self.bins.residuals[channel] - &self.bins.rows[channel] * &self.fitted
    }

    /// Calls `visit` with the score of a step from each of the bins `range` on, the last first.
    pub(super) fn each(&self, range: std::ops::Range<usize>, mut visit: impl FnMut(Score)) {
        let (q, p, count) = (self.steps.len(), self.bins.columns, self.bins.len());
        let mut score = DVector::zeros(q);
        let (mut shared, mut less) = (DMatrix::zeros(q, p), DMatrix::zeros(q, p));
        let mut own = DMatrix::<f64>::zeros(q, q);
        // κ and `κ (φ̂ + x̂)` in the rows of what may step.
        let given: Vec<(DMatrix<f64>, DVector<f64>)> = self
            .bins
            .noise
            .iter()
            .zip(&self.drawn)
            .map(|(noise, drawn)| (noise.gram.select_rows(self.steps), drawn.select_rows(self.steps)))
            .collect();
        let mut drift = vec![DMatrix::<f64>::zeros(q, 2); self.bins.channels];
        let columns: Vec<DMatrix<f64>> =
            self.bins.rows.iter().map(|rows| rows.select_columns(self.steps)).collect();
        for bin in (range.start..count).rev() {
            for (c, metric) in self.metrics.iter().enumerate() {
                let d = columns[c].row(bin).transpose();
                score.axpy(self.left[c][bin], &d, 1.0);
                shared.ger(1.0, &d, &self.weighted[c].row(bin).transpose(), 1.0);
                if self.is_noisy {
                    let (weight, (gram, drawn)) = (metric.of_bin(bin), &given[c]);
                    score.axpy(weight, drawn, 1.0);
                    less += gram.columns(0, p) * weight;
                    let more = self.bins.noise[c].uncertain * weight * weight;
                    shared.ger(more, drawn, &self.drawn[c], 1.0);
                    own.ger(more, drawn, drawn, 1.0);
                }
                match &metric.inverse {
                    Inverse::White(weight) => own.ger(*weight, &d, &d, 1.0),
                    Inverse::Full(inverse) => {
                        let later = count - bin - 1;
                        let behind = inverse.view((bin + 1, bin), (later, 1));
                        let beside = columns[c].rows(bin + 1, later).tr_mul(&behind).column(0).into_owned();
                        own.ger(1.0, &d, &beside, 1.0);
                        own.ger(1.0, &beside, &d, 1.0);
                        own.ger(inverse[(bin, bin)], &d, &d, 1.0);
                    }
                }
                drift[c].ger(1.0, &d, &metric.u.row(bin).transpose(), 1.0);
            }
            if bin < range.end {
                let (taken, eliminated) = self.eliminated(&shared, &(&shared - &less));
                let mut information = &own + eliminated;
                for drift in &drift {
                    information -= drift * drift.transpose();
                }
                visit(Score { bin, score: score.clone(), information, taken });
            }
        }
    }

    /// Returns the decrease of χ² and its degrees of freedom by further columns, given by channels, and what
    /// they are multiplied by. What noise of the signals could fill of them, with residuals of some `noise`,
    /// is no evidence.
    pub(super) fn added(&self, candidate: &Candidate, quiet: Option<(&Quiet, &[PowerLaw])>) -> Added {
        let k = candidate.first().map_or(0, |own| own.columns.ncols());
        let (mut score, mut information) = (DVector::zeros(k), DMatrix::zeros(k, k));
        let (mut shared, mut less) =
            (DMatrix::zeros(k, self.bins.columns), DMatrix::zeros(k, self.bins.columns));
        let about = &self.bins.about + self.fitted.push(0.0);
        let mut could = DMatrix::zeros(k, k);
        for (c, Further { columns, expected }) in candidate.iter().enumerate() {
            score += columns.tr_mul(&self.left[c]);
            information += product(columns, &self.metrics[c].apply(columns));
            shared += product(columns, &self.weighted[c]);
            let weights = (0..self.bins.len()).map(|b| self.metrics[c].of_bin(b));
            let (weight, squares) = weights.fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
            let drawn = expected * &about;
            score.axpy(weight, &drawn, 1.0);
            less += expected.columns(0, self.bins.columns) * weight;
            let more = self.bins.noise[c].uncertain * squares;
            information.ger(more, &drawn, &drawn, 1.0);
            shared.ger(more, &drawn, &self.drawn[c], 1.0);
            if let Some((quiet, noise)) = quiet {
                could += quiet.scatter(columns) * (weight * quiet.room(c, noise));
            }
        }
        let filled = match quiet.and_then(|_| seen(&information)) {
            Some(unit) => filled(&unit, &could),
            None => Vec::new(),
        };
        let whole: Vec<f64> = information.diagonal().iter().copied().collect();
        let mut information = information + self.eliminated(&shared, &(&shared - &less)).1;
        take_out(&mut score, &mut information, &filled);
        let all: Vec<usize> = (0..k).collect();
        let [(square, rank), _] = explained(&score, &information, &whole, [&all, &[]]);
        Added { square, rank, factors: pseudo_inverse(&information).0 * score }
    }

    /// Returns the score of a step from a bin on.
    pub(super) fn at(&self, bin: usize) -> Option<Score> {
        let mut found = None;
        self.each(bin..bin + 1, |score| found = Some(score));
        found
    }

    /// Returns the decrease of χ² and its degrees of freedom by steps in a first set of columns, then in a
    /// second beside them; columns are places among those that may step.
    pub(super) fn explained(&self, score: &Score, sets: [&[usize]; 2]) -> [(f64, usize); 2] {
        explained(&score.score, &score.information, &self.whole, sets)
    }

    /// Returns the steps in some columns that explain most, their covariance, and true where they are
    /// determined and have no part in directions that noise could fill.
    pub(super) fn step(&self, score: &Score, set: &[usize], filled: &[DVector<f64>]) -> Step {
        let own = score.information.select_rows(set).select_columns(set);
        let right = score.score.select_rows(set);
        let (covariance, mut determined) = pseudo_inverse(&own);
        for direction in filled {
            let part = |k: usize| direction[k] * score.information[(k, k)].max(0.0).sqrt();
            let most = (0..direction.len()).map(|k| part(k).abs()).fold(0.0, f64::max);
            let known = determined.iter_mut().zip(set);
            known.for_each(|(known, k)| *known &= part(*k).abs() < MOST_PART * most);
        }
        let value = &covariance * right;
        // What the common fit is beside that step.
        let mut fitted = self.fitted.clone();
        for (k, value) in set.iter().zip(value.iter()) {
            fitted.axpy(-value, &score.taken.column(*k), 1.0);
        }
        Step { columns: set.iter().map(|k| self.steps[*k]).collect(), value, covariance, determined, fitted }
    }
}

/// Returns the decrease of χ² and its degrees of freedom by a first set of columns, then by a second beside
/// them: the rows of a Cholesky factor one after the other, without what is next to nothing of a column's
/// `whole` information.
fn explained(
    score: &DVector<f64>,
    information: &DMatrix<f64>,
    whole: &[f64],
    sets: [&[usize]; 2],
) -> [(f64, usize); 2] {
    let mut kept: Vec<(DVector<f64>, f64)> = Vec::new();
    let (mut sum, mut rank) = (0.0, 0);
    sets.map(|set| {
        for k in set {
            let mut column = information.column(*k).into_owned();
            let mut value = score[*k];
            for (other, y) in &kept {
                let along = other[*k];
                column.axpy(-along, other, 1.0);
                value -= along * y;
            }
            let left = column[*k];
            if left > LEAST * whole[*k] {
                let y = value / left.sqrt();
                kept.push((column / left.sqrt(), y));
                sum += y * y;
                rank += 1;
            }
        }
        (sum, rank)
    })
}

/// Returns `(V − K)⁻¹` over what is determined, V being `XᵀWX`, and the directions that are not as noise
/// fills them, each as long as what it may be wrong by: twice the size of what is found.
fn determined(
    gram: &DMatrix<f64>,
    noise: &DMatrix<f64>,
    right: &DVector<f64>,
    spread: f64,
) -> (DMatrix<f64>, Vec<DVector<f64>>) {
    let n = gram.nrows();
    let (mut inverse, mut loose) = (DMatrix::zeros(n, n), Vec::new());
    let Some(unit) = seen(gram).filter(|_| noise.iter().all(|v| v.is_finite())) else {
        return (inverse, loose);
    };
    let seen = unit.ncols();
    let shares = SymmetricEigen::new(DMatrix::identity(seen, seen) - unit.tr_mul(&(noise * &unit)));
    for (share, v) in shares.eigenvalues.iter().zip(shares.eigenvectors.column_iter()) {
        let direction = &unit * v;
        if uncertainty(*share, spread) <= MOST_UNCERTAIN {
            inverse.ger(1.0 / share, &direction, &direction, 1.0);
        } else {
            let most = possible(direction.dot(right), *share);
            loose.push(direction * most);
        }
    }
    (inverse, loose)
}

/// A step that was found.
pub(super) struct Step {
    pub(super) columns: Vec<usize>,
    pub(super) value: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    pub(super) determined: Vec<bool>,
    /// The common fit of the residuals beside it, one a column.
    pub(super) fitted: DVector<f64>,
}

/// Returns the inverse over the directions that are determined, and the coordinates that have no part in
/// others.
fn pseudo_inverse(matrix: &DMatrix<f64>) -> (DMatrix<f64>, Vec<bool>) {
    let n = matrix.nrows();
    let scale = matrix.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let mut determined: Vec<bool> = scale.iter().map(|s| *s > 0.0).collect();
    let mut inverse = DMatrix::zeros(n, n);
    if n == 0 || !scaled.iter().all(|v| v.is_finite()) {
        determined.fill(false);
        return (inverse, determined);
    }
    let eigen = SymmetricEigen::new(scaled);
    let most = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
    for (value, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > LEAST * most {
            let natural = direction.component_mul(&scale);
            inverse.ger(1.0 / value, &natural, &natural, 1.0);
        } else {
            for (known, share) in determined.iter_mut().zip(direction.iter()) {
                *known &= share.abs() < 1e-3;
            }
        }
    }
    (inverse, determined)
}
