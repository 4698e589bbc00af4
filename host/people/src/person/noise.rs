//! The noise of a person's rows: what is left of the plates' wrench by bodies near the table's.
//!
//! Segments are not rigid, and skin moves over bone: what rows leave is not the plates' noise, and is as slow
//! as the motion. It is estimated with the bodies, beside what the table knows of them, so that many
//! parameters on few frames do not explain it away: for each channel `σ² = Σ r² / (n − tr(H⁻¹H_c))`, H the
//! information of rows and table together, H_c that of the channel's rows, n the number of independent values
//! among them.

use nalgebra::{DMatrix, DVector};
use rigident_shared::conditioning::Kernel;

use rigident_fit::{FitError, Gaussian, RowSource, Silent, filter_width_s};
use rigident_rows::smoothing::width_s;

/// Rounds at most.
const ROUNDS: usize = 30;
/// Done when no σ changes by more, relative.
const DONE: f64 = 1e-3;
/// Room for kernels.
const TAPS: usize = 1024;
/// Of each channel's independent values at least this share counts as left over.
const LEAST_LEFT: f64 = 0.05;

struct Channel {
    gram: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
    rows: f64,
}

/// Rows of trials of one person, summed up.
#[derive(Default)]
pub struct RowSums {
    channels: Vec<Channel>,
    /// Independent values that a row represents.
    share: f64,
    gain: f64,
}

impl RowSums {
    /// Adds the rows of a trial that was smoothed with a cut-off, Hz.
    ///
    /// # Errors
    /// [`FitError`] if its frames cannot be filtered.
    pub fn of(source: &dyn RowSource, rate_hz: f64, cut_off_hz: f64) -> Result<Self, FitError> {
        let blocks = source.blocks(&Silent)?;
        let (n, channels) = (source.parameters().len(), source.channels().len());
        let gain = noise_gain(rate_hz, cut_off_hz);
        let mut sums = Self {
            channels: (0..channels)
                .map(|_| Channel {
                    gram: DMatrix::zeros(n, n),
                    right: DVector::zeros(n),
                    square: 0.0,
                    rows: 0.0,
                })
                .collect(),
            share: f64::from(blocks.filter().every) * gain,
            gain,
        };
        let (mut rows, mut measured) = (vec![0.0; channels * n], vec![0.0; channels]);
        for block in 0..blocks.len() {
            blocks.write(block, &mut rows, &mut measured);
            for ((channel, row), y) in sums.channels.iter_mut().zip(rows.chunks_exact(n)).zip(&measured) {
                let row = DVector::from_column_slice(row);
                channel.gram.syger(1.0, &row, &row, 1.0);
                channel.right.axpy(*y, &row, 1.0);
                channel.square += y * y;
                channel.rows += 1.0;
            }
        }
        for channel in &mut sums.channels {
            channel.gram.fill_upper_triangle_with_lower_triangle();
        }
        Ok(sums)
    }

    /// Returns the sum of squares that parameters leave of a channel, by its number.
    pub fn left(&self, channel: usize, phi: &DVector<f64>) -> f64 {
        self.channels.get(channel).map_or(0.0, |own| own.left(phi))
    }
}

/// Returns 1 σ of each channel per unfiltered sample of every trial, such that rows weigh as they inform,
/// beside what is known beforehand; all trials leave alike. `None` if there are no rows.
pub fn sigma(trials: &[RowSums], known: &Gaussian) -> Option<Vec<Vec<f64>>> {
    let prior = known.covariance().clone().cholesky()?.inverse();
    let toward = &prior * known.mean();
    let channels = trials.first()?.channels.len();
    let of = |c: usize| trials.iter().filter_map(move |t| Some((t.channels.get(c)?, t.share)));
    let left = |c: usize, phi: &DVector<f64>| of(c).map(|(own, share)| share * own.left(phi)).sum::<f64>();
    let independent: Vec<f64> =
        (0..channels).map(|c| of(c).map(|(own, share)| share * own.rows).sum()).collect();
    // Begin with what the table leaves.
    let mut variance: Vec<f64> = (0..channels).map(|c| left(c, known.mean()) / independent[c]).collect();
    for _ in 0..ROUNDS {
        let (mut all, mut right) = (prior.clone(), toward.clone());
        for (c, variance) in variance.iter().enumerate() {
            for (own, share) in of(c) {
                let weight = share / variance.max(f64::MIN_POSITIVE);
                all += &own.gram * weight;
                right.axpy(weight, &own.right, 1.0);
            }
        }
        let inverse = all.cholesky()?.inverse();
        let estimate = &inverse * right;
        let mut moved = 0.0_f64;
        for (c, variance) in variance.iter_mut().enumerate() {
            let taken: f64 = of(c).map(|(own, share)| share / *variance * inverse.dot(&own.gram)).sum();
            let rest = (independent[c] - taken).max(LEAST_LEFT * independent[c]);
            let now = left(c, &estimate) / rest;
            moved = moved.max((now / *variance - 1.0).abs());
            *variance = now;
        }
        if moved < DONE {
            break;
        }
    }
    let usable = variance.iter().all(|v| v.is_finite() && *v > 0.0);
    let of_trial = |t: &RowSums| variance.iter().map(|v| (v / t.gain).sqrt()).collect();
    usable.then(|| trials.iter().map(of_trial).collect())
}

impl Channel {
    /// Returns the sum of squares that parameters leave.
    fn left(&self, phi: &DVector<f64>) -> f64 {
        (self.square - 2.0 * self.right.dot(phi) + phi.dot(&(&self.gram * phi))).max(0.0)
    }
}

/// Returns `Σ h²` of the smoothing and the rows' filter one after the other: of frames this share is
/// independent.
pub fn noise_gain(rate_hz: f64, cut_off_hz: f64) -> f64 {
    let taps = |width: f64| {
        Kernel::<f64, TAPS>::new(rate_hz, width, 1).map_or(vec![1.0], |kernel| kernel.smooth().to_vec())
    };
    let (a, b) = (taps(width_s(cut_off_hz)), taps(filter_width_s(rate_hz)));
    let mut both = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            both[i + j] += x * y;
        }
    }
    both.iter().map(|v| v * v).sum()
}
