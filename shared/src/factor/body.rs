use super::cascade::Levels;
use super::{BLOCK_ROWS, Block, Column, InformationFactor};
use crate::Scalar;
use crate::regressor::{self, RegressorBlock, SIGNALS};
use crate::spatial::{Position, Sensor};

/// Parameters that forces see: mcx, mcy, mcz, m, and the offset.
const FORCE: [usize; 7] = [1, 2, 3, 0, 10, 11, 12];
/// Parameters that moments see: the tensor, mcx, mcy, mcz, and the offset.
const MOMENT: [usize; 12] = [4, 5, 6, 7, 8, 9, 1, 2, 3, 13, 14, 15];
/// Levels above the absorbing one: 400 · 100³ wrenches before the last takes more than a hundred merges.
const UPPER: usize = 3;
/// Wrenches in a block.
const WRENCHES: u8 = (BLOCK_ROWS / 3) as u8;
/// Wrenches in a full absorbing level.
const FULL: u16 = 1600;

/// The cascade of a rigid body's `N` parameters, ten or sixteen, that knows which entries of its regressor are zero.
///
/// Forces do not see the tensor, moments do not see the mass. So the absorbing level is two small triangles, one of the
/// force rows and one of the moment rows, each fed with twelve rows, of four wrenches; when the level is full, both are
/// merged into one factor of all parameters. At N = 10 four wrenches meet 10 + 45 pairs of columns of twelve rows;
/// without that knowledge it would be 2 × 55.
#[derive(Clone, Copy, Debug)]
pub struct BodyCascade<T: Scalar, const N: usize> {
    level: Level<T>,
    columns: Columns<T>,
    /// Wrenches in the columns, three rows each, that wait for a fourth.
    waiting: u8,
    wrenches: u16,
    upper: Levels<T, N, UPPER>,
}

/// The absorbing level: `[R z]` of the forces and of the moments, by columns, z being the one after the last that is
/// estimated.
#[derive(Clone, Copy, Debug)]
struct Level<T: Scalar> {
    force: [[T; FORCE.len()]; FORCE.len() + 1],
    moment: [[T; MOMENT.len()]; MOMENT.len() + 1],
    residual_sum_of_squares: T,
}

impl<T: Scalar> Level<T> {
    const EMPTY: Self = Self {
        force: [[T::ZERO; FORCE.len()]; FORCE.len() + 1],
        moment: [[T::ZERO; MOMENT.len()]; MOMENT.len() + 1],
        residual_sum_of_squares: T::ZERO,
    };

    #[inline(never)]
    fn reduce(&mut self, columns: &mut Columns<T>, offset: bool) {
        let (force, moment) = estimated(offset);
        if let Some((m, rest)) = columns.split_at_mut_checked(moment + 1)
            && let Some(f) = rest.get_mut(..=force)
        {
            self.residual_sum_of_squares += T::reduce(self.force.as_flattened_mut(), FORCE.len(), f);
            self.residual_sum_of_squares += T::reduce(self.moment.as_flattened_mut(), MOMENT.len(), m);
        }
    }

    #[inline(never)]
    /// Merges both triangles into a factor of all parameters.
    fn merge_into<const N: usize>(&self, wrenches: u16, factor: &mut InformationFactor<T, N>) {
        let (force, moment) = estimated(N == 16);
        for first in (0..force + moment).step_by(BLOCK_ROWS) {
            let mut block = Block::ZERO;
            for slot in 0..BLOCK_ROWS {
                // The triangles' rows one below the other.
                let row = first + slot;
                if row < force {
                    place(&mut block, slot, &self.force, row, FORCE.get(..force).unwrap_or_default());
                } else {
                    place(
                        &mut block,
                        slot,
                        &self.moment,
                        row - force,
                        MOMENT.get(..moment).unwrap_or_default(),
                    );
                }
            }
            factor.reduce(0, &mut block);
        }
        factor.residual_sum_of_squares += self.residual_sum_of_squares;
        factor.rows = factor.rows.saturating_add(6 * u32::from(wrenches));
    }
}

/// Writes row `row` of `[R z]`, whose columns are these parameters, as row `slot` of the block.
fn place<T: Scalar, const N: usize, const K: usize>(
    block: &mut Block<T, N>,
    slot: usize,
    triangle: &[[T; K]],
    row: usize,
    parameters: &[usize],
) {
    let mut columns = triangle.iter().filter_map(|column| column.get(row));
    for (parameter, entry) in parameters.iter().zip(&mut columns) {
        if let Some(target) = block.columns.get_mut(*parameter).and_then(|c| c.rows.get_mut(slot)) {
            *target = *entry;
        }
    }
    if let Some((target, z)) = block.rhs.rows.get_mut(slot).zip(columns.next()) {
        *target = *z;
    }
}

/// How many of [`FORCE`] and [`MOMENT`] are estimated.
const fn estimated(offset: bool) -> (usize, usize) {
    if offset { (FORCE.len(), MOMENT.len()) } else { (4, 9) }
}

/// The columns of the moments and their right-hand side, then those of the forces, then what is not used.
type Columns<T> = [Column<T>; MOMENT.len() + FORCE.len() + 2];

/// Writes a wrench's whitened rows as the `third`th three rows of all columns.
#[inline(always)]
fn write<T: Scalar>(
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

impl<T: Scalar, const N: usize> Default for BodyCascade<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar, const N: usize> BodyCascade<T, N> {
    /// The cascade of no rows.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(N == 10 || N == 16, "ten parameters, or sixteen with the offset") }
        Self {
            level: Level::EMPTY,
            columns: [Column::ZERO; MOMENT.len() + FORCE.len() + 2],
            waiting: 0,
            wrenches: 0,
            upper: Levels::new(),
        }
    }

    /// Absorbs the six rows of a wrench, each multiplied by its weight. `signals` and `lever_arm` as in
    /// [`regressor::block`].
    #[inline(always)]
    pub fn absorb(&mut self, signals: &[T; SIGNALS], lever_arm: &Position<Sensor, T>, weights: &[T; 6]) {
        let offset = N == 16;
        let rows = regressor::block(signals, lever_arm);
        write(&mut self.columns, usize::from(self.waiting % WRENCHES), &rows, weights, offset);
        if self.waiting == WRENCHES - 1 {
            self.level.reduce(&mut self.columns, offset);
        }
        self.waiting = (self.waiting + 1) % WRENCHES;
        self.wrenches += 1;
        if self.wrenches < FULL {
            return self.upper.carry();
        }
        if let Some(next) = self.upper.next() {
            const { assert!(FULL.is_multiple_of(WRENCHES as u16), "nothing waits when the level is full") }
            self.level.merge_into(self.wrenches, next);
            self.level = Level::EMPTY;
        }
        self.wrenches = 0;
    }

    /// One factor of everything absorbed.
    #[must_use]
    pub fn factor(&self) -> InformationFactor<T, N> {
        let mut whole = self.upper.factor();
        let mut level = self.level;
        if self.waiting > 0 {
            let mut columns = self.columns;
            for column in &mut columns {
                for row in column.rows.iter_mut().skip(3 * usize::from(self.waiting)) {
                    *row = T::ZERO;
                }
            }
            level.reduce(&mut columns, N == 16);
        }
        level.merge_into(self.wrenches, &mut whole);
        whole
    }
}
