use super::InformationFactor;
use crate::Scalar;

/// Merges into the next level after this many blocks or merges.
const FAN_IN: u16 = 100;

/// A factor in levels, so that a new block always meets numbers of its own size.
///
/// In `f32` a single factor stagnates: beyond about 1e7 samples one sample's share of R is less than half a
/// unit in the last place. Level 0 absorbs the blocks; every hundred of them it is merged into level 1 and
/// cleared, and so on. The last level takes whatever comes.
#[derive(Clone, Copy, Debug)]
pub struct Cascade<T: Scalar, const N: usize, const LEVELS: usize> {
    levels: [InformationFactor<T, N>; LEVELS],
    counts: [u16; LEVELS],
}

impl<T: Scalar, const N: usize, const LEVELS: usize> Default for Cascade<T, N, LEVELS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar, const N: usize, const LEVELS: usize> Cascade<T, N, LEVELS> {
    /// The cascade of no rows.
    #[must_use]
    pub fn new() -> Self {
        const { assert!(LEVELS > 0, "a cascade has at least one level") }
        Self { levels: [InformationFactor::new(); LEVELS], counts: [0; LEVELS] }
    }

    /// Absorbs M whitened rows; see [`InformationFactor::absorb`].
    #[inline]
    pub fn absorb<const M: usize>(&mut self, columns: &mut [[T; M]; N], rhs: &mut [T; M]) {
        let mut levels = self.levels.iter_mut().zip(&mut self.counts);
        let Some((mut level, mut count)) = levels.next() else { return };
        level.absorb(columns, rhs);
        for (next, next_count) in levels {
            *count += 1;
            if *count < FAN_IN {
                return;
            }
            *count = 0;
            next.merge(level);
            *level = InformationFactor::new();
            (level, count) = (next, next_count);
        }
    }

    /// One factor of everything absorbed: the levels merged, oldest (largest) first.
    #[must_use]
    pub fn factor(&self) -> InformationFactor<T, N> {
        let mut whole = InformationFactor::new();
        for level in self.levels.iter().rev() {
            whole.merge(level);
        }
        whole
    }
}
