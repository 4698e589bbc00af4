use core::num::NonZeroU16;

use super::cascade::Levels;
use super::level::{COLUMNS, Columns, Level, estimated, write, write_together};
use super::{BLOCK_ROWS, Column, Gram, InformationFactor};
use crate::Scalar;
use crate::forgetting::{Memory, Plan};
use crate::linear_algebra::{ROOM, scale};
use crate::regressor::{self, SIGNALS};
use crate::spatial::{Position, Sensor};
use crate::whitening::{CHANNELS, LowPass, Whitening};

/// Levels above the absorbing one: 1600 · 100³ wrenches before the last takes more than a hundred merges.
const UPPER: usize = 3;
/// Steps of [`BodyCascade::fold`]: those for what is above the absorbing level, that of a level that is being merged (several
/// parts), that of the columns that wait, and that of the absorbing level (several parts).
const FOLD_UPPER: usize = 2 * UPPER;
const FOLD_WAITING: usize = FOLD_UPPER + 1;
const FOLD_LEVEL: usize = FOLD_WAITING + 1;
/// Wrenches in a block.
const WRENCHES: u8 = (BLOCK_ROWS / 3) as u8;
/// Wrenches in a block of rows that see all parameters.
const PAIR: u8 = (BLOCK_ROWS / CHANNELS) as u8;
/// Pairs of columns that are reduced at once for each parameter, where the rest has time: a tenth of a
/// reduction.
const SOME: usize = 2;
/// Wrenches in a full absorbing level.
const FULL: u16 = 1600;
/// Wrenches in a full absorbing level of rows that see all parameters, as one triangle takes all of them.
const FULL_TOGETHER: u16 = FULL / 2;

/// The cascade of a rigid body's `N` parameters, ten or sixteen, that knows which entries of its regressor
/// are zero.
///
/// Forces do not see the tensor, moments do not see the mass. So the absorbing level is two small triangles,
/// one of the force rows and one of the moment rows, each fed with twelve rows, of four wrenches; when the
/// level is full, both are merged into one factor of all parameters. At N = 10 four wrenches meet 10 + 45
/// pairs of columns of twelve rows; without that knowledge it would be 2 × 55.
///
/// If the noise of forces and moments is correlated, every whitened row sees every parameter: the moments'
/// triangle then takes all of them, twelve rows of two wrenches at a time.
#[derive(Clone, Copy, Debug)]
pub struct BodyCascade<T: Scalar, const N: usize> {
    level: Level<T>,
    columns: Columns<T>,
    /// Wrenches in the columns: three rows each that wait for a fourth, or until all four are reduced.
    waiting: u8,
    /// Columns of these wrenches that are reduced already; see [`Level::reduce`].
    reduced: u8,
    /// Rows see all parameters, and go into the moments' triangle.
    together: bool,
    /// Wrenches in the level and in the columns.
    wrenches: u16,
    /// Parts of the full level that are in the next one already.
    parts_merged: u8,
    /// The number of wrenches of a segment; none if everything is retained.
    segment: Option<NonZeroU16>,
    upper: Upper<T, N>,
}

/// Tells what is above the absorbing level. The tag of the first variant is 0: an empty cascade is all zero
/// bits.
#[derive(Clone, Copy, Debug)]
#[repr(u8)]
#[allow(clippy::large_enum_variant, reason = "no heap")]
enum Upper<T: Scalar, const N: usize> {
    /// Levels that keep everything.
    Levels(Levels<T, N, UPPER>),
    /// A memory that does not, in their place.
    Memory(Memory<T, N>),
}

impl<T: Scalar, const N: usize> Default for BodyCascade<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar, const N: usize> BodyCascade<T, N> {
    /// Returns the cascade of no rows.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(N == 10 || N == 16, "ten parameters, or sixteen with the offset") }
        Self {
            level: Level::EMPTY,
            columns: [Column::ZERO; COLUMNS],
            waiting: 0,
            reduced: 0,
            together: false,
            wrenches: 0,
            parts_merged: 0,
            segment: None,
            upper: Upper::Levels(Levels::new()),
        }
    }

    /// Keeps what this memory keeps, from now on; what was absorbed before is lost. Whoever absorbs must then
    /// [`Self::take_segment`] when one is complete, and give it to [`Self::memory`].
    #[inline(never)]
    pub(crate) fn set_memory(&mut self, plan: &Plan<T, N>) {
        (self.level, self.waiting, self.reduced, self.wrenches) = (Level::EMPTY, 0, 0, 0);
        self.segment = NonZeroU16::new(plan.segment_blocks());
        self.upper = Upper::Memory(Memory::new(plan));
    }

    /// Puts a factor of everything absorbed before into the highest level of an empty cascade. False, and
    /// nothing is done, if a memory keeps what is absorbed.
    pub fn restore(&mut self, factor: &InformationFactor<T, N>) -> bool {
        match &mut self.upper {
            Upper::Levels(levels) => {
                levels.restore(factor);
                true
            }
            Upper::Memory(_) => false,
        }
    }

    /// Returns whether a memory keeps what is absorbed.
    pub(crate) fn remembers(&self) -> bool {
        matches!(self.upper, Upper::Memory(_))
    }

    /// Returns whether enough has been absorbed for a segment.
    #[inline]
    pub(crate) fn segment_is_complete(&self) -> bool {
        self.segment.is_some_and(|segment| self.wrenches >= segment.get())
    }

    /// Takes out what the absorbing level holds.
    pub(crate) fn take_segment(&mut self, segment: &mut InformationFactor<T, N>) {
        *segment = InformationFactor::EMPTY;
        if self.waiting > 0 {
            self.reduce_waiting();
        }
        for part in 0.. {
            if !self.level.merge_part(part, self.wrenches, self.together, segment) {
                break;
            }
        }
        (self.level, self.waiting, self.wrenches) = (Level::EMPTY, 0, 0);
    }

    /// Returns what noise of the signals has added to the memory, if there is one.
    pub(crate) fn memory_gram(&self) -> Option<Gram<T, ROOM>> {
        match &self.upper {
            Upper::Memory(memory) => Some(memory.gram()),
            Upper::Levels(_) => None,
        }
    }

    /// Returns the memory, if there is one.
    pub(crate) fn memory(&mut self) -> Option<&mut Memory<T, N>> {
        match &mut self.upper {
            Upper::Memory(memory) => Some(memory),
            Upper::Levels(_) => None,
        }
    }

    /// Absorbs the six rows of a wrench, each multiplied by its weight. `signals` and `lever_arm` as in
    /// [`regressor::block`].
    #[inline(always)]
    pub fn absorb(&mut self, signals: &[T; SIGNALS], lever_arm: &Position<Sensor, T>, weights: &[T; 6]) {
        if self.is_full() {
            self.reduce_waiting();
        }
        let rows = regressor::block(signals, lever_arm);
        write(&mut self.columns, usize::from(self.waiting % WRENCHES), &rows, weights, N == 16);
        self.waiting += 1;
        self.wrenches = self.wrenches.saturating_add(1);
        if self.waiting < WRENCHES {
            self.tidy(FULL);
        }
    }

    /// Returns whether forces and moments of four wrenches, or of those whose reduction has begun, are still
    /// to be reduced.
    #[inline]
    fn is_full(&self) -> bool {
        !self.together && (self.waiting >= WRENCHES || self.reduced > 0)
    }

    /// Absorbs the six rows of a wrench, each multiplied by its factor and then whitened together. All rows
    /// from the first such on must be absorbed so: [`Self::see_together`] goes before.
    #[inline(always)]
    pub fn absorb_together(
        &mut self,
        signals: &[T; SIGNALS],
        lever_arm: &Position<Sensor, T>,
        factors: &[T; CHANNELS],
        whitening: &Whitening<T>,
        low_pass: &mut LowPass<T>,
    ) {
        if self.waiting >= PAIR {
            // A level is handed up as it is, or not yet.
            while self.parts_merged > 0 {
                self.tidy(FULL_TOGETHER);
            }
            self.level.reduce_together(&mut self.columns, N);
            self.waiting = 0;
        }
        let rows = regressor::block(signals, lever_arm);
        let half = usize::from(self.waiting);
        write_together(&mut self.columns, half, &rows, factors, whitening, low_pass, N == 16);
        self.waiting += 1;
        self.wrenches = self.wrenches.saturating_add(1);
        if self.waiting < PAIR && self.parts_merged == 0 {
            self.tidy(FULL);
        }
    }

    /// Does a part of the work that absorbing has left, which absorbing else does itself, later: reduces rows
    /// that fill a block, or, where rows see all parameters, hands a part of a full level up. Returns whether
    /// that took about as long as absorbing does.
    #[inline]
    pub fn settle(&mut self) -> bool {
        if !self.together {
            if self.is_full() {
                self.reduce_some(SOME * N);
            }
            return false;
        }
        if self.waiting >= PAIR && self.parts_merged == 0 {
            self.level.reduce_together(&mut self.columns, N);
            self.waiting = 0;
            return true;
        }
        let is_full = self.wrenches > FULL_TOGETHER;
        if is_full {
            self.tidy(FULL_TOGETHER);
        }
        is_full
    }

    /// Does a part of what [`Self::see_together`] will do, which is then at most one reading away, and
    /// [`Self::settle`] goes on with it. Returns whether there was something to begin with. The bits are
    /// those of all in one go.
    #[inline(never)]
    pub fn begin_together(&mut self) -> bool {
        let begins = !self.together && self.waiting > 0 && self.reduced == 0 && self.parts_merged == 0;
        if begins {
            self.clear_unused_rows();
            self.reduce_some(SOME * N);
        }
        begins
    }

    /// Lets rows see all parameters from now on.
    #[inline(never)]
    pub fn see_together(&mut self) {
        if self.together {
            return;
        }
        if self.is_full() {
            self.reduce_waiting();
        }
        while self.parts_merged > 0 {
            self.tidy(FULL);
        }
        if self.waiting > 0 {
            self.reduce_waiting();
        }
        self.level.widen(N == 16);
        self.together = true;
    }

    /// Multiplies all rows absorbed so far.
    #[inline(never)]
    pub(crate) fn scale(&mut self, by: T) {
        if self.is_full() {
            self.reduce_waiting();
        }
        let Level { force, moment, residual_sum_of_squares } = &mut self.level;
        scale(force.as_flattened_mut(), by);
        scale(moment.as_flattened_mut(), by);
        *residual_sum_of_squares *= by * by;
        for column in &mut self.columns {
            scale(&mut column.rows, by);
        }
        match &mut self.upper {
            Upper::Levels(upper) => upper.scale(by),
            Upper::Memory(memory) => memory.scale(by),
        }
    }

    /// Does, between two reductions, a part of what a full level asks for, so that no wrench waits for all of
    /// it.
    #[inline]
    fn tidy(&mut self, full: u16) {
        let Upper::Levels(upper) = &mut self.upper else { return };
        if self.wrenches <= full {
            return upper.carry();
        }
        // Those that are waiting in the columns are not yet in the level.
        let in_level = self.wrenches - u16::from(self.waiting);
        let Some(next) = upper.lowest() else { return };
        if self.level.merge_part(self.parts_merged, in_level, self.together, next) {
            self.parts_merged += 1;
            return;
        }
        upper.count();
        self.level = Level::EMPTY;
        self.wrenches = u16::from(self.waiting);
        self.parts_merged = 0;
    }

    /// Does one step towards one factor of everything absorbed. Returns true when `whole`, which began empty,
    /// is that. Nothing may be absorbed meanwhile, nor afterwards: the cascade is used up. `step` begins at
    /// 0.
    pub fn fold(&mut self, whole: &mut InformationFactor<T, N>, step: &mut u8) -> bool {
        if self.is_full() {
            self.reduce_waiting();
            return false;
        }
        let k = usize::from(*step);
        let mut stays = false;
        match (k, &self.upper) {
            (0..FOLD_UPPER, Upper::Levels(upper)) => {
                *step += upper.fold(k, whole);
                return false;
            }
            (0..FOLD_UPPER, Upper::Memory(memory)) => memory.fold(k, whole),
            (FOLD_UPPER, _) if self.parts_merged > 0 => {
                // What is left of a level that is being merged; its count went with the first part.
                stays = self.level.merge_part(self.parts_merged, 0, self.together, whole);
                if stays {
                    self.parts_merged += 1;
                } else {
                    (self.level, self.wrenches, self.parts_merged) =
                        (Level::EMPTY, u16::from(self.waiting), 0);
                }
            }
            (FOLD_WAITING, _) if self.waiting > 0 => self.reduce_waiting(),
            (FOLD_LEVEL, _) => {
                stays = self.level.merge_part(self.parts_merged, self.wrenches, self.together, whole);
                self.parts_merged += u8::from(stays);
            }
            _ => {}
        }
        *step += u8::from(!stays);
        usize::from(*step) > FOLD_LEVEL
    }

    /// Zeroes the rows of the columns that no wrench waits in.
    fn clear_unused_rows(&mut self) {
        let (force, moment) = estimated(N == 16);
        let (of_each, used) = if self.together { (CHANNELS, N + 1) } else { (3, force + moment + 2) };
        let rows = of_each * usize::from(self.waiting);
        if rows < BLOCK_ROWS {
            for column in self.columns.iter_mut().take(used) {
                for row in column.rows.iter_mut().skip(rows) {
                    *row = T::ZERO;
                }
            }
        }
    }

    /// Takes what waits in the columns into the absorbing level.
    fn reduce_waiting(&mut self) {
        if self.reduced == 0 {
            self.clear_unused_rows();
        }
        if self.together {
            self.level.reduce_together(&mut self.columns, N);
            self.waiting = 0;
            return;
        }
        if self.reduced == 0 {
            self.level.reduce_all(&mut self.columns, N == 16);
            self.waiting = 0;
        }
        while self.waiting > 0 {
            self.reduce_some(usize::MAX);
        }
    }

    /// Reduces some columns of what waits.
    #[inline(never)]
    fn reduce_some(&mut self, most: usize) {
        let left = self.level.reduce(&mut self.columns, N == 16, self.reduced, most);
        self.reduced = left.unwrap_or(0);
        if left.is_none() {
            self.waiting = 0;
        }
    }

    /// Returns one factor of everything absorbed.
    #[must_use]
    pub fn factor(&self) -> InformationFactor<T, N> {
        let (mut cascade, mut whole, mut step) = (*self, InformationFactor::EMPTY, 0);
        while !cascade.fold(&mut whole, &mut step) {}
        whole
    }

    /// Does one step towards a factor of everything absorbed, for where one sample must not pay for all of
    /// it. Returns true when `gathering` holds it: what was absorbed before the first step, and perhaps some
    /// of what arrived since.
    pub fn gather(&mut self, gathering: &mut Gathering<T, N>) -> bool {
        let Gathering { whole, step } = gathering;
        if *step == 0 && whole.rows > 0 {
            *whole = InformationFactor::EMPTY;
        }
        if self.is_full() {
            self.reduce_waiting();
        }
        let Upper::Levels(upper) = &self.upper else { return true };
        // Highest first: what moves up meanwhile is left out, never counted twice.
        if upper.gather(step, whole) {
            return false;
        }
        // While the level is being merged its parts are in both places.
        let part = *step - Levels::<T, N, UPPER>::PARTS as u8;
        let more = self.parts_merged == 0 && self.level.merge_part(part, self.wrenches, self.together, whole);
        *step = if more { *step + 1 } else { 0 };
        !more
    }
}

/// A factor that is being put together; see [`BodyCascade::gather`].
#[derive(Clone, Copy, Debug)]
pub struct Gathering<T: Scalar, const N: usize> {
    /// The factor, once complete.
    pub whole: InformationFactor<T, N>,
    pub(super) step: u8,
}

impl<T: Scalar, const N: usize> Gathering<T, N> {
    /// The gathering of nothing.
    pub const EMPTY: Self = Self { whole: InformationFactor::EMPTY, step: 0 };
}

impl<T: Scalar, const N: usize> Default for Gathering<T, N> {
    fn default() -> Self {
        Self::EMPTY
    }
}
