//! Gain errors of the channels: nuisance parameters that are estimated with the rest and eliminated.
//!
//! A channel that reads `(1 + g)` times its value gives `y_c = (1 + g_c) (A φ)_c + b_c`. About the current φ̂ and ĝ this is
//! linear, with one column more for each channel:
//! ```text
//! y_c + ĝ_c (A φ̂)_c = (A φ̂)_c g_c + (1 + ĝ_c) A_c φ + b_c
//! ```

use std::ops::Range;

use super::{Channel, Factor, Filter, RowBlocks, SampleCounts, outliers::dot};

/// The Gauss–Newton step shrinks by about σ each time: 1e-2, 1e-4, …
const ROUNDS: usize = 20;
/// Done when no gain moves by more than this share of its σ.
const SETTLED: f64 = 1e-6;

/// Channels whose gain is uncertain, and what their columns are linearised about.
#[derive(Clone, Debug)]
pub(super) struct Gains<'a> {
    channels: &'a [Channel],
    /// Numbers of the channels with a column of their own.
    uncertain: Vec<usize>,
    parameters: usize,
    /// φ̂; empty before the first estimate.
    phi: Vec<f64>,
    /// ĝ of every channel.
    errors: Vec<f64>,
}

impl<'a> Gains<'a> {
    /// Returns the gains of channels, about nothing yet; `is_told_apart` is false where they are not to be estimated.
    pub(super) fn new(channels: &'a [Channel], parameters: usize, is_told_apart: bool) -> Self {
        let uncertain = (0..channels.len()).filter(|c| is_told_apart && channels[*c].gain_sigma > 0.0);
        Self {
            channels,
            uncertain: uncertain.collect(),
            parameters,
            phi: Vec::new(),
            errors: vec![0.0; channels.len()],
        }
    }

    /// Returns true if every gain is certain.
    pub(super) fn is_empty(&self) -> bool {
        self.uncertain.is_empty()
    }

    /// Returns the factor of all columns, linearised about what it says itself, and the gains about which it is. `absorb`
    /// makes the factor about some gains.
    pub(super) fn settle(&self, rounding: f64, absorb: impl Fn(&Self) -> Factor) -> (Factor, Self) {
        let mut gains = self.clone();
        let mut factor = absorb(&gains);
        for _ in 0..ROUNDS {
            if gains.is_empty() {
                break;
            }
            let (own, errors) = gains.eliminate(&factor, 1.0, rounding);
            let is_settled = !gains.phi.is_empty() && gains.distance(&errors) < SETTLED;
            gains = gains.about(&own.solve(rounding).estimate, &errors);
            factor = absorb(&gains);
            if is_settled {
                break;
            }
        }
        (factor, gains)
    }

    /// Returns the same channels with no gain to be estimated.
    pub(super) fn none(&self) -> Self {
        Self::new(self.channels, self.parameters, false)
    }

    /// Returns the number of parameters.
    pub(super) fn parameters(&self) -> usize {
        self.parameters
    }

    /// Returns the number of columns: parameters, then gains.
    pub(super) fn columns(&self) -> usize {
        self.parameters + self.uncertain.len()
    }

    /// Returns the same gains about an estimate.
    #[must_use]
    fn about(&self, phi: &[f64], errors: &[f64]) -> Self {
        Self { phi: phi.to_vec(), errors: errors.to_vec(), uncertain: self.uncertain.clone(), ..*self }
    }

    /// Returns how far other gain errors are, in standard deviations of what is known beforehand.
    fn distance(&self, errors: &[f64]) -> f64 {
        let of = |c: &usize| (errors[*c] - self.errors[*c]).abs() / self.channels[*c].gain_sigma;
        self.uncertain.iter().map(of).fold(0.0, f64::max)
    }

    /// Writes the rows of a block with the gains' columns, and moves its values accordingly.
    fn extend(&self, rows: &[f64], values: &mut [f64], out: &mut [f64]) {
        let (n, all) = (self.parameters.max(1), self.columns());
        let lines = rows.chunks_exact(n).zip(out.chunks_exact_mut(all.max(1)));
        for (c, ((row, out), value)) in lines.zip(values).enumerate() {
            let predicted = without_offset(row, &self.phi, self.channels[c].offset);
            out.fill(0.0);
            for (j, (out, a)) in out.iter_mut().zip(row).enumerate() {
                *out = if Some(j) == self.channels[c].offset { *a } else { a * (1.0 + self.errors[c]) };
            }
            if let Some(k) = self.uncertain.iter().position(|u| *u == c) {
                out[n + k] = predicted;
            }
            *value += self.errors[c] * predicted;
        }
    }

    /// Extends rows in place: `rows` has room for all columns and starts with the rows of the parameters alone.
    pub(super) fn extend_in_place(&self, rows: &mut [f64], values: &mut [f64], spare: &mut Vec<f64>) {
        if self.is_empty() {
            return;
        }
        spare.clear();
        spare.extend_from_slice(&rows[..self.channels.len() * self.parameters]);
        self.extend(spare, values, rows);
    }

    /// Returns the factor of the parameters alone and the gain errors, from that of all columns, whose noise has `scale`
    /// times the variance beside what is known of the gains beforehand.
    pub(super) fn eliminate(&self, joint: &Factor, scale: f64, rounding: f64) -> (Factor, Vec<f64>) {
        let mut errors = vec![0.0; self.channels.len()];
        if self.is_empty() {
            return (joint.clone(), errors);
        }
        let (n, all) = (self.parameters, self.columns());
        let mut known = joint.discount(scale);
        let priors: Vec<Vec<f64>> = self
            .uncertain
            .iter()
            .enumerate()
            .map(|(k, c)| {
                let mut row = vec![0.0; all];
                row[n + k] = 1.0 / self.channels[*c].gain_sigma;
                row
            })
            .collect();
        known.absorb(priors.iter().map(|row| (row.as_slice(), 0.0)));
        let solution = known.solve(rounding);
        // About no φ yet, no gain shows.
        for (k, c) in self.uncertain.iter().enumerate().filter(|_| !self.phi.is_empty()) {
            errors[*c] = solution.estimate[n + k];
        }
        let marginal = known.leading(n);
        let left = marginal.residual_sum_of_squares();
        // The rows of what is known beforehand are no measurements.
        (marginal.with_residual(left, joint.rows()), errors)
    }
}

/// Row blocks with the columns of gains.
pub(super) struct WithGains<'a> {
    pub(super) blocks: &'a dyn RowBlocks,
    pub(super) gains: &'a Gains<'a>,
}

impl RowBlocks for WithGains<'_> {
    fn filter(&self) -> &Filter {
        self.blocks.filter()
    }

    fn counts(&self) -> &SampleCounts {
        self.blocks.counts()
    }

    fn parts(&self) -> &[Range<usize>] {
        self.blocks.parts()
    }

    fn time_s(&self, block: usize) -> f64 {
        self.blocks.time_s(block)
    }

    fn write(&self, block: usize, rows: &mut [f64], measured: &mut [f64]) {
        let mut own = vec![0.0; self.gains.channels.len() * self.gains.parameters];
        self.blocks.write(block, &mut own, measured);
        self.gains.extend(&own, measured, rows);
    }
}

/// Returns what a row predicts without the channel's offset.
fn without_offset(row: &[f64], phi: &[f64], offset: Option<usize>) -> f64 {
    let constant = offset.and_then(|j| Some(row.get(j)? * phi.get(j)?)).unwrap_or(0.0);
    if phi.is_empty() { 0.0 } else { dot(row, phi) - constant }
}

/// Returns the measurement of a row less what `parameters` and the channel's gain error predict.
pub(super) fn residual(row: &[f64], value: f64, parameters: &[f64], gain: f64, offset: Option<usize>) -> f64 {
    let predicted = dot(row, parameters);
    if gain == 0.0 {
        value - predicted
    } else {
        value - predicted - gain * without_offset(row, parameters, offset)
    }
}

#[cfg(test)]
#[path = "gains_tests.rs"]
mod tests;
