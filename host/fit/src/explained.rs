//! Quick least squares: how much of each channel the rows explain, without any of what makes an answer.

use super::condition::no_rows;
use super::{Factor, FitError, RowSource, Silent};

/// Blocks that are looked at.
const BLOCKS: usize = 800;
/// Rounds in which the weights follow from the residuals.
const ROUNDS: usize = 2;
/// A residual that is smaller than this share of the measurement is rounding.
const LEAST_SHARE: f64 = 1e-9;

/// What least squares leave of each channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Explained {
    /// Residual over measurement by channels, root mean squares of filtered rows.
    pub shares: Vec<f64>,
    /// The estimate; meaningless of what the rows do not determine.
    pub values: Vec<f64>,
}

impl Explained {
    /// Returns the mean logarithm of the shares: −1 times the log-likelihood per row, of noise of which only is known that it is
    /// white, up to a constant. It does not change if a channel is measured in another unit, or channels change places.
    pub fn unexplained(&self) -> f64 {
        let sum: f64 = self.shares.iter().map(|share| share.max(LEAST_SHARE).ln()).sum();
        sum / self.shares.len().max(1) as f64
    }
}

/// Returns what weighted least squares explain of the rows of a source.
///
/// # Errors
/// [`FitError`] if there are no rows.
pub fn explained(source: &dyn RowSource) -> Result<Explained, FitError> {
    let blocks = source.blocks(&Silent)?;
    if blocks.is_empty() {
        return Err(no_rows(&*blocks));
    }
    let (channels, parameters) = (source.channels().len(), source.parameters().len());
    let picked: Vec<usize> = (0..blocks.len()).step_by(blocks.len().div_ceil(BLOCKS).max(1)).collect();
    let (width, count) = (channels * parameters, picked.len());
    let (mut rows, mut measured) = (vec![0.0; width * count], vec![0.0; channels * count]);
    for ((block, rows), values) in
        picked.iter().zip(rows.chunks_exact_mut(width.max(1))).zip(measured.chunks_exact_mut(channels.max(1)))
    {
        blocks.write(*block, rows, values);
    }
    let lines = || rows.chunks_exact(parameters.max(1)).zip(&measured).enumerate();
    let mut sigma = source.nominal_sigma();
    let mut found = Explained { shares: vec![1.0; channels], values: vec![0.0; parameters] };
    for _ in 0..ROUNDS {
        let weight = |k: usize| 1.0 / sigma.get(k % channels).copied().unwrap_or(1.0).max(f64::MIN_POSITIVE);
        let whitened: Vec<(Vec<f64>, f64)> = lines()
            .map(|(k, (row, value))| (row.iter().map(|a| weight(k) * a).collect(), weight(k) * value))
            .collect();
        let mut factor = Factor::new(parameters);
        factor.absorb(whitened.iter().map(|(row, value)| (row.as_slice(), *value)));
        found.values = factor.solve(source.rounding()).estimate;
        let (mut left, mut whole) = (vec![0.0; channels], vec![0.0; channels]);
        for (k, (row, value)) in lines() {
            let predicted: f64 = row.iter().zip(&found.values).map(|(a, b)| a * b).sum();
            left[k % channels] += (value - predicted).powi(2);
            whole[k % channels] += value * value;
        }
        for c in 0..channels {
            found.shares[c] = if whole[c] > 0.0 { (left[c] / whole[c]).sqrt() } else { 1.0 };
            let least = LEAST_SHARE * (whole[c] / count as f64).sqrt();
            sigma[c] = (left[c] / count as f64).sqrt().max(least);
        }
    }
    Ok(found)
}
