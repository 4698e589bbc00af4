//! Rows that a knock has spoilt are given less weight.
//!
//! A row block's innovation e is compared with `k (s + v)`: v is the standard deviation of the filtered
//! noise, or the root mean square of the innovations so far if that is larger; s bounds what the reference's
//! own uncertainty brings, `Σ_j |a_j| sd_j ≥ √(a C aᵀ)` whatever the correlations. Beyond that the row is
//! multiplied by `k (s + v) / |e|`, so that its residual is at the limit and its pull on the answer falls as
//! 1 / |e| (a redescending M-estimator in one step). Noise alone is beyond k = 6 twice in 1e9 rows.
//!
//! A deviation that lasts longer than [`LONGEST`] is not a knock but news, say of a body that has changed: it
//! counts fully until the innovations are within the limit again.

use super::ChannelStatistics;
use crate::Scalar;

/// Row blocks that a knock lasts at most: half a second at a hundred blocks a second.
pub const LONGEST: u16 = 50;

/// Holds what innovations are taken against, and how far they may be off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference<T: Scalar, const N: usize> {
    /// φ
    pub parameters: [T; N],
    /// Standard deviation of each parameter.
    pub standard_deviation: [T; N],
    /// Variance of the noise relative to the σ of the configuration, as far as it is known to be larger; else
    /// 1.
    pub noise_scale: T,
    /// k: a row is weighted if its innovation is larger than this many standard deviations; zero: never.
    pub knock_limit: T,
}

/// Watches every channel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watch<T: Scalar> {
    /// Variance of the filtered noise.
    variance: [T; 6],
    /// Row blocks beyond the limit, in a row.
    lasting: [u16; 6],
}

impl<T: Scalar> Watch<T> {
    pub(super) const UNUSED: Self = Self { variance: [T::ZERO; 6], lasting: [0; 6] };

    pub(super) fn new(channel_sigma: &[T; 6], noise_gain: T) -> Self {
        Self { variance: channel_sigma.map(|sigma| sigma * sigma * noise_gain), lasting: [0; 6] }
    }

    /// Takes another variance of the filtered noise.
    pub(super) fn set_variance(&mut self, variance: [T; 6]) {
        self.variance = variance;
    }

    /// Returns the factor on each row of the block, 1 for all but those that a knock has spoilt. `spread`
    /// gives `Σ_j |a_j| sd_j` of a channel.
    pub(super) fn factors<const N: usize>(
        &mut self,
        reference: &Reference<T, N>,
        spread: impl Fn(usize) -> T,
        innovation: &[T; 6],
        before: &ChannelStatistics<T>,
    ) -> [T; 6] {
        let mut factors = [T::ONE; 6];
        let k = reference.knock_limit;
        if k <= T::ZERO {
            return factors;
        }
        let count = T::from_u32(before.count.max(1));
        let channels = self.variance.iter().zip(before.squares()).zip(innovation);
        for (c, (((variance, squares), e), (factor, lasting))) in
            channels.zip(factors.iter_mut().zip(&mut self.lasting)).enumerate()
        {
            let variance = (*variance * reference.noise_scale).max(squares / count);
            let size = e.abs();
            // Most rows need neither root nor bound.
            let beyond = size * size > k * k * variance && {
                let limit = k * (spread(c) + variance.sqrt());
                let beyond = size > limit;
                if beyond && *lasting < LONGEST {
                    *factor = limit / size;
                }
                beyond
            };
            *lasting = if beyond { lasting.saturating_add(1) } else { 0 };
        }
        factors
    }
}
