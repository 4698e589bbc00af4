//! Gain errors of the load cell, eliminated: the algebra is that of a single body ([`crate::identification::gains`]), for as
//! many parameters as there are, the joints' channels beside the wrench's.

use std::borrow::Cow;

use super::rows::Filtered;
use crate::fit::Factor;
use crate::identification::gains::{ITERATIONS, SETTLED, linearise};
use crate::model::base::ROUNDED;

/// What all rows say, channel by channel, unwhitened.
pub(super) struct Channels {
    factors: Vec<Factor>,
    parameters: usize,
    /// Place of the wrench's offset among the parameters.
    offset: Option<usize>,
    gain_sigma: [f64; 6],
}

impl Channels {
    /// The wrench is the first six channels; `gain_sigma` is relative, and zero where there is no gain error.
    pub(super) fn new(filtered: &Filtered, offset: Option<usize>, gain_sigma: [f64; 6]) -> Self {
        let n = filtered.columns;
        let count = filtered.blocks.first().map_or(0, |b| b.measured.len());
        let factors = (0..count).map(|c| {
            let mut factor = Factor::new(n);
            factor.absorb(
                filtered
                    .blocks
                    .iter()
                    .filter_map(|b| Some((b.rows.get(c * n..(c + 1) * n)?, *b.measured.get(c)?))),
            );
            factor
        });
        Self { factors: factors.collect(), parameters: n, offset, gain_sigma }
    }

    /// The factor with the gains eliminated, and the gains. `weights` whiten the rows of each channel.
    pub(super) fn fit(&self, weights: &[f64]) -> (Factor, [f64; 6]) {
        let n = self.parameters;
        let (mut phi, mut gains) = (vec![0.0; n], [0.0; 6]);
        let mut joint = self.linearised(weights, &phi, &gains);
        for iteration in 0..ITERATIONS {
            let all = joint.solve(ROUNDED).estimate;
            let before = gains;
            gains.copy_from_slice(&all[n..]);
            phi.copy_from_slice(&all[..n]);
            joint = self.linearised(weights, &phi, &gains);
            let moved = |c: usize| (gains[c] - before[c]).abs() > SETTLED * self.gain_sigma[c];
            // About φ = 0 no gain shows: the first step is plain least squares.
            if iteration > 0 && !(0..6).any(moved) {
                break;
            }
        }
        // The prior's rows are no measurements.
        let rows = self.factors.iter().map(Factor::rows).sum();
        let joint = joint.leading(n);
        let residual = joint.residual_sum_of_squares();
        (joint.with_residual(residual, rows), gains)
    }

    /// Parameters, then gains.
    fn linearised(&self, weights: &[f64], phi: &[f64], gains: &[f64; 6]) -> Factor {
        let n = self.parameters;
        let mut joint = Factor::new(n + 6);
        let mut rows: Vec<(Vec<f64>, f64)> = Vec::new();
        for (c, (channel, weight)) in self.factors.iter().zip(weights).enumerate() {
            let gain = gains.get(c).copied().unwrap_or(0.0);
            let sigma = self.gain_sigma.get(c).copied().unwrap_or(0.0);
            let offset = self.offset.filter(|_| c < 6).map(|first| first + c);
            for (row, z) in channel.r().row_iter().zip(channel.z()) {
                let mut row: Vec<f64> = row.iter().copied().collect();
                let (own, value) = linearise(&mut row, *z, offset, phi, gain, *weight);
                row.resize(n + 6, 0.0);
                if sigma > 0.0 {
                    row[n + c] = own;
                }
                rows.push((row, value));
            }
            // What no φ explains in this channel alone, and what is known of its gain beforehand.
            rows.push((vec![0.0; n + 6], weight * channel.residual_sum_of_squares().sqrt()));
            if c < 6 {
                let mut prior = vec![0.0; n + 6];
                prior[n + c] = if sigma > 0.0 { 1.0 / sigma } else { 1.0 };
                rows.push((prior, 0.0));
            }
        }
        joint.absorb(rows.iter().map(|(row, value)| (row.as_slice(), *value)));
        joint
    }
}

impl Filtered {
    /// The same as the load cell with these relative gain errors would have it; `offset` is the place of the wrench's, which no
    /// gain multiplies.
    pub(super) fn gained(&self, gains: &[f64; 6], offset: Option<usize>) -> Cow<'_, Self> {
        if *gains == [0.0; 6] {
            return Cow::Borrowed(self);
        }
        let mut out = self.clone();
        for block in &mut out.blocks {
            for ((c, row), gain) in block.rows.chunks_exact_mut(self.columns.max(1)).enumerate().zip(gains) {
                for (j, a) in row.iter_mut().enumerate() {
                    if offset.is_none_or(|first| j != first + c) {
                        *a *= 1.0 + gain;
                    }
                }
            }
        }
        Cow::Owned(out)
    }
}
