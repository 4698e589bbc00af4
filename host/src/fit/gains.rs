//! Gain errors of channels: constant over a recording, known to so many per cent only.
//!
//! A channel reads `y_c = (1 + g_c) (A φ)_c + b_c`, with `g_c ~ N(0, σ_c²)` known beforehand. About the current φ̂ and ĝ
//! this is linear, with one column more for each channel:
//! ```text
//! y_c + ĝ_c (A φ̂)_c = (A φ̂)_c g_c + (1 + ĝ_c) A_c φ + b_c
//! ```
//! Neither the columns nor the right-hand side leaves the span of `[A_c y_c]`, so the triangle of these, one a channel,
//! holds all that any linearisation and any σ need: one pass over the recording, then iterations over triangles. The
//! gains are nuisance parameters and eliminated.

use std::ops::Range;

use super::{Channel, Factor, RowBlocks, outliers::dot, parallel};

/// Row blocks that are sorted by channels at a time.
const CHUNK: usize = 48;

/// The Gauss–Newton step shrinks by about σ each time: 1e-2, 1e-4, …
const ITERATIONS: usize = 20;
/// Done when no gain moves by more than this share of its σ.
const SETTLED: f64 = 1e-6;

/// All rows, channel by channel, not whitened.
pub(super) struct ChannelFactors<'a> {
    factors: Vec<Factor>,
    parameters: usize,
    channels: &'a [Channel],
}

impl<'a> ChannelFactors<'a> {
    /// Returns the factors of the channels; `None` if every gain is certain.
    pub(super) fn of(blocks: &dyn RowBlocks, parameters: usize, channels: &'a [Channel]) -> Option<Self> {
        if channels.iter().all(|c| c.gain_sigma <= 0.0) {
            return None;
        }
        let parts = parallel::map(parallel::threads(), blocks.parts().len(), |k| {
            Self::of_range(blocks, blocks.parts().get(k).cloned().unwrap_or_default(), parameters, channels)
        });
        parts.into_iter().reduce(|mut all, other| {
            all.merge(&other);
            all
        })
    }

    /// Returns the factors of the channels from some blocks.
    pub(super) fn of_range(
        blocks: &dyn RowBlocks,
        range: Range<usize>,
        parameters: usize,
        channels: &'a [Channel],
    ) -> Self {
        let count = channels.len();
        let mut factors = vec![Factor::new(parameters); count];
        let mut rows = vec![0.0; CHUNK * count * parameters];
        let mut measured = vec![0.0; CHUNK * count];
        let mut start = range.start;
        while start < range.end {
            let end = range.end.min(start + CHUNK);
            let own_rows = rows.chunks_exact_mut((count * parameters).max(1));
            for (block, (rows, measured)) in
                (start..end).zip(own_rows.zip(measured.chunks_exact_mut(count.max(1))))
            {
                blocks.write(block, rows, measured);
            }
            for (c, factor) in factors.iter_mut().enumerate() {
                let own = rows.chunks_exact(parameters.max(1)).zip(&measured).skip(c).step_by(count);
                factor.absorb(own.take(end - start).map(|(row, value)| (row, *value)));
            }
            start = end;
        }
        Self { factors, parameters, channels }
    }

    /// Takes in the rows of another part.
    pub(super) fn merge(&mut self, other: &Self) {
        for (own, other) in self.factors.iter_mut().zip(&other.factors) {
            own.merge(other);
        }
    }

    /// Returns the whitened factor with the gains eliminated, and the gains. `whitening` multiplies the rows of each
    /// channel, so that the marginal's `(RᵀR)⁻¹` is a covariance.
    pub(super) fn fit(&self, whitening: &[f64], rounding: f64) -> (Factor, Vec<f64>) {
        let n = self.parameters;
        let (mut phi, mut gains) = (vec![0.0; n], vec![0.0; self.channels.len()]);
        let mut joint = self.linearised(whitening, &phi, &gains);
        for iteration in 0..ITERATIONS {
            let all = joint.solve(rounding).estimate;
            let before = gains.clone();
            gains.copy_from_slice(&all[n..]);
            phi.copy_from_slice(&all[..n]);
            joint = self.linearised(whitening, &phi, &gains);
            let mut moves = gains.iter().zip(&before).zip(self.channels);
            // About φ = 0 no gain shows: the first step is plain least squares.
            if iteration > 0 && !moves.any(|((now, before), c)| (now - before).abs() > SETTLED * c.gain_sigma)
            {
                break;
            }
        }
        // The prior's rows are no measurements.
        let rows = self.factors.iter().map(Factor::rows).sum();
        let marginal = joint.leading(n);
        let residual = marginal.residual_sum_of_squares();
        (marginal.with_residual(residual, rows), gains)
    }

    /// Returns the factor of the parameters, then the gains.
    fn linearised(&self, whitening: &[f64], phi: &[f64], gains: &[f64]) -> Factor {
        let (n, count) = (self.parameters, self.channels.len());
        let mut rows: Vec<(Vec<f64>, f64)> = Vec::new();
        let channels = self.factors.iter().zip(self.channels).zip(whitening.iter().zip(gains));
        for (c, ((factor, channel), (weight, gain))) in channels.enumerate() {
            let sigma = channel.gain_sigma;
            for (row, z) in factor.r().row_iter().zip(factor.z()) {
                let mut row: Vec<f64> = row.iter().copied().collect();
                let (own, value) = linearise(&mut row, *z, channel.offset, phi, *gain, *weight);
                row.resize(n + count, 0.0);
                if sigma > 0.0 {
                    row[n + c] = own;
                }
                rows.push((row, value));
            }
            // What no φ explains in this channel alone, and what is known of its gain beforehand.
            rows.push((vec![0.0; n + count], weight * factor.residual_sum_of_squares().sqrt()));
            let mut prior = vec![0.0; n + count];
            prior[n + c] = if sigma > 0.0 { 1.0 / sigma } else { 1.0 };
            rows.push((prior, 0.0));
        }
        let mut joint = Factor::new(n + count);
        joint.absorb(rows.iter().map(|(row, value)| (row.as_slice(), *value)));
        joint
    }
}

/// Turns a row of one channel, about φ and g, into a whitened one: coefficients in place; gives the gain's coefficient and
/// the value. `offset` is the place of the channel's offset, which no gain multiplies.
fn linearise(
    row: &mut [f64],
    value: f64,
    offset: Option<usize>,
    phi: &[f64],
    gain: f64,
    weight: f64,
) -> (f64, f64) {
    let mut predicted = 0.0;
    for (j, a) in row.iter_mut().enumerate() {
        if Some(j) == offset {
            *a *= weight;
        } else {
            predicted += *a * phi.get(j).copied().unwrap_or(0.0);
            *a *= weight * (1.0 + gain);
        }
    }
    (weight * predicted, weight * (value + gain * predicted))
}

/// Returns the measurement of a row less what `parameters` and the channel's gain error predict.
pub(super) fn residual(row: &[f64], value: f64, parameters: &[f64], gain: f64, offset: Option<usize>) -> f64 {
    let predicted = dot(row, parameters);
    if gain == 0.0 {
        return value - predicted;
    }
    let constant = offset.and_then(|j| Some(row.get(j)? * parameters.get(j)?)).unwrap_or(0.0);
    value - predicted - gain * (predicted - constant)
}

#[cfg(test)]
#[path = "gains_tests.rs"]
mod tests;
