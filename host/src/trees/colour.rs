//! Noise of a tree's channels that is more than the filter explains, and the intervals that it leaves: the tests and the
//! sandwich of a single body ([`crate::identification::whiteness`], `coloured`), with so many channels as there are.

use nalgebra::DMatrix;

use super::rows::Filtered;
use crate::answer::Estimate;
use crate::identification::coloured::{self, Influences, Noise};
use crate::identification::whiteness::{self, Colour, Leftover};

/// Most pieces that a long recording is looked at in.
const MOST_PIECES: usize = 64;

/// Residuals of a filtered instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Residuals {
    /// Time of the frame that completed it, s; zero of still poses.
    pub time_s: f64,
    /// Filtered measurement less the prediction, channel by channel, N and N m.
    pub channels: Vec<f64>,
}

impl Leftover for Residuals {
    fn time_s(&self) -> f64 {
        self.time_s
    }

    fn of(&self, channel: usize) -> f64 {
        self.channels.get(channel).copied().unwrap_or(0.0)
    }
}

fn period_s(filtered: &Filtered, rate_hz: f64) -> f64 {
    f64::from(filtered.every) / rate_hz
}

/// What the answer leaves, block by block.
pub fn residuals(filtered: &Filtered, parameters: &[f64]) -> Vec<Residuals> {
    filtered
        .residuals(parameters)
        .zip(&filtered.blocks)
        .map(|(channels, block)| Residuals { time_s: block.time_s, channels })
        .collect()
}

/// Channels whose residuals show more than the filter explains, the worst first; empty for still poses. `variance` is the
/// one that the intervals assume, per reading before the filter.
pub fn colour(filtered: &Filtered, residuals: &[Residuals], rate_hz: f64, variance: &[f64]) -> Vec<Colour> {
    if filtered.response.is_empty() {
        return Vec::new();
    }
    let white = whiteness::white_autocovariance(&filtered.response, filtered.every);
    whiteness::colour(residuals, &white, period_s(filtered, rate_hz), filtered.every, variance)
}

/// Factor on the standard deviation of each parameter, 1 or more. `sigma` are those that the rows were whitened by,
/// `variance` as above.
pub fn widening(
    filtered: &Filtered,
    estimate: &Estimate,
    sigma: &[f64],
    variance: &[f64],
    colour: &[Colour],
    rate_hz: f64,
) -> Vec<f64> {
    let n = filtered.columns;
    let white = whiteness::white_autocovariance(&filtered.response, filtered.every);
    let noise = Noise { white: &white, variance, colour, row_period_s: period_s(filtered, rate_hz) };
    // Rows lie in what is determined, so that of a parameter that is, the whole row counts.
    let mut gain: DMatrix<f64> = estimate.covariance.clone();
    for (j, determined) in estimate.determined.iter().enumerate() {
        if !determined {
            gain.row_mut(j).fill(0.0);
        }
    }
    let blocks = filtered.blocks.len();
    let most = noise.most_blocks(n, 1);
    let pieces =
        if blocks <= most { 1 } else { MOST_PIECES.min(most / noise.most_blocks(n, MOST_PIECES)).max(1) };
    let length = if pieces == 1 { blocks.min(most) } else { noise.most_blocks(n, pieces) };
    let parts: Vec<Influences> = (0..pieces)
        .map(|k| {
            let mut part = Influences::new(&noise, n, length);
            for block in filtered.blocks.iter().skip(k * blocks / pieces).take(length) {
                let mut rows = DMatrix::from_column_slice(n, sigma.len(), &block.rows);
                for (mut row, sigma) in rows.column_iter_mut().zip(sigma) {
                    row /= sigma * sigma;
                }
                let influence = &gain * rows;
                part.take(block.time_s, |sum| {
                    for (sum, p) in sum.iter_mut().zip(influence.iter()) {
                        *sum += p;
                    }
                });
            }
            part
        })
        .collect();
    coloured::widening(&parts, n, &noise)
}
