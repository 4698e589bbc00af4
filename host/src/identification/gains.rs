//! Gain errors of the load cell: constant over an experiment, known to so many per cent only.
//!
//! Lives here: the six gains as nuisance parameters, and the marginal factor of the rest. May not live here:
//! the pipeline, what an interval is. Before this: the row blocks; after it: the factor, as if there were no
//! gains.
//!
//! The load cell reads `w_c = (1 + g_c) (A φ)_c + b_c`, with `g_c ~ N(0, σ_c²)` known beforehand. About the
//! current φ̂ and ĝ this is linear, with six columns more:
//! ```text
//! w_c + ĝ_c (A φ̂)_c = (A φ̂)_c g_c + (1 + ĝ_c) A_c φ + b_c
//! ```
//! Neither the columns nor the right-hand side leaves the span of `[A_c 1 w_c]`, so the triangle of these, one
//! per channel, holds all that any linearisation and any σ need: one pass over the recording, then iterations
//! over 66 rows. The gains come first in order, so that the trailing triangle is the marginal of φ and b.

use rigident_shared::estimator::residual;
use rigident_shared::factor::InformationFactor;
use rigident_shared::regressor::RegressorBlock;

/// The body's ten and the channel's offset.
const CHANNEL: usize = 11;
/// Six gains, the body's ten, six offsets.
const JOINT: usize = 22;
/// The Gauss–Newton step shrinks by about σ each time: 1e-2, 1e-4, …
pub(crate) const ITERATIONS: usize = 20;
/// Done when no gain moves by more than this share of its σ.
pub(crate) const SETTLED: f64 = 1e-6;

/// What all row blocks say, channel by channel, unwhitened.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelFactors {
    channels: [InformationFactor<f64, CHANNEL>; 6],
}

/// The parameters with the gains eliminated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainFit<const N: usize> {
    /// Marginal factor of the body (and the offset), whitened. Its row count is that of the measurements.
    pub factor: InformationFactor<f64, N>,
    /// Estimated relative gain errors.
    pub gains: [f64; 6],
}

impl Default for ChannelFactors {
    fn default() -> Self {
        Self { channels: [InformationFactor::new(); 6] }
    }
}

impl ChannelFactors {
    /// Takes one row block, not whitened.
    pub fn absorb(&mut self, block: &RegressorBlock<f64>) {
        for (c, (channel, wrench)) in self.channels.iter_mut().zip(block.wrench).enumerate() {
            let row = std::array::from_fn(|j| [block.columns.get(j).map_or(1.0, |column| column[c])]);
            channel.absorb(&row, &[wrench]);
        }
    }

    /// Takes what another part of the recording says.
    pub fn merge(&mut self, other: &Self) {
        for (channel, other) in self.channels.iter_mut().zip(&other.channels) {
            channel.merge(other);
        }
    }

    /// Fits `N` parameters, the body's ten or sixteen with the offset, and the gains. `weights` whiten the rows
    /// of each channel: `√row_every / σ`, so that the marginal's `(RᵀR)⁻¹` is a covariance; `gain_sigma` is
    /// relative; a channel of zero σ has no gain error.
    pub fn fit<const N: usize>(&self, weights: &[f64; 6], gain_sigma: &[f64; 6]) -> GainFit<N> {
        let (mut phi, mut gains) = ([0.0; N], [0.0; 6]);
        let mut factor = self.linearised(weights, gain_sigma, &phi, &gains);
        for iteration in 0..ITERATIONS {
            let all = factor.solve().estimate;
            let before = gains;
            gains.copy_from_slice(&all[..6]);
            phi.copy_from_slice(&all[JOINT - N..]);
            factor = self.linearised(weights, gain_sigma, &phi, &gains);
            let moved = |c: usize| (gains[c] - before[c]).abs() > SETTLED * gain_sigma[c];
            // About φ = 0 no gain shows: the first step is plain least squares.
            if iteration > 0 && !(0..6).any(moved) {
                break;
            }
        }
        // The prior's rows are no measurements.
        let rows = self.channels.iter().map(InformationFactor::rows).sum();
        let factor = factor.trailing::<N>();
        GainFit { factor: InformationFactor::from_entries(factor.entries(), rows).unwrap_or(factor), gains }
    }

    /// The last `N` of the columns after the gains are the parameters; any before them stay empty.
    fn linearised<const N: usize>(
        &self,
        weights: &[f64; 6],
        gain_sigma: &[f64; 6],
        phi: &[f64; N],
        gains: &[f64; 6],
    ) -> InformationFactor<f64, JOINT> {
        const { assert!(N == 10 || N == 16, "ten parameters, or sixteen with the offset") }
        let first = JOINT - N;
        let mut joint = InformationFactor::new();
        for (c, channel) in self.channels.iter().enumerate() {
            let (weight, gain) = (weights[c], gains[c]);
            for (row, z) in channel.r().iter().zip(channel.z()) {
                let (mut row, mut columns) = (*row, [[0.0]; JOINT]);
                let (own, value) = linearise(&mut row, *z, Some(10), phi, gain, weight);
                if gain_sigma[c] > 0.0 {
                    columns[c] = [own];
                }
                for (column, a) in columns[first..].iter_mut().zip(&row[..10]) {
                    *column = [*a];
                }
                if let Some(offset) = columns.get_mut(first + 10 + c) {
                    *offset = [row[10]];
                }
                joint.absorb(&columns, &[value]);
            }
            // What no φ explains in this channel alone, and what is known of its gain beforehand.
            joint.absorb(&[[0.0]; JOINT], &[weight * channel.residual_sum_of_squares().sqrt()]);
            let mut prior = [[0.0]; JOINT];
            prior[c] = [if gain_sigma[c] > 0.0 { 1.0 / gain_sigma[c] } else { 1.0 }];
            joint.absorb(&prior, &[0.0]);
        }
        joint
    }
}

/// A row of one channel about φ and g, whitened: coefficients in place; gives the gain's and what the row makes. `offset` is
/// the place of the channel's offset, which no gain multiplies.
pub(crate) fn linearise(
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

/// The wrench of a block less what `parameters` and gain errors predict: N, N m.
pub fn residual_with_gains<const N: usize>(
    block: &RegressorBlock<f64>,
    parameters: &[f64; N],
    gains: &[f64; 6],
) -> [f64; 6] {
    let mut e = residual(block, parameters);
    for (c, (e, gain)) in e.iter_mut().zip(gains).enumerate() {
        let moved: f64 = block.columns.iter().zip(parameters).map(|(column, phi)| column[c] * phi).sum();
        *e -= gain * moved;
    }
    e
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    fn pseudo_random(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*seed >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
    }

    const PHI: [f64; 10] = [20.0, 0.3, -0.2, 1.0, 0.4, 0.1, 0.5, 0.02, -0.03, 0.01];
    const OFFSET: [f64; 6] = [3.0, -2.0, 5.0, 0.3, 0.1, -0.2];
    const GAINS: [f64; 6] = [0.01, -0.004, 0.007, -0.012, 0.003, 0.0];
    const GAIN_SIGMA: [f64; 6] = [8e-3, 8e-3, 5e-3, 6e-3, 8e-3, 0.0];
    const WEIGHTS: [f64; 6] = [20.0, 20.0, 10.0, 300.0, 300.0, 300.0];

    /// Blocks of random regressors whose wrench follows the model with gains, and noise of the given size.
    fn blocks(count: usize, noise: f64) -> Vec<RegressorBlock<f64>> {
        let seed = &mut 11_u64;
        (0..count)
            .map(|_| {
                let columns = [[0.0; 6]; 10].map(|column| column.map(|_: f64| 4.0 * pseudo_random(seed)));
                let wrench = std::array::from_fn(|c| {
                    let moved: f64 = columns.iter().zip(PHI).map(|(column, phi)| column[c] * phi).sum();
                    (1.0 + GAINS[c]) * moved + OFFSET[c] + noise / WEIGHTS[c] * pseudo_random(seed)
                });
                RegressorBlock { columns, wrench }
            })
            .collect()
    }

    fn channels(blocks: &[RegressorBlock<f64>]) -> ChannelFactors {
        let mut channels = ChannelFactors::default();
        blocks.iter().for_each(|b| channels.absorb(b));
        channels
    }

    /// Oracle: the dense normal matrix of all rows at the solution, inverted whole, and its block for φ and b;
    /// and the gradient of the sum of squares, zero at the solution.
    #[test]
    fn the_marginal_is_that_of_the_dense_problem_with_gains() {
        let blocks = blocks(200, 1.0);
        let fit = channels(&blocks).fit::<16>(&WEIGHTS, &GAIN_SIGMA);
        let solution = fit.factor.solve().estimate;
        let mut normal = DMatrix::<f64>::zeros(22, 22);
        let mut gradient = DVector::<f64>::zeros(22);
        let mut squares = 0.0;
        for block in &blocks {
            for c in 0..6 {
                let mut row = DVector::<f64>::zeros(22);
                let moved: f64 = (0..10).map(|j| block.columns[j][c] * solution[j]).sum();
                row[c] = if GAIN_SIGMA[c] > 0.0 { moved } else { 0.0 };
                for j in 0..10 {
                    row[6 + j] = (1.0 + fit.gains[c]) * block.columns[j][c];
                }
                row[16 + c] = 1.0;
                let e = block.wrench[c] - (1.0 + fit.gains[c]) * moved - solution[10 + c];
                normal += WEIGHTS[c].powi(2) * &row * row.transpose();
                gradient += WEIGHTS[c].powi(2) * e * row;
                squares += (WEIGHTS[c] * e).powi(2);
            }
        }
        for c in 0..6 {
            let information = if GAIN_SIGMA[c] > 0.0 { GAIN_SIGMA[c].powi(-2) } else { 1.0 };
            normal[(c, c)] += information;
            gradient[c] -= information * fit.gains[c];
            squares += information * fit.gains[c].powi(2);
        }
        let covariance = normal.try_inverse().unwrap();
        let marginal = fit.factor.covariance();
        let step = &covariance * gradient;
        for i in 0..16 {
            let sd = covariance[(6 + i, 6 + i)].sqrt();
            // A further Newton step is far below the noise; SETTLED bounds it.
            assert!(step[6 + i].abs() < 1e-4 * sd, "{i}: {} {sd}", step[6 + i]);
            for j in 0..16 {
                let scale = sd * covariance[(6 + j, 6 + j)].sqrt();
                assert!((marginal[i][j] - covariance[(6 + i, 6 + j)]).abs() < 1e-6 * scale);
            }
        }
        assert!((fit.factor.residual_sum_of_squares() / squares - 1.0).abs() < 1e-9);
        assert_eq!(fit.factor.rows(), 1200);
    }

    #[test]
    fn without_gain_errors_the_factor_is_that_of_plain_least_squares() {
        let blocks = blocks(50, 1.0);
        let fit = channels(&blocks).fit::<10>(&WEIGHTS, &[0.0; 6]);
        let mut plain = InformationFactor::<f64, 10>::new();
        for block in &blocks {
            let columns =
                block.columns.map(|column| std::array::from_fn::<f64, 6, _>(|c| column[c] * WEIGHTS[c]));
            plain.absorb(&columns, &std::array::from_fn(|c| block.wrench[c] * WEIGHTS[c]));
        }
        assert_eq!(fit.gains, [0.0; 6]);
        for (got, want) in fit.factor.entries().zip(plain.entries()) {
            assert!((got - want).abs() <= 1e-9 * plain.r()[0][0].max(want.abs()), "{got} {want}");
        }
    }
}
