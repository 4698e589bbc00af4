//! Quick least squares: how much of each channel the rows explain, without any of what makes an answer.

use nalgebra::DVector;

use super::condition::no_rows;
use super::{Factor, FitError, RowSource, Silent};

/// Blocks that are examined.
pub const BLOCKS: usize = 800;
/// Rounds in which the weights follow from the residuals.
const ROUNDS: usize = 2;
/// A residual that is smaller than this share of the measurement is rounding.
const LEAST_SHARE: f64 = 1e-9;
/// A column of which less than this share is in no other is nearly one of them.
const APART: f64 = 1e-4;

/// The residuals of least squares in each channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Explained {
    /// Residual over measurement by channels, root mean squares of filtered rows.
    pub shares: Vec<f64>,
    /// The estimate; meaningless of what the rows do not determine.
    pub values: Vec<f64>,
}

impl Explained {
    /// Returns the mean logarithm of the shares: −1 times the log-likelihood per row, of noise of which only
    /// is known that it is white, up to a constant. It does not change if a channel is measured in another
    /// unit, or channels change places.
    pub fn unexplained(&self) -> f64 {
        let sum: f64 = self.shares.iter().map(|share| share.max(LEAST_SHARE).ln()).sum();
        sum / self.shares.len().max(1) as f64
    }
}

/// Filtered rows of some blocks of a source.
struct Rows {
    channels: usize,
    parameters: usize,
    blocks: usize,
    /// One line of `parameters` numbers a row, the channels of a block one after the other.
    rows: Vec<f64>,
    measured: Vec<f64>,
}

impl Rows {
    /// Writes the rows of at most this many blocks.
    fn of(source: &dyn RowSource, most: usize) -> Result<Self, FitError> {
        let blocks = source.blocks(&Silent)?;
        if blocks.is_empty() {
            return Err(no_rows(&*blocks));
        }
        let (channels, parameters) = (source.channels().len(), source.parameters().len());
        let picked: Vec<usize> =
            (0..blocks.len()).step_by(blocks.len().div_ceil(most.max(1)).max(1)).collect();
        let (width, count) = (channels * parameters, picked.len());
        let (mut rows, mut measured) = (vec![0.0; width * count], vec![0.0; channels * count]);
        let to = rows.chunks_exact_mut(width.max(1)).zip(measured.chunks_exact_mut(channels.max(1)));
        picked.iter().zip(to).for_each(|(block, (rows, values))| blocks.write(*block, rows, values));
        Ok(Self { channels, parameters, blocks: count, rows, measured })
    }

    /// Returns each row with what was measured.
    fn lines(&self) -> impl Iterator<Item = (&[f64], f64)> {
        self.rows.chunks_exact(self.parameters.max(1)).zip(self.measured.iter().copied())
    }

    /// Returns what is measured less what parameters predict, row by row.
    fn left(&self, values: &[f64]) -> Vec<f64> {
        let predicted = |row: &[f64]| row.iter().zip(values).map(|(a, b)| a * b).sum::<f64>();
        self.lines().map(|(row, value)| value - predicted(row)).collect()
    }

    /// Returns the rows of each channel as a factor: rounds of weights need no rows.
    fn by_channel(&self) -> Vec<Factor> {
        let of = |c: usize| {
            let mut factor = Factor::new(self.parameters);
            factor.absorb(self.lines().skip(c).step_by(self.channels));
            factor
        };
        (0..self.channels).map(of).collect()
    }

    /// Returns what weighted least squares explain, and the σ of each channel that they found.
    fn explained(&self, source: &dyn RowSource) -> (Explained, Vec<f64>) {
        let mut sigma = source.nominal_sigma();
        let mut found = Explained { shares: vec![1.0; self.channels], values: vec![0.0; self.parameters] };
        let factors = self.by_channel();
        let mut whole = vec![0.0; self.channels];
        for (k, value) in self.measured.iter().enumerate() {
            whole[k % self.channels] += value * value;
        }
        for _ in 0..ROUNDS {
            found.values = estimate(&weighted(&factors, &sigma), source.rounding());
            for (c, (factor, whole)) in factors.iter().zip(&whole).enumerate() {
                let left = square(factor, &found.values);
                found.shares[c] = if *whole > 0.0 { (left / whole).sqrt() } else { 1.0 };
                let least = LEAST_SHARE * (whole / self.blocks as f64).sqrt();
                sigma[c] = (left / self.blocks as f64).sqrt().max(least);
            }
        }
        (found, sigma)
    }

    /// Solves for the parameters, and for those of more columns.
    fn solve(&self, sigma: &[f64], more: &[Vec<f64>], rounding: f64) -> Vec<f64> {
        let weight =
            |k: usize| 1.0 / sigma.get(k % self.channels).copied().unwrap_or(1.0).max(f64::MIN_POSITIVE);
        let beside = |k: usize| more.iter().map(move |column| column.get(k).copied().unwrap_or(0.0));
        let whitened = self.lines().enumerate().map(|(k, (row, value))| {
            let all = row.iter().copied().chain(beside(k));
            (all.map(|a| weight(k) * a).collect::<Vec<f64>>(), weight(k) * value)
        });
        let whitened: Vec<(Vec<f64>, f64)> = whitened.collect();
        let mut factor = Factor::new(self.parameters + more.len());
        factor.absorb(whitened.iter().map(|(row, value)| (row.as_slice(), *value)));
        factor.solve(rounding).estimate
    }
}

/// Returns the channels' rows together, each over its σ.
fn weighted(factors: &[Factor], sigma: &[f64]) -> Factor {
    let mut all = Factor::new(factors.first().map_or(0, Factor::parameters));
    for (factor, sigma) in factors.iter().zip(sigma) {
        let weight = 1.0 / sigma.max(f64::MIN_POSITIVE);
        let values: Vec<f64> = factor.z().iter().map(|z| weight * z).collect();
        all.absorb_matrix(&(factor.r() * weight), &values);
    }
    all
}

/// Returns the sum of squares that parameters leave of the rows of a factor.
fn square(factor: &Factor, values: &[f64]) -> f64 {
    let predicted = factor.r() * DVector::from_column_slice(values);
    let left = factor.z().iter().zip(&predicted).map(|(z, p)| (z - p).powi(2)).sum::<f64>();
    left + factor.residual_sum_of_squares()
}

/// Returns the solution of a factor; without singular values where no column is nearly one of others.
fn estimate(factor: &Factor, rounding: f64) -> Vec<f64> {
    let r = factor.r();
    let is_apart = |j: usize| r[(j, j)].abs() > APART * r.column(j).norm();
    let solved = (0..r.ncols()).all(is_apart).then(|| {
        let z = DVector::from_column_slice(factor.z());
        r.solve_upper_triangular(&z).filter(|values| values.iter().all(|v| v.is_finite()))
    });
    solved.flatten().map_or_else(|| factor.solve(rounding).estimate, |values| values.as_slice().to_vec())
}

/// Returns what weighted least squares explain of the rows of a source, of at most this many blocks
/// ([`BLOCKS`]).
///
/// # Errors
/// [`FitError`] if there are no rows.
pub fn explained(source: &dyn RowSource, most: usize) -> Result<Explained, FitError> {
    Ok(Rows::of(source, most)?.explained(source).0)
}

/// Returns the step of Gauss and Newton for settings that the rows of a source depend on: how far each is to
/// be moved so that least squares leave less. `moved` are the source with one setting moved by one unit each;
/// `None` where their rows are not those of the source one by one.
///
/// # Errors
/// [`FitError`] if there are no rows.
pub fn steps(source: &dyn RowSource, moved: &[&dyn RowSource]) -> Result<Option<Vec<f64>>, FitError> {
    let own = Rows::of(source, BLOCKS)?;
    let (found, sigma) = own.explained(source);
    let left = own.left(&found.values);
    let mut columns = Vec::new();
    for moved in moved {
        let rows = Rows::of(*moved, BLOCKS)?;
        if rows.measured.len() != own.measured.len() || rows.parameters != own.parameters {
            return Ok(None);
        }
        let moved = rows.left(&found.values);
        columns.push(left.iter().zip(moved).map(|(before, after)| before - after).collect());
    }
    let all = own.solve(&sigma, &columns, source.rounding());
    Ok(all.get(own.parameters..).map(<[f64]>::to_vec))
}
