//! What an estimator counts and sums up as it goes.

use crate::Scalar;
#[cfg(doc)]
use crate::conditioning::Kernel;
use crate::screening::{ALL_CHANNELS, Rejection};

/// Holds what happened so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counters {
    /// Readings given.
    pub readings: u32,
    /// Readings not used, for whatever reason.
    pub rejected: u32,
    /// Of these, per channel.
    pub rejected_by_channel: [u16; ALL_CHANNELS],
    /// Stretches of missing time.
    pub gaps: u32,
    /// Row blocks absorbed.
    pub blocks: u32,
    /// Of these, those in which a channel was given less weight, per channel of the wrench; see [`super::Reference`].
    pub knocks: [u16; 6],
    /// The last rejection.
    pub last_rejection: Option<Rejection>,
}

impl Counters {
    /// Nothing.
    pub const NONE: Self = Self {
        readings: 0,
        rejected: 0,
        rejected_by_channel: [0; ALL_CHANNELS],
        gaps: 0,
        blocks: 0,
        knocks: [0; 6],
        last_rejection: None,
    };
}

impl Default for Counters {
    fn default() -> Self {
        Self::NONE
    }
}

/// Sums over the innovations of each wrench channel, unwhitened and filtered: N, N m. Rows that a knock has spoilt count
/// as they are weighted.
///
/// The innovation is the filtered wrench less what the reference parameters predict, so its mean square is
/// [`Kernel::noise_gain`] times the raw variance if the rows leave nothing unexplained.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChannelStatistics<T: Scalar> {
    /// Σ e²
    pub squares: [T; 6],
    /// Σ e_k e_(k−1)
    pub lag_one: [T; 6],
    /// Number of innovations.
    pub count: u32,
    last: [T; 6],
}

impl<T: Scalar> ChannelStatistics<T> {
    pub(super) const NONE: Self =
        Self { squares: [T::ZERO; 6], lag_one: [T::ZERO; 6], count: 0, last: [T::ZERO; 6] };

    pub(super) fn add(&mut self, innovation: [T; 6]) {
        for (((square, lag), last), e) in
            self.squares.iter_mut().zip(&mut self.lag_one).zip(&mut self.last).zip(innovation)
        {
            *square += e * e;
            *lag += e * *last;
            *last = e;
        }
        self.count = self.count.saturating_add(1);
    }

    /// Root mean square per channel; `None` before the first innovation.
    pub fn rms(&self) -> Option<[T; 6]> {
        let n = T::from_u32(self.count);
        (self.count > 0).then(|| self.squares.map(|s| (s / n).sqrt()))
    }
}
