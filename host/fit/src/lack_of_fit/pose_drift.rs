//! Drift from still pose to still pose, in the order in which they were taken.
//!
//! A line and a curve over the number of the pose are added to one channel: an F-test of two columns beside
//! all that the model has. And the residuals of a channel follow one another: their correlation from pose to
//! pose is nearly normal about zero with the variance 1/n (T. W. Anderson, Distribution of the serial
//! correlation coefficient, 1942).

use nalgebra::{DMatrix, DVector};
use statrs::function::erf::erfc;

use super::bins::Bins;
use super::metric::{Metric, drift};
use super::noise::{self, PowerLaw};
use super::score::{Added, Common, Further};
use super::tail;

/// A channel of an honest recording is accused once in this many, by either test.
pub const FALSE_ALARM: f64 = 1e-4;
/// Fewer poses than this say nothing.
const LEAST_POSES: usize = 8;

/// Columns explain all but this share at most, as far as rounding tells.
const LEAST_REST: f64 = 1e-9;

/// A channel that drifts.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseDrift {
    /// Number of the channel.
    pub channel: usize,
    /// Probability that an honest channel shows as much drift.
    pub probability: f64,
    /// Correlation of the residuals from pose to pose.
    pub correlation: f64,
    /// Probability that an honest channel shows as much correlation.
    pub correlation_probability: f64,
}

/// Holds the part of one channel that columns explain.
pub(super) struct Explained {
    /// Residuals of the channel by the common fit.
    pub(super) left: DVector<f64>,
    /// Probability that noise explains as much.
    pub(super) probability: f64,
}

/// Returns the metrics of poses, of which there are no slow drifts to take out.
pub(super) fn metrics(bins: &Bins) -> Vec<Metric> {
    let metric = |_| Metric::without_drift(&PowerLaw::white(1.0), bins.len());
    (0..bins.channels).map(metric).collect()
}

/// Returns what columns explain of one channel of poses beside the common fit of all, by an F-test; `None` if
/// there are too few poses.
pub(super) fn explained(
    bins: &Bins,
    common: &Common,
    channel: usize,
    columns: &DMatrix<f64>,
) -> Option<Explained> {
    let k = columns.ncols();
    let candidate = (0..bins.channels)
        .map(|c| if c == channel { columns.clone() } else { DMatrix::zeros(bins.len(), k) })
        .map(|columns| Further { columns, expected: DMatrix::zeros(k, bins.columns + 1) });
    let Added { square, rank, .. } = common.added(&candidate.collect(), None);
    // The variance is that of the channel itself, as what is left of it shows.
    let own = noise::basis(&bins.rows[channel], noise::ROUNDING);
    let free = bins.len().saturating_sub(own.ncols() + rank) as f64;
    let left = common.residual(channel);
    let whole = left.norm_squared();
    let rest = (whole - square).max(LEAST_REST * whole);
    let probability = tail(square * free / rest, rank, free);
    (free >= 2.0 && rest > 0.0).then_some(Explained { left, probability })
}

/// Returns the channels that drift.
pub(super) fn find(bins: &Bins) -> Vec<PoseDrift> {
    let count = bins.len();
    if count < LEAST_POSES {
        return Vec::new();
    }
    let (metrics, drift) = (metrics(bins), drift(count));
    let common = Common::new(bins, &metrics, &[]);
    let of_channel = |channel: usize| {
        let Explained { left, probability } = explained(bins, &common, channel, &drift)?;
        let pairs = left.iter().zip(left.iter().skip(1)).map(|(a, b)| a * b).sum::<f64>();
        let correlation = pairs / left.norm_squared();
        let correlation_probability = erfc(correlation * (count as f64).sqrt() / 2f64.sqrt()) * 0.5;
        let is_reported = probability < FALSE_ALARM || correlation_probability < FALSE_ALARM;
        is_reported.then_some(PoseDrift { channel, probability, correlation, correlation_probability })
    };
    (0..bins.channels).filter_map(of_channel).collect()
}
