//! The test for a change of the watched link, and its size.
//!
//! Rows `y = Y φ + b + ε`: φ is what the link's parameters are more than known, b an offset of the wrench. If
//! the link changed by δ some time ago, newer rows have `Y δ` too. With the factor of older rows, absorbed
//! beside newer ones, and δ's columns last, the triangle holds `[D z]` of δ alone: `|z|²` is what δ explains,
//! χ² of ten degrees of freedom if nothing has changed, whatever φ and b. A sweep asks that of the newest
//! bin, of the newest two, and so on, one step a frame.
//!
//! The noise of the six channels goes together: a force under a foot is a moment about the IMU. Its
//! covariance is that of the differences of successive rows in the first half of the time that the test needs
//! to settle; rows are multiplied by the inverse of its Cholesky factor.
//!
//! Known parameters are wrong, too, and what that leaves is no white noise. So each length of the newest rows
//! has a mean and a maximum of its `|z|²` from the second half on. Where the mean is above ten, the limit is
//! as many times larger, and no limit is less than 2.5 times the maximum. Variances grow as if two directions
//! of the ten had all of it.

use crate::Scalar;
use crate::factor::{BLOCK_ROWS, Column, PackedFactor, packed_entries};

use super::filter::Six;

/// Bins that are stored row by row. A change is searched for at each of their borders.
pub const BINS: usize = 20;
/// Parameters of the link.
const LINK: usize = 10;
/// Parameters of the link, and the offset.
const COMMON: usize = LINK + 6;
/// Parameters of the link, the offset, and the change.
const ALL: usize = COMMON + LINK;
/// Bins since a change when it is measured.
const MEASURED_AFTER: usize = 14;
/// Sweeps after which it is measured in any case.
const PATIENCE: u16 = 30;
/// Borders that explain this much less than the best one, in units of the noise, are not excluded.
const LESS: f32 = 11.0;
/// The limit is this many times the largest that was seen while nothing was reported.
const ABOVE: f32 = 2.5;
/// The remainder of errors of known parameters is in one or two of the ten directions: variances grow by this
/// many times what the mean does.
const DIRECTIONS: u32 = 5;
/// Noise is at least this part of what is stated.
const LEAST_NOISE: f32 = 1e-3;
/// A mean of this many sweeps; older ones are forgotten.
const SWEEPS: u16 = 600;
/// Root of the inflation of the variance beyond which single precision does not tell a parameter from the
/// others.
const INFLATION: f32 = 1000.0;

type Common<T> = PackedFactor<T, COMMON, { packed_entries(COMMON) }>;
type Joint<T> = PackedFactor<T, ALL, { packed_entries(ALL) }>;

/// Holds a change that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change<T> {
    /// Number of the frame after which it was found.
    pub found: u32,
    /// Number of the frame about which it happened.
    pub at: u32,
    /// Frames not before which, and not after which, it happened.
    pub between: [u32; 2],
    /// The part that it explains against its limit; above 1.
    pub ratio: T,
    /// The size of the change, if it has been measured: of m, m c, and the tensor, and their standard
    /// deviations. These are infinite for quantities that rows do not determine.
    pub size: Option<([T; LINK], [T; LINK])>,
}

/// Two blocks of six rows.
#[derive(Clone, Copy, Debug)]
struct Bin<T> {
    /// Ten columns and the right-hand side.
    columns: [[T; BLOCK_ROWS]; LINK + 1],
    /// Frames of its first and its last block.
    frames: [u32; 2],
}

/// The next step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// There is no new bin.
    Idle,
    /// This number of the newest bins but this are asked.
    Sweep(u8),
    /// A change is measured: the bin this many before the newest is taken in.
    Measure(u8),
}

/// A change that is under way to be measured.
#[derive(Clone, Copy, Debug)]
struct Alarm<T> {
    change: Change<T>,
    sweeps: u16,
    /// Bins surely after it, and the first one surely before it, counted from the newest.
    sure: [u8; 2],
    inflation: T,
}

/// The test.
#[derive(Clone, Copy, Debug)]
pub(super) struct Test<T: Scalar> {
    /// 1 σ of rows as stated.
    sigma: [T; 6],
    limit: T,
    settle: u16,
    keep: T,
    /// Differences of rows that were taken for the noise, the last rows, and the sum of squares and products.
    differences: u16,
    last: [T; 6],
    noise: [[T; 6]; 6],
    /// The factor of rows, a lower triangle.
    white: [[T; 6]; 6],
    bins: [Bin<T>; BINS],
    /// Bins there are, and the place of the next one.
    count: u8,
    next: u8,
    /// Rows of half a bin.
    half: Option<(Six<T>, u32)>,
    /// The factor of rows that are no longer among the bins.
    before: Common<T>,
    /// The factor of the newest rows, and that of both with the change.
    newest: Common<T>,
    both: Joint<T>,
    step: Step,
    /// The part that the change at each border has explained in this sweep, and on average.
    explained: [T; BINS],
    mean: [T; BINS],
    largest: [T; BINS],
    sweeps: u16,
    /// True during an alarm; `alarm` describes it.
    alarming: bool,
    alarm: Alarm<T>,
    changes: u16,
}

/// A block of all columns, and the right-hand side.
type Block<T> = [Column<T>; ALL + 1];

impl<T: Scalar> Test<T> {
    pub(super) const UNUSED: Self = Self {
        sigma: [T::ZERO; 6],
        limit: T::ZERO,
        settle: 0,
        keep: T::ZERO,
        differences: 0,
        last: [T::ZERO; 6],
        noise: [[T::ZERO; 6]; 6],
        white: [[T::ZERO; 6]; 6],
        bins: [Bin { columns: [[T::ZERO; BLOCK_ROWS]; LINK + 1], frames: [0; 2] }; BINS],
        count: 0,
        next: 0,
        half: None,
        before: Common::EMPTY,
        newest: Common::EMPTY,
        both: Joint::EMPTY,
        step: Step::Idle,
        explained: [T::ZERO; BINS],
        mean: [T::ZERO; BINS],
        largest: [T::ZERO; BINS],
        sweeps: 0,
        alarming: false,
        alarm: Alarm {
            change: Change { found: 0, at: 0, between: [0; 2], ratio: T::ZERO, size: None },
            sweeps: 0,
            sure: [0; 2],
            inflation: T::ZERO,
        },
        changes: 0,
    };

    /// States the noise of rows, and that a change is reported beyond `limit` after the given number of bins.
    /// Each bin `keep` of older rows is kept.
    pub(super) fn set_up(&mut self, sigma: [T; 6], limit: T, settle: u16, keep: T) {
        (self.sigma, self.limit, self.settle, self.keep) = (sigma, limit, settle, keep);
        self.clear();
    }

    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        (self.count, self.next, self.half, self.step) = (0, 0, None, Step::Idle);
        self.before.clear(COMMON);
        self.newest.clear(COMMON);
        (self.mean, self.largest) = ([T::ZERO; BINS], [T::ZERO; BINS]);
        (self.differences, self.noise) = (0, [[T::ZERO; 6]; 6]);
        (self.sweeps, self.alarming, self.changes) = (0, false, 0);
    }

    /// Returns how many changes were found.
    pub(super) fn changes(&self) -> u16 {
        self.changes
    }

    /// Returns whether a change would be reported.
    pub(super) fn is_settled(&self) -> bool {
        self.sweeps > self.settle / 2
    }

    /// Returns the mean of what a change explains while there is none, of the given number of newest bins but
    /// one, against what noise would.
    pub(super) fn excess(&self, bins: usize) -> T {
        let mean = self.mean.get(bins).copied().unwrap_or_default() / T::from_u32(LINK as u32);
        mean.max(T::ONE)
    }

    /// Takes rows for the noise: as many blocks as half the bins in which the test settles have. Returns true
    /// if it still needs some.
    fn learns(&mut self, rows: &Six<T>) -> bool {
        if self.differences > self.settle {
            return false;
        }
        let left: [T; 6] = rows.map(|[.., left]| left);
        if self.differences > 0 {
            for ((line, a), last_a) in self.noise.iter_mut().zip(left).zip(self.last) {
                for ((sum, b), last_b) in line.iter_mut().zip(left).zip(self.last) {
                    *sum += (a - last_a) * (b - last_b);
                }
            }
        }
        self.last = left;
        self.differences += 1;
        if self.differences > self.settle {
            self.whiten();
        }
        true
    }

    /// Computes `L⁻¹` of the noise's covariance `L Lᵀ`, by columns.
    #[cold]
    #[inline(never)]
    fn whiten(&mut self) {
        // A difference has twice the variance.
        let by = T::ONE / T::from_u32(2 * u32::from(self.differences.max(2) - 1));
        let mut lower = [[T::ZERO; 6]; 6];
        for i in 0..6 {
            for j in 0..=i {
                let least = if i == j { at(&self.sigma, i) * T::from_f32(LEAST_NOISE) } else { T::ZERO };
                let mut rest = entry(&self.noise, i, j) * by + least * least;
                for k in 0..j {
                    rest -= entry(&lower, i, k) * entry(&lower, j, k);
                }
                // Rounding leaves no less than what is stated at least.
                let value = if i == j { rest.max(least * least).sqrt() } else { rest / entry(&lower, j, j) };
                set(&mut lower, i, j, value);
            }
        }
        self.white = [[T::ZERO; 6]; 6];
        for j in 0..6 {
            for i in j..6 {
                let mut rest = if i == j { T::ONE } else { T::ZERO };
                for k in j..i {
                    rest -= entry(&lower, i, k) * entry(&self.white, k, j);
                }
                set(&mut self.white, i, j, rest / entry(&lower, i, i));
            }
        }
    }

    /// Takes six rows about this frame.
    // Every twenty-fifth frame: small is worth more than fast.
    #[cold]
    #[inline(never)]
    pub(super) fn take(&mut self, rows: &Six<T>, frame: u32) {
        if self.learns(rows) {
            return;
        }
        let Some((first, since)) = self.half.take() else {
            self.half = Some((*rows, frame));
            return;
        };
        let place = usize::from(self.next);
        if usize::from(self.count) == BINS {
            self.before.scale(self.keep);
            if let Some(bin) = self.bins.get(place) {
                absorb(&mut self.before, bin, &self.white);
            }
        } else {
            self.count += 1;
        }
        self.next = ((place + 1) % BINS) as u8;
        let Some(bin) = self.bins.get_mut(place) else { return };
        bin.frames = [since, frame];
        for (half, rows) in [&first, rows].into_iter().enumerate() {
            for (i, weights) in self.white.iter().enumerate() {
                for (j, column) in bin.columns.iter_mut().enumerate() {
                    let products = rows.iter().zip(weights).map(|(row, weight)| at(row, j) * *weight);
                    if let Some(slot) = column.get_mut(6 * half + i) {
                        *slot = products.sum();
                    }
                }
            }
        }
        self.newest.clear(COMMON);
        self.step = Step::Sweep(0);
    }

    /// Returns the bin at this distance before the newest.
    fn bin(&self, back: u8) -> Option<&Bin<T>> {
        let at = usize::from(self.next) + 2 * BINS - 1 - usize::from(back);
        if back < self.count { self.bins.get(at % BINS) } else { None }
    }

    /// Does a step of what is to be done. Returns a change if it has found or measured one.
    #[inline(never)]
    pub(super) fn step(&mut self, frame: u32) -> Option<Change<T>> {
        match self.step {
            Step::Idle => None,
            Step::Sweep(back) => {
                let bin = self.bin(back).copied();
                // What is left of it goes to the rows before a change.
                if let Some(bin) = bin.filter(|_| usize::from(back) + 1 < BINS) {
                    absorb(&mut self.newest, &bin, &self.white);
                    self.join();
                    if let Some(slot) = self.explained.get_mut(usize::from(back)) {
                        *slot = self.both.explained_from(COMMON);
                    }
                    self.step = Step::Sweep(back + 1);
                    return None;
                }
                self.step = Step::Idle;
                self.judge(usize::from(back), frame)
            }
            Step::Measure(back) => {
                let [after, before] = self.alarm.sure;
                match self.bin(back).copied() {
                    Some(bin) => {
                        let into = if back < after { Some(&mut self.newest) } else { None };
                        let into = if back >= before { Some(&mut self.before) } else { into };
                        if let Some(factor) = into {
                            absorb(factor, &bin, &self.white);
                        }
                        self.step = Step::Measure(back + 1);
                        None
                    }
                    None => self.measured(),
                }
            }
        }
    }

    /// Joins the rows before, the newest, and the columns of a change.
    #[inline(never)]
    fn join(&mut self) {
        self.both.extend(&self.before, ALL);
        for first in (0..COMMON).step_by(BLOCK_ROWS) {
            let mut block: Block<T> = [const { Column::ZERO }; ALL + 1];
            let rows = first..COMMON.min(first + BLOCK_ROWS);
            let used = rows.len();
            for (slot, i) in rows.enumerate() {
                for (j, value) in (i..).zip(self.newest.row(i)) {
                    let column = if j == COMMON { ALL } else { j };
                    put(&mut block, column, slot, value);
                    if j < LINK {
                        put(&mut block, COMMON + j, slot, value);
                    }
                }
            }
            self.both.absorb(&mut block, used);
        }
    }

    /// Returns what a sweep over the given number of borders has found.
    #[cold]
    #[inline(never)]
    fn judge(&mut self, borders: usize, frame: u32) -> Option<Change<T>> {
        let borders = borders.min(BINS);
        if self.alarming {
            self.alarm.sweeps = self.alarm.sweeps.saturating_add(1);
            let patience = self.alarm.sweeps >= PATIENCE;
            let best = self.best(borders)?;
            if best + 1 < MEASURED_AFTER && !patience {
                return None;
            }
            self.begin_measuring(best, borders);
            return None;
        }
        let settled = self.is_settled();
        let (mut largest, mut at) = (T::ZERO, 0);
        for k in 0..borders {
            let explained = self.explained.get(k).copied().unwrap_or_default();
            let largest_seen = self.largest.get(k).copied().unwrap_or_default() * T::from_f32(ABOVE);
            let ratio = explained / (self.limit * self.excess(k)).max(largest_seen);
            if ratio > largest {
                (largest, at) = (ratio, k);
            }
        }
        if settled && largest > T::ONE {
            self.changes = self.changes.saturating_add(1);
            let [from, to] = self.around(at, at);
            let change = Change {
                found: frame,
                at: from + (to - from) / 2,
                between: [from, to],
                ratio: largest,
                size: None,
            };
            self.alarming = true;
            self.alarm = Alarm { change, sweeps: 0, sure: [0; 2], inflation: T::ONE };
            return Some(change);
        }
        self.remember(borders, settled);
        None
    }

    /// Updates the mean of what a change at each border explains where there is none. A change that begins to
    /// show counts little.
    #[cold]
    #[inline(never)]
    fn remember(&mut self, borders: usize, settled: bool) {
        if borders + 1 < BINS {
            return;
        }
        self.sweeps = self.sweeps.saturating_add(1);
        let n = T::from_u32(u32::from(self.sweeps.min(SWEEPS)));
        for k in 0..borders {
            let most = self.excess(k) * T::from_u32(3 * LINK as u32);
            let (Some(mean), Some(explained)) = (self.mean.get_mut(k), self.explained.get(k)) else {
                continue;
            };
            if let Some(largest) = self.largest.get_mut(k) {
                *largest = largest.max(*explained);
            }
            let explained = if settled && *explained > most { most } else { *explained };
            *mean += (explained - *mean) / n;
        }
    }

    /// Returns the border at which a change explains most.
    #[cold]
    #[inline(never)]
    fn best(&self, borders: usize) -> Option<usize> {
        let explained = self.explained.get(..borders)?;
        let mut best = 0;
        for (k, value) in explained.iter().enumerate() {
            if *value > explained.get(best).copied().unwrap_or_default() {
                best = k;
            }
        }
        Some(best)
    }

    /// Returns the frames around the borders from the newer to the older one: border k lies between bin k and
    /// the one before it.
    #[cold]
    #[inline(never)]
    fn around(&self, newer: usize, older: usize) -> [u32; 2] {
        let last = self.bin(newer as u8).map_or(0, |bin| bin.frames[1]);
        let first = self.bin(older as u8 + 1).map_or(last, |bin| bin.frames[0]);
        [first.min(last), last]
    }

    #[cold]
    #[inline(never)]
    fn begin_measuring(&mut self, best: usize, borders: usize) {
        let excess = (0..BINS).map(|k| self.excess(k)).fold(T::ONE, T::max);
        let inflation = T::ONE + (excess - T::ONE) * T::from_u32(DIRECTIONS);
        let most = self.explained.get(best).copied().unwrap_or_default();
        let least = most - T::from_f32(LESS) * excess;
        let possible = |k: &usize| self.explained.get(*k).is_some_and(|explained| *explained >= least);
        let newer = (0..best).rev().take_while(possible).last().unwrap_or(best);
        let older = (best..borders).take_while(possible).last().unwrap_or(best);
        let between = self.around(newer, older);
        let [from, to] = self.around(best, best);
        self.alarm.change.between = between;
        self.alarm.change.at = from + (to - from) / 2;
        // The bins on both sides of a border may hold the change.
        self.alarm.sure = [newer as u8, older as u8 + 2];
        self.alarm.inflation = inflation;
        self.newest.clear(COMMON);
        self.step = Step::Measure(0);
    }

    /// Returns the change with its size, of rows before and after. From now on the link is what it is after
    /// the change.
    #[cold]
    #[inline(never)]
    fn measured(&mut self) -> Option<Change<T>> {
        self.step = Step::Idle;
        self.alarming = false;
        let alarm = self.alarm;
        self.join();
        let size: [T; LINK] = self.both.last(COMMON);
        let root = alarm.inflation.sqrt();
        let deviation = core::array::from_fn(|k| {
            let is_determined = self.both.inflation(COMMON + k) < T::from_f32(INFLATION);
            if is_determined { self.both.standard_deviation(COMMON + k) * root } else { T::ONE / T::ZERO }
        });
        // The offset is the same after the change: rows before it that know of nothing else stay.
        let mut block: Block<T> = [const { Column::ZERO }; ALL + 1];
        for (slot, i) in (LINK..COMMON).enumerate() {
            for (j, value) in (i..).zip(self.before.row(i)) {
                put(&mut block, j, slot, value);
            }
        }
        self.before = self.newest;
        if let Some(block) = block.get_mut(..=COMMON) {
            self.before.absorb(block, COMMON - LINK);
        }
        (self.count, self.next, self.half) = (0, 0, None);
        Some(Change { size: Some((size, deviation)), ..alarm.change })
    }
}

fn put<T: Scalar>(block: &mut [Column<T>], column: usize, row: usize, value: T) {
    if let Some(slot) = block.get_mut(column).and_then(|column| column.rows.get_mut(row)) {
        *slot = value;
    }
}

fn at<T: Scalar, const N: usize>(values: &[T; N], i: usize) -> T {
    values.get(i).copied().unwrap_or_default()
}

fn entry<T: Scalar>(matrix: &[[T; 6]; 6], i: usize, j: usize) -> T {
    matrix.get(i).map_or(T::ZERO, |row| at(row, j))
}

fn set<T: Scalar>(matrix: &mut [[T; 6]; 6], i: usize, j: usize, value: T) {
    if let Some(slot) = matrix.get_mut(i).and_then(|row| row.get_mut(j)) {
        *slot = value;
    }
}

/// Absorbs a bin, and the offset's columns: those of the whitened channels.
#[inline(never)]
fn absorb<T: Scalar>(factor: &mut Common<T>, bin: &Bin<T>, white: &[[T; 6]; 6]) {
    let mut block: [Column<T>; COMMON + 1] = [const { Column::ZERO }; COMMON + 1];
    for (j, column) in bin.columns.iter().enumerate() {
        if let Some(slot) = block.get_mut(if j == LINK { COMMON } else { j }) {
            *slot = Column::from(*column);
        }
    }
    for (i, weights) in white.iter().enumerate() {
        for (c, weight) in weights.iter().enumerate() {
            put(&mut block, LINK + c, i, *weight);
            put(&mut block, LINK + c, i + 6, *weight);
        }
    }
    factor.absorb(&mut block, BLOCK_ROWS);
}
