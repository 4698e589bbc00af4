//! Drift from still pose to still pose, in the order in which they were taken.
//!
//! A line and a curve over the number of the pose are added to one channel: an F-test of two columns beside all that the model
//! has. And the residuals of a channel follow one another: their correlation from pose to pose is nearly normal about zero
//! with the variance 1/n (T. W. Anderson, Distribution of the serial correlation coefficient, 1942).

use nalgebra::DMatrix;
use statrs::function::erf::erfc;

use super::bins::Bins;
use super::noise::{self, PowerLaw};
use super::score::{Added, Common, Further, Metric, drift};
use super::tail;

/// A channel of an honest recording is accused once in so many, by either test.
pub const FALSE_ALARM: f64 = 1e-4;
/// Fewer poses than this say nothing.
const LEAST_POSES: usize = 8;

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

/// Returns the channels that drift.
pub(super) fn find(bins: &Bins) -> Vec<PoseDrift> {
    let poses = bins.len();
    if poses < LEAST_POSES {
        return Vec::new();
    }
    let noise: Vec<PowerLaw> = (0..bins.channels).map(|_| PowerLaw::white(1.0)).collect();
    let metrics: Vec<Metric> = noise.iter().map(|noise| Metric::without_drift(noise, poses)).collect();
    let common = Common::new(bins, &metrics, &[]);
    let drift = drift(poses);
    let of_channel = |channel: usize| {
        let columns = (0..bins.channels)
            .map(|c| if c == channel { drift.clone() } else { DMatrix::zeros(poses, 2) })
            .map(|columns| Further { columns, expected: DMatrix::zeros(2, bins.columns + 1) });
        let Added { square, rank, .. } = common.added(&columns.collect(), None);
        // The variance is that of the channel itself, as what is left of it shows.
        let own = noise::basis(&bins.rows[channel], noise::ROUNDING);
        let free = poses.saturating_sub(own.ncols() + rank) as f64;
        let left = common.residual(channel);
        let rest = (left.norm_squared() - square).max(0.0);
        if free < 2.0 || rest <= 0.0 {
            return None;
        }
        let probability = tail(square * free / rest, rank, free);
        let pairs = left.iter().zip(left.iter().skip(1)).map(|(a, b)| a * b).sum::<f64>();
        let correlation = pairs / left.norm_squared();
        let correlation_probability = erfc(correlation * (poses as f64).sqrt() / 2f64.sqrt()) * 0.5;
        let is_told = probability < FALSE_ALARM || correlation_probability < FALSE_ALARM;
        is_told.then_some(PoseDrift { channel, probability, correlation, correlation_probability })
    };
    (0..bins.channels).filter_map(of_channel).collect()
}
