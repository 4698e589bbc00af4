//! Whitening of rows whose noise is correlated from channel to channel and, where rates are differentiated,
//! in time.
//!
//! Noise of the measured side and of accelerometers is white; that of an angular acceleration, which is a
//! filtered rate's derivative, has a spectrum that rises with the square of the frequency: `S(ω) = Σ + ω² Ω`.
//! With `Σ = L Lᵀ` and `L⁻¹ Ω L⁻ᵀ = U diag(τ²) Uᵀ` the channels of `T = Uᵀ L⁻¹` are independent, with spectra
//! `1 + ω² τ²`: a low-pass of one pole of the time constant τ makes each of them white. Rows and measurements
//! go through the same low-pass, so that the equation stays exact.

use nalgebra::{Cholesky, DMatrix, SymmetricEigen};

/// A pole below this share of the period of the rows does nothing.
const LEAST_POLE: f64 = 0.02;
/// Time constants after which a low-pass has forgotten where it started.
const SETTLED: f64 = 10.0;

/// The matrix that multiplies the rows of a block, C × C, and the time constants of the low-pass of each
/// channel after that.
#[derive(Clone, Debug, PartialEq)]
pub struct Whitening {
    channels: usize,
    /// Row by row.
    matrix: Vec<f64>,
    /// Nothing is beside the diagonal, and there is no low-pass.
    is_diagonal: bool,
    /// `2 τ / T` of each channel, T being the period of the rows; zero: none.
    poles: Vec<f64>,
    /// Period of the rows, s; zero for still poses.
    period_s: f64,
}

impl Whitening {
    /// Returns the whitening of independent channels: each is multiplied by its weight.
    pub fn diagonal(weights: &[f64]) -> Self {
        let channels = weights.len();
        let mut matrix = vec![0.0; channels * channels];
        for (c, weight) in weights.iter().enumerate() {
            matrix[c * channels + c] = *weight;
        }
        Self { channels, matrix, is_diagonal: true, poles: vec![0.0; channels], period_s: 0.0 }
    }

    /// Returns the whitening of noise of the spectrum `white + ω² rising`, C × C each, times `√factor`;
    /// `None` if `white` is not positive definite. `period_s` is that of the rows.
    pub fn of_spectrum(
        white: &DMatrix<f64>,
        rising: &DMatrix<f64>,
        factor: f64,
        period_s: f64,
    ) -> Option<Self> {
        let channels = white.nrows();
        let inverse = Cholesky::new(white.clone())?
            .l()
            .solve_lower_triangular(&DMatrix::identity(channels, channels))?;
        let eigen = SymmetricEigen::new(&inverse * rising * inverse.transpose());
        let together = eigen.eigenvectors.transpose() * inverse * factor.sqrt();
        let matrix: Vec<f64> = together.transpose().iter().copied().collect();
        let pole = |square: &f64| {
            let pole = if period_s > 0.0 { 2.0 * square.max(0.0).sqrt() / period_s } else { 0.0 };
            if pole > LEAST_POLE { pole } else { 0.0 }
        };
        let poles: Vec<f64> = eigen.eigenvalues.iter().map(pole).collect();
        let is_good = matrix.iter().chain(&poles).all(|v| v.is_finite());
        is_good.then_some(Self { channels, matrix, is_diagonal: false, poles, period_s })
    }

    /// Returns the number of channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Returns the weights of independent channels without a low-pass; `None` if they are correlated.
    pub fn weights(&self) -> Option<Vec<f64>> {
        self.is_diagonal.then(|| (0..self.channels).map(|c| self.matrix[c * self.channels + c]).collect())
    }

    /// Returns the channels by the low-pass that they have: each low-pass with its rows of T.
    pub(super) fn by_pole(&self) -> Vec<PoleGroup> {
        let mut groups: Vec<(f64, PoleGroup)> = Vec::new();
        for (pole, row) in self.poles.iter().zip(self.matrix.chunks_exact(self.channels.max(1))) {
            let place = groups.iter().position(|(own, _)| own == pole).unwrap_or_else(|| {
                let low_pass = Self {
                    channels: 1,
                    matrix: vec![1.0],
                    is_diagonal: *pole == 0.0,
                    poles: vec![*pole],
                    period_s: self.period_s,
                };
                groups.push((*pole, PoleGroup { low_pass, rows: Vec::new() }));
                groups.len() - 1
            });
            if let Some((_, group)) = groups.get_mut(place) {
                group.rows.push(row.to_vec());
            }
        }
        groups.into_iter().map(|(_, group)| group).collect()
    }

    /// Returns the blocks before the first that the low-pass has to have seen.
    pub fn lead(&self) -> usize {
        let longest = self.poles.iter().copied().fold(0.0, f64::max);
        (SETTLED * 0.5 * longest).ceil() as usize
    }
}

/// Channels with the same low-pass.
pub(super) struct PoleGroup {
    /// The low-pass, of one channel.
    pub(super) low_pass: Whitening,
    /// Their rows of T.
    pub(super) rows: Vec<Vec<f64>>,
}

/// A whitening on its way through the blocks of `n` parameters.
pub struct Whitener<'a> {
    whitening: &'a Whitening,
    n: usize,
    /// Input and output of the block before, coefficients and then the value of each channel.
    before: Vec<f64>,
    after: Vec<f64>,
    spare: Vec<f64>,
    time_s: Option<f64>,
}

impl<'a> Whitener<'a> {
    /// Returns the whitening of blocks of `n` parameters, before the first.
    pub fn new(whitening: &'a Whitening, n: usize) -> Self {
        let length = whitening.channels * (n + 1);
        Self {
            whitening,
            n,
            before: vec![0.0; length],
            after: vec![0.0; length],
            spare: vec![0.0; length],
            time_s: None,
        }
    }

    /// Whitens the rows of the next block in place, C rows of n coefficients and C values; `weights` multiply
    /// the channels before. After a gap in time the low-pass starts anew.
    pub fn apply(&mut self, time_s: f64, rows: &mut [f64], values: &mut [f64], weights: Option<&[f64]>) {
        let Whitening { channels, matrix, poles, period_s, is_diagonal } = self.whitening;
        let (channels, n) = (*channels, self.n);
        if let Some(weights) = weights {
            for (row, (value, weight)) in rows.chunks_exact_mut(n.max(1)).zip(values.iter_mut().zip(weights))
            {
                row.iter_mut().for_each(|v| *v *= weight);
                *value *= weight;
            }
        }
        if *is_diagonal {
            for (c, (row, value)) in rows.chunks_exact_mut(n.max(1)).zip(values.iter_mut()).enumerate() {
                let weight = matrix[c * channels + c];
                row.iter_mut().for_each(|v| *v *= weight);
                *value *= weight;
            }
            return;
        }
        let begins = self.time_s.is_none_or(|before| (time_s - before - period_s).abs() > 0.5 * period_s);
        self.time_s = Some(time_s);
        for (line, own) in matrix.chunks_exact(channels).zip(self.spare.chunks_exact_mut(n + 1)) {
            own.fill(0.0);
            let (sums, last) = own.split_at_mut(n);
            for (factor, (row, value)) in line.iter().zip(rows.chunks_exact(n.max(1)).zip(values.iter())) {
                if *factor != 0.0 {
                    sums.iter_mut().zip(row).for_each(|(v, o)| *v += factor * o);
                    last.iter_mut().for_each(|v| *v += factor * value);
                }
            }
        }
        let states = self.before.chunks_exact_mut(n + 1).zip(self.after.chunks_exact_mut(n + 1));
        let lines = rows.chunks_exact_mut(n.max(1)).zip(values.iter_mut());
        for (((row, value), own), ((before, after), pole)) in
            lines.zip(self.spare.chunks_exact(n + 1)).zip(states.zip(poles))
        {
            if *pole == 0.0 {
                row.copy_from_slice(&own[..n]);
                *value = own[n];
                continue;
            }
            if begins {
                // The noise is `n + τ ṅ` of a white n: from zero the low-pass is off by the first n, no more.
                before.copy_from_slice(own);
                after.fill(0.0);
            }
            let (keep, gain) = ((pole - 1.0) / (pole + 1.0), 1.0 / (pole + 1.0));
            for ((out, x), before) in after.iter_mut().zip(own).zip(before.iter_mut()) {
                *out = keep * *out + gain * (x + *before);
                *before = *x;
            }
            row.copy_from_slice(&after[..n]);
            *value = after[n];
        }
    }
}
