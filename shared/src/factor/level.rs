//! The absorbing level of a rigid body's cascade: two small triangles, and how rows come into and out of
//! them.

use super::{BLOCK_ROWS, Block, Column, InformationFactor};
use crate::Scalar;
use crate::linear_algebra::copy;
use crate::regressor::RegressorBlock;
use crate::whitening::{CHANNELS, LowPass, Passes, Whitening, combined};

/// Parameters that forces see: mcx, mcy, mcz, m, and the offset.
const FORCE: [usize; 7] = [1, 2, 3, 0, 10, 11, 12];
/// Parameters that moments see: the tensor, mcx, mcy, mcz, and the offset; then those that they do not see.
const ALL: [usize; 16] = [4, 5, 6, 7, 8, 9, 1, 2, 3, 13, 14, 15, 0, 10, 11, 12];
/// The order of the parameters where the offset is known.
const TEN: [usize; 10] = [4, 5, 6, 7, 8, 9, 1, 2, 3, 0];

/// The absorbing level: `[R z]` of the forces and of the moments, by columns, z being the one after the last
/// that the rows see.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level<T: Scalar> {
    pub(super) force: [[T; FORCE.len()]; FORCE.len() + 1],
    pub(super) moment: [[T; ALL.len()]; ALL.len() + 1],
    pub(super) residual_sum_of_squares: T,
}

impl<T: Scalar> Level<T> {
    pub(super) const EMPTY: Self = Self {
        force: [[T::ZERO; FORCE.len()]; FORCE.len() + 1],
        moment: [[T::ZERO; ALL.len()]; ALL.len() + 1],
        residual_sum_of_squares: T::ZERO,
    };

    /// Reduces the columns of both.
    #[inline(never)]
    pub(super) fn reduce_all(&mut self, columns: &mut Columns<T>, offset: bool) {
        let (force, moment) = estimated(offset);
        if let Some((m, rest)) = columns.split_at_mut_checked(moment + 1)
            && let Some(f) = rest.get_mut(..=force)
        {
            self.residual_sum_of_squares += T::reduce(self.force.as_flattened_mut(), FORCE.len(), f);
            self.residual_sum_of_squares += T::reduce(self.moment.as_flattened_mut(), ALL.len(), m);
        }
    }

    /// Reduces some columns, from the `first`th of the forces' and the moments' on: as many as cost about
    /// `most`, one at least. Returns what is then the first one, none if all are done.
    #[inline(never)]
    pub(super) fn reduce(
        &mut self,
        columns: &mut Columns<T>,
        offset: bool,
        first: u8,
        most: usize,
    ) -> Option<u8> {
        let (force, moment) = estimated(offset);
        let (m, f) = columns.split_at_mut_checked(moment + 1)?;
        let first = usize::from(first);
        let of_force = first <= force;
        let (triangle, stride, columns, before) = if of_force {
            (self.force.as_flattened_mut(), FORCE.len(), f.get_mut(..=force)?, 0)
        } else {
            (self.moment.as_flattened_mut(), ALL.len(), m, force + 1)
        };
        let (start, all) = (first - before, columns.len());
        let (mut end, mut cost) = (start, 0);
        while end < all && (end == start || cost < most) {
            // To be reflected by each before it, and to become a reflection.
            cost += 1 + end;
            end += 1;
        }
        self.residual_sum_of_squares += T::reduce_part(triangle, stride, columns, start..end);
        (of_force || end < all).then_some((before + end) as u8)
    }

    /// Reduces rows that see all `n` parameters.
    #[inline(never)]
    pub(super) fn reduce_together(&mut self, columns: &mut Columns<T>, n: usize) {
        if let Some(columns) = columns.get_mut(..=n) {
            self.residual_sum_of_squares += T::reduce(self.moment.as_flattened_mut(), ALL.len(), columns);
        }
    }

    /// Makes room in the moments' triangle for the parameters that moments do not see.
    pub(super) fn widen(&mut self, offset: bool) {
        let (_, moment) = estimated(offset);
        let all = if offset { ALL.len() } else { TEN.len() };
        self.moment.swap(moment, all);
    }

    /// Merges the part `part` of both triangles into a factor of all parameters. Returns false if there is no
    /// such part.
    #[inline(never)]
    pub(super) fn merge_part<const N: usize>(
        &self,
        part: u8,
        wrenches: u16,
        together: bool,
        factor: &mut InformationFactor<T, N>,
    ) -> bool {
        let (force, moment) = estimated(N == 16);
        let moment = if together { N } else { moment };
        let of_moments: &[usize] = if N == 16 { &ALL } else { &TEN };
        let first = usize::from(part) * BLOCK_ROWS;
        if first >= force + moment {
            return false;
        }
        let mut block = Block::ZERO;
        // The triangles' rows one below the other.
        place(&mut block, &self.force, FORCE.get(..force).unwrap_or_default(), 0, first);
        place(&mut block, &self.moment, of_moments.get(..moment).unwrap_or_default(), force, first);
        factor.reduce(0, &mut block);
        if part == 0 {
            factor.residual_sum_of_squares += self.residual_sum_of_squares;
            factor.rows = factor.rows.saturating_add(6 * u32::from(wrenches));
        }
        true
    }
}

/// Writes the rows of `[R z]`, whose columns are these parameters and whose first row is row `above` of all,
/// as far as they are among the twelve from row `first` on.
#[inline(always)]
fn place<T: Scalar, const N: usize, const K: usize>(
    block: &mut Block<T, N>,
    triangle: &[[T; K]],
    parameters: &[usize],
    above: usize,
    first: usize,
) {
    let (skipped, slot) = (first.saturating_sub(above), above.saturating_sub(first));
    let all = parameters.len();
    if skipped >= all {
        return;
    }
    // Below the diagonal there are zeros.
    let put = |target: &mut Column<T>, column: &[T; K]| {
        let (slots, entries) = (target.rows.get_mut(slot..), column.get(skipped..));
        copy(slots.unwrap_or_default(), entries.unwrap_or_default());
    };
    for (parameter, column) in parameters.iter().zip(triangle) {
        if let Some(target) = block.columns.get_mut(*parameter) {
            put(target, column);
        }
    }
    if let Some(z) = triangle.get(all) {
        put(&mut block.rhs, z);
    }
}

/// Returns how many of [`FORCE`] are estimated, and how many parameters moments see.
pub(super) const fn estimated(offset: bool) -> (usize, usize) {
    if offset { (FORCE.len(), 12) } else { (4, 9) }
}

/// The columns of the moments and their right-hand side, then those of the forces, then what is not used. Of
/// rows that see all parameters: the columns of all and their right-hand side.
pub(super) type Columns<T> = [Column<T>; COLUMNS];
pub(super) const COLUMNS: usize = 12 + FORCE.len() + 2;

/// Writes a wrench's whitened rows as the `third`th three rows of all columns.
#[inline(always)]
pub(super) fn write<T: Scalar>(
    columns: &mut Columns<T>,
    third: usize,
    rows: &RegressorBlock<T>,
    weights: &[T; 6],
    offset: bool,
) {
    let (force, moment) = estimated(offset);
    let [wfx, wfy, wfz, wmx, wmy, wmz] = *weights;
    let whitened_force = |c: &[T; 6]| [c[0] * wfx, c[1] * wfy, c[2] * wfz];
    let whitened_moment = |c: &[T; 6]| [c[3] * wmx, c[4] * wmy, c[5] * wmz];
    for k in 0..6 {
        columns[k].set_third(third, whitened_moment(&rows.columns[4 + k]));
    }
    for k in 0..3 {
        // −[a]× has no diagonal.
        let mut cross = whitened_moment(&rows.columns[1 + k]);
        cross[k] = T::ZERO;
        columns[6 + k].set_third(third, cross);
    }
    columns[moment].set_third(third, whitened_moment(&rows.wrench));
    let f = moment + 1;
    for k in 0..3 {
        columns[f + k].set_third(third, whitened_force(&rows.columns[1 + k]));
    }
    columns[f + 3].set_third(third, whitened_force(&rows.columns[0]));
    if offset {
        let unit = |w: [T; 3], k: usize| core::array::from_fn(|axis| if axis == k { w[k] } else { T::ZERO });
        for k in 0..3 {
            columns[9 + k].set_third(third, unit([wmx, wmy, wmz], k));
            columns[f + 4 + k].set_third(third, unit([wfx, wfy, wfz], k));
        }
    }
    columns[f + force].set_third(third, whitened_force(&rows.wrench));
}

/// Writes a wrench's rows, whitened together, as the `half`th six rows of all columns.
#[inline(never)]
pub(super) fn write_together<T: Scalar>(
    columns: &mut Columns<T>,
    half: usize,
    rows: &RegressorBlock<T>,
    factors: &[T; CHANNELS],
    whitening: &Whitening<T>,
    low_pass: &mut LowPass<T>,
    offset: bool,
) {
    let mut by = whitening.columns;
    if factors.iter().any(|factor| *factor < T::ONE) {
        for (column, factor) in by.iter_mut().zip(factors) {
            *column = column.map(|t| t * *factor);
        }
    }
    let [fx, fy, fz, mx, my, mz] = by;
    let passes = Passes::of(whitening);
    let mut put = |position: usize, mut column: [T; CHANNELS]| {
        low_pass.pass(position, &passes, &mut column);
        columns[position].set_half(half, column);
    };
    for k in 0..6 {
        let [.., a, b, c] = rows.columns[4 + k];
        put(k, combined(&[mx, my, mz], &[a, b, c]));
    }
    for k in 0..3 {
        put(6 + k, combined(&by, &rows.columns[1 + k]));
    }
    let [a, b, c, ..] = rows.columns[0];
    let mass = combined(&[fx, fy, fz], &[a, b, c]);
    let n = if offset {
        for (k, column) in [mx, my, mz].into_iter().enumerate() {
            put(9 + k, column);
        }
        put(12, mass);
        for (k, column) in [fx, fy, fz].into_iter().enumerate() {
            put(13 + k, column);
        }
        16
    } else {
        put(9, mass);
        10
    };
    put(n, combined(&by, &rows.wrench));
    low_pass.end();
}
