//! Noise of the signals that coefficients are made of: it stands in the rows, and does not average out there.
//!
//! Rows `Y + Δ` in place of Y move the estimate by `−(RᵀR)⁻¹ (Y + Δ)ᵀ W Δ φ`. The expectation is of second order in the
//! noise: `ΔᵀWΔ`, which draws the estimate to zero, and the mean that Δ has where signals occur in products. Both are found
//! by noise of the same size that is added once more, with either sign: what is of first order cancels in the mean of the
//! two. (J. Cook, L. Stefanski, J. American Statistical Association 89 (428), 1994, extrapolate in the same way.) The
//! answer is not moved back, as σ is known by its order only: intervals count the whole of it.

use nalgebra::DVector;

use super::{Estimate, FitError, RowBlocks, RowSource, Silent};

/// Longer recordings are looked at in their middle.
const LONGEST: usize = 20_000;

/// Row blocks of the source's middle: as they are, and with noise of either sign.
struct Noisy<'a> {
    /// Parts of the recording that the middle stands for.
    share: f64,
    quiet: Quiet<'a>,
    noisy: [Box<dyn RowBlocks + 'a>; 2],
}

enum Quiet<'a> {
    All(&'a dyn RowBlocks),
    Middle(Box<dyn RowBlocks + 'a>),
}

/// Returns the expected error of every parameter from noise of the signals, zero where nothing determines it; `None` if the
/// source's signals have no noise that is known. `covariance` of `estimate` is that of rows whitened by `sigma`, not scaled.
///
/// # Errors
/// [`FitError`] if the middle of a recording cannot be filtered.
pub(super) fn bias(
    source: &dyn RowSource,
    blocks: &dyn RowBlocks,
    estimate: &Estimate,
    sigma: &[f64],
) -> Result<Option<Vec<f64>>, FitError> {
    let samples = source.samples();
    let from = samples.saturating_sub(LONGEST) / 2;
    let middle = from..samples.min(from + LONGEST);
    let with = |scale: f64| source.with_signal_noise(middle.clone(), scale);
    let (Some(more), Some(less)) = (with(1.0), with(-1.0)) else { return Ok(None) };
    let all = middle.len() == samples;
    let same = if all { None } else { with(0.0) };
    let quiet = match &same {
        None => Quiet::All(blocks),
        Some(same) => Quiet::Middle(same.condition(&Silent)?),
    };
    let noisy = Noisy {
        share: samples as f64 / middle.len().max(1) as f64,
        quiet,
        noisy: [more.condition(&Silent)?, less.condition(&Silent)?],
    };
    let n = estimate.len();
    let pull = noisy.pull(estimate, sigma);
    let moved = &estimate.covariance * DVector::from_vec(pull);
    Ok(Some((0..n).map(|j| if estimate.is_determined(j) { -moved[j] } else { 0.0 }).collect()))
}

/// Returns the root mean square, per row whitened by `sigma`, of what noise of the signals brings to the coefficients of
/// each parameter; zeros if the signals have no noise that is known.
///
/// # Errors
/// [`FitError`] if the middle of a recording cannot be filtered.
pub(super) fn coefficient_noise(source: &dyn RowSource, sigma: &[f64]) -> Result<Vec<f64>, FitError> {
    let n = source.parameters().len();
    let samples = source.samples();
    let from = samples.saturating_sub(LONGEST) / 2;
    let middle = from..samples.min(from + LONGEST);
    let with = |scale: f64| source.with_signal_noise(middle.clone(), scale);
    let (Some(more), Some(same)) = (with(1.0), with(0.0)) else { return Ok(vec![0.0; n]) };
    let (noisy, quiet) = (more.condition(&Silent)?, same.condition(&Silent)?);
    let mut sums = vec![0.0; n];
    let mut rows = 0.0;
    let every = f64::from(noisy.filter().every);
    for_pairs(&*noisy, &*quiet, n, sigma.len(), |a, b| {
        for ((a, b), sigma) in a.chunks_exact(n.max(1)).zip(b.chunks_exact(n.max(1))).zip(sigma) {
            rows += 1.0;
            for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
                *sum += every * ((a - b) / sigma).powi(2);
            }
        }
    });
    Ok(sums.into_iter().map(|s: f64| if rows > 0.0 { (s / rows).sqrt() } else { 0.0 }).collect())
}

/// Calls `each` with the rows of two sources, block by block.
fn for_pairs(
    a: &dyn RowBlocks,
    b: &dyn RowBlocks,
    n: usize,
    channels: usize,
    mut each: impl FnMut(&[f64], &[f64]),
) {
    let mut measured = vec![0.0; channels];
    let (mut rows, mut other) = (vec![0.0; channels * n], vec![0.0; channels * n]);
    for block in 0..a.len().min(b.len()) {
        a.write(block, &mut rows, &mut measured);
        b.write(block, &mut other, &mut measured);
        each(&rows, &other);
    }
}

impl Noisy<'_> {
    fn pull(&self, estimate: &Estimate, sigma: &[f64]) -> Vec<f64> {
        let n = estimate.len();
        let quiet = match &self.quiet {
            Quiet::All(blocks) => *blocks,
            Quiet::Middle(blocks) => &**blocks,
        };
        let every = f64::from(quiet.filter().every);
        let mut pull = vec![0.0; n];
        for noisy in &self.noisy {
            for_pairs(&**noisy, quiet, n, sigma.len(), |rows, own| {
                let lines = rows.chunks_exact(n.max(1)).zip(own.chunks_exact(n.max(1)));
                for ((row, own), sigma) in lines.zip(sigma) {
                    let differ = row.iter().zip(own).zip(&estimate.values);
                    let error: f64 = differ.map(|((a, b), phi)| (a - b) * phi).sum();
                    let weight = 0.5 * self.share * every / (sigma * sigma);
                    for (pull, a) in pull.iter_mut().zip(row) {
                        *pull += weight * a * error;
                    }
                }
            });
        }
        pull
    }
}
