//! The counters and sums of an estimator.

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
    /// Readings not used, per channel.
    pub rejected_by_channel: [u16; ALL_CHANNELS],
    /// Stretches of missing time.
    pub gaps: u32,
    /// Row blocks absorbed.
    pub blocks: u32,
    /// Row blocks in which a channel was given less weight, per channel of the wrench; see
    /// [`super::Reference`].
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

/// Sums over the innovations of each wrench channel, unwhitened and filtered: N, N m. Rows that a knock has
/// spoilt count as they are weighted.
///
/// The innovation is the filtered wrench less what the reference parameters predict, so its mean square is
/// [`Kernel::noise_gain`] times the raw variance if the rows leave nothing unexplained.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChannelStatistics<T: Scalar> {
    /// The part of the sums that whole parts of [`PART`] innovations make up: in single precision one
    /// innovation would not change a sum of 2²⁴ of them, and the mean would sink.
    parts: [[T; 6]; 2],
    /// Σ e² and Σ e_k e_(k−1) since the last whole part.
    recent: [[T; 6]; 2],
    /// Number of innovations.
    pub count: u32,
    last: [T; 6],
}

/// Innovations of a part: parts of 2¹⁶ add up to 2⁴⁰ innovations before one of them no longer changes the
/// sum.
const PART: u32 = 1 << 16;

impl<T: Scalar> ChannelStatistics<T> {
    pub(super) const NONE: Self =
        Self { parts: [[T::ZERO; 6]; 2], recent: [[T::ZERO; 6]; 2], count: 0, last: [T::ZERO; 6] };

    pub(super) fn add(&mut self, innovation: [T; 6]) {
        let [squares, lag_one] = &mut self.recent;
        for (((square, lag), last), e) in squares.iter_mut().zip(lag_one).zip(&mut self.last).zip(innovation)
        {
            *square += e * e;
            *lag += e * *last;
            *last = e;
        }
        self.count = self.count.saturating_add(1);
        if self.count.is_multiple_of(PART) {
            self.close_part();
        }
    }

    #[cold]
    fn close_part(&mut self) {
        for (sum, recent) in self.parts.iter_mut().flatten().zip(self.recent.iter_mut().flatten()) {
            *sum += *recent;
            *recent = T::ZERO;
        }
    }

    fn sums(&self, which: usize) -> [T; 6] {
        let of = |sums: &[[T; 6]; 2]| sums.get(which).copied().unwrap_or([T::ZERO; 6]);
        let (mut sums, recent) = (of(&self.parts), of(&self.recent));
        sums.iter_mut().zip(recent).for_each(|(sum, more)| *sum += more);
        sums
    }

    /// Returns Σ e² per channel.
    pub fn squares(&self) -> [T; 6] {
        self.sums(0)
    }

    /// Returns Σ e_k e_(k−1) per channel.
    pub fn lag_one(&self) -> [T; 6] {
        self.sums(1)
    }

    /// Returns the root mean square per channel; `None` before the first innovation.
    pub fn rms(&self) -> Option<[T; 6]> {
        let n = T::from_u32(self.count);
        (self.count > 0).then(|| self.squares().map(|s| (s / n).sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seven hours at a thousand blocks a second, in single precision: in one sum the mean sinks by a third,
    /// because after 2²⁴ innovations nothing is added any more.
    #[test]
    fn the_mean_square_of_seven_hours_is_that_of_one_second() {
        let mut statistics = ChannelStatistics::<f32>::NONE;
        let innovation = [1.0, 0.3, 2e-3, 0.7, 1e3, 0.1];
        for k in 0..24_000_000 {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            statistics.add(innovation.map(|e| sign * e));
        }
        let rms = statistics.rms().unwrap();
        for (got, want) in rms.into_iter().zip(innovation) {
            assert!((got / want - 1.0).abs() < 1e-3, "{got} {want}");
        }
        for (lag, square) in statistics.lag_one().into_iter().zip(statistics.squares()) {
            assert!((lag / square + 1.0).abs() < 2e-3, "{lag} {square}");
        }
    }
}
