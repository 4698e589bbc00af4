use super::{BLOCK_ROWS, Block, Gathering, InformationFactor};
use crate::Scalar;

/// A level is merged into the next after this many blocks or merges.
const FAN_IN: u16 = 100;

/// The levels above the one that absorbs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Levels<T: Scalar, const N: usize, const LEVELS: usize> {
    levels: [InformationFactor<T, N>; LEVELS],
    merges: [u16; LEVELS],
}

impl<T: Scalar, const N: usize, const LEVELS: usize> Levels<T, N, LEVELS> {
    pub(super) const fn new() -> Self {
        Self { levels: [InformationFactor::EMPTY; LEVELS], merges: [0; LEVELS] }
    }

    /// Returns the lowest of these levels.
    pub(super) fn lowest(&mut self) -> Option<&mut InformationFactor<T, N>> {
        self.levels.first_mut()
    }

    /// Puts a factor into the highest of these levels.
    pub(super) fn restore(&mut self, factor: &InformationFactor<T, N>) {
        if let Some(highest) = self.levels.last_mut() {
            *highest = *factor;
        }
    }

    /// Counts that the absorbing level has been merged into the lowest of these.
    pub(super) fn count(&mut self) {
        if let Some(merges) = self.merges.first_mut() {
            *merges = merges.saturating_add(1);
        }
    }

    /// Parts in which all these levels are merged.
    pub(super) const PARTS: usize = LEVELS * InformationFactor::<T, N>::PARTS;

    /// Returns the level and the part of its merge that come `step`th: oldest (largest) first. `None` after
    /// the last.
    fn part(&self, step: usize) -> Option<(&InformationFactor<T, N>, usize)> {
        let parts = InformationFactor::<T, N>::PARTS;
        let level = self.levels.get(LEVELS.checked_sub(1 + step / parts)?)?;
        Some((level, step % parts))
    }

    /// Does the next part of merging the levels into a factor. Returns false when there is none left.
    pub(super) fn gather(&self, step: &mut u8, whole: &mut InformationFactor<T, N>) -> bool {
        while let Some((level, part)) = self.part(usize::from(*step)) {
            *step += 1;
            if level.rows() > 0 {
                whole.merge_part(level, part);
                return true;
            }
        }
        false
    }

    /// Does part `step` of merging the levels into a factor that began empty; the first level in use is
    /// copied as a whole. Returns the number of steps that it took.
    pub(super) fn fold(&self, step: usize, whole: &mut InformationFactor<T, N>) -> u8 {
        match self.part(step).filter(|(level, _)| level.rows() > 0) {
            Some((level, 0)) if whole.rows() == 0 => {
                *whole = *level;
                InformationFactor::<T, N>::PARTS as u8
            }
            Some((level, part)) => {
                whole.merge_part(level, part);
                1
            }
            None => 1,
        }
    }

    /// Multiplies all rows.
    pub(super) fn scale(&mut self, by: T) {
        for level in &mut self.levels {
            level.scale(by);
        }
    }

    /// Merges one level that is full into the next: with each block one, so that no block waits for all of
    /// them.
    #[inline]
    pub(super) fn carry(&mut self) {
        for k in 1..LEVELS {
            if self.merges[k - 1] >= FAN_IN {
                return self.merge_level(k);
            }
        }
    }

    #[cold]
    #[inline(never)]
    fn merge_level(&mut self, k: usize) {
        let Some((lower, upper)) = self.levels.split_at_mut_checked(k) else { return };
        if let (Some(level), Some(next)) = (lower.last_mut(), upper.first_mut()) {
            next.merge(&core::mem::take(level));
        }
        if let Some((from, to)) = self.merges.get_mut(k - 1..=k).and_then(<[u16]>::split_first_mut) {
            *from = 0;
            for merges in to {
                *merges = merges.saturating_add(1);
            }
        }
    }
}

/// A factor in levels, so that a new block always meets numbers of its own size.
///
/// In `f32` a single factor stagnates: beyond about 1e7 samples one sample's share of R is less than half a
/// unit in the last place. The first level absorbs the blocks; every hundred of them it is merged into the
/// next one and cleared, and so on. The last of the `1 + UPPER` levels takes whatever comes.
#[derive(Clone, Copy, Debug)]
pub struct Cascade<T: Scalar, const N: usize, const UPPER: usize> {
    absorbing: InformationFactor<T, N>,
    blocks: u16,
    /// Rows that wait until they are a block.
    waiting: Block<T, N>,
    rows_waiting: usize,
    upper: Levels<T, N, UPPER>,
}

impl<T: Scalar, const N: usize, const UPPER: usize> Default for Cascade<T, N, UPPER> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar, const N: usize, const UPPER: usize> Cascade<T, N, UPPER> {
    /// Returns the cascade of no rows.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            absorbing: InformationFactor::EMPTY,
            blocks: 0,
            waiting: Block::ZERO,
            rows_waiting: 0,
            upper: Levels::new(),
        }
    }

    /// Puts a factor of everything absorbed before into the highest level of an empty cascade, and returns
    /// true.
    pub fn restore(&mut self, factor: &InformationFactor<T, N>) -> bool {
        self.upper.restore(factor);
        true
    }

    /// Absorbs twelve whitened rows; see [`InformationFactor::absorb_block`].
    #[inline]
    pub fn absorb_block(&mut self, block: &mut Block<T, N>) {
        self.absorbing.absorb_block(block);
        self.carry();
    }

    /// Absorbs M whitened rows, `columns[j][i]` being row i's coefficient of parameter j, twelve at a time.
    pub fn absorb<const M: usize>(&mut self, columns: &[[T; M]; N], rhs: &[T; M]) {
        for i in 0..M {
            let all = self.waiting.columns.iter_mut().zip(columns);
            for (target, source) in all.chain([(&mut self.waiting.rhs, rhs)]) {
                if let Some(slot) = target.rows.get_mut(self.rows_waiting) {
                    *slot = source[i];
                }
            }
            self.rows_waiting += 1;
            if self.rows_waiting == BLOCK_ROWS {
                self.absorbing.absorb_block(&mut self.waiting);
                (self.waiting, self.rows_waiting) = (Block::ZERO, 0);
                self.carry();
            }
        }
    }

    #[inline]
    fn carry(&mut self) {
        self.blocks += 1;
        if self.blocks < FAN_IN {
            return self.upper.carry();
        }
        if let Some(next) = self.upper.lowest() {
            next.merge(&self.absorbing);
            self.absorbing = InformationFactor::EMPTY;
            self.upper.count();
        }
        self.blocks = 0;
    }

    /// Does one step towards one factor of everything absorbed. Returns true when `whole`, which began empty,
    /// is that. Nothing may be absorbed meanwhile, nor afterwards: the cascade is used up. `step` begins at
    /// 0.
    pub fn fold(&mut self, whole: &mut InformationFactor<T, N>, step: &mut u8) -> bool {
        let upper = Levels::<T, N, UPPER>::PARTS;
        let k = usize::from(*step);
        if k < upper {
            *step += self.upper.fold(k, whole);
            return false;
        }
        let part = k - upper;
        *step += 1;
        if part < InformationFactor::<T, N>::PARTS {
            whole.merge_part(&self.absorbing, part);
            return false;
        }
        if self.rows_waiting > 0 {
            whole.reduce(0, &mut self.waiting);
            whole.rows = whole.rows.saturating_add(self.rows_waiting as u32);
            self.rows_waiting = 0;
        }
        true
    }

    /// Returns one factor of everything absorbed.
    #[must_use]
    pub fn factor(&self) -> InformationFactor<T, N> {
        let (mut cascade, mut whole, mut step) = (*self, InformationFactor::EMPTY, 0);
        while !cascade.fold(&mut whole, &mut step) {}
        whole
    }

    /// Does one step towards a factor of everything absorbed; see [`super::BodyCascade::gather`]. Rows that
    /// wait for a block are left out.
    pub fn gather(&self, gathering: &mut Gathering<T, N>) -> bool {
        let Gathering { whole, step } = gathering;
        if *step == 0 && whole.rows > 0 {
            *whole = InformationFactor::EMPTY;
        }
        // Highest first: what moves up meanwhile is left out, never counted twice.
        if self.upper.gather(step, whole) {
            return false;
        }
        let part = usize::from(*step) - Levels::<T, N, UPPER>::PARTS;
        let more = part < InformationFactor::<T, N>::PARTS;
        if more {
            whole.merge_part(&self.absorbing, part);
        }
        *step = if more { *step + 1 } else { 0 };
        !more
    }
}
