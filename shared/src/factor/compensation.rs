//! Compensation: what noise in the coefficients adds to `RᵀR` is taken off again.
//!
//! The estimate solves `(RᵀR − K) φ = Rᵀz`. With `C = R⁻ᵀ K R⁻¹` these are the rows `(1 − C) R φ = z`:
//! nothing is squared, and as z has unit covariance they are the factor of the compensated estimate and of
//! its covariance `(RᵀR − K)⁻¹ RᵀR (RᵀR − K)⁻¹`. Where the eigenvalues of C are below one half that is all.
//! Else noise has more than half of the information in some directions: the eigenvectors of C are found, and
//! these directions count as not determined: their standard deviation is at least twice the size of what may
//! be there, what was found over the share that is no noise.

use super::{BLOCK_ROWS, Column, Gram, InformationFactor, Triangle};
use crate::Scalar;
use crate::linear_algebra::{Jacobi, ROOM, add_scaled, dot_slices};

/// Columns that are substituted in one step.
const COLUMNS: usize = 4;
/// A pair of columns of n numbers takes about 40 n instructions to rotate: the number of instructions in one
/// step.
const ROTATION: usize = 8_000 / 40;

/// Shares of a direction's information that are no noise are distinguished down to this.
const LEAST_SHARE: f32 = 0.02;

/// Tells what is done next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Idle,
    /// `R⁻ᵀ K`, from this column on.
    First(u8),
    /// `R⁻ᵀ K R⁻¹`, from this column on.
    Second(u8),
    /// Is noise less than half of all directions?
    Test,
    /// The eigenvectors of C.
    Rotate,
    /// The rows of the directions from this one on.
    Directions(u8),
    /// The rows are written down.
    Subtract,
    /// Rows are reduced, from this block on.
    Reduce(u8),
    /// Nothing is left to do.
    Done,
}

/// Takes noise off a factor of at most sixteen parameters, in steps of bounded size.
#[derive(Clone, Copy, Debug)]
pub struct Compensation<T: Scalar> {
    stage: Stage,
    /// Parameters.
    n: usize,
    /// R by columns, the beginning, then the result; z is column n.
    triangle: [[T; ROOM]; ROOM + 1],
    residual_sum_of_squares: T,
    scalar_rows: u32,
    /// K, then `R⁻ᵀ K`, then the rows, by columns; values are column n.
    rows: [[T; ROOM]; ROOM + 1],
    /// C, its eigenvectors, and room for a test.
    jacobi: Jacobi<T, ROOM>,
}

impl<T: Scalar> Compensation<T> {
    /// Compensates nothing. All bits are zero.
    pub const UNUSED: Self = Self {
        stage: Stage::Idle,
        n: 0,
        triangle: [[T::ZERO; ROOM]; ROOM + 1],
        residual_sum_of_squares: T::ZERO,
        scalar_rows: 0,
        rows: [[T::ZERO; ROOM]; ROOM + 1],
        jacobi: Jacobi::EMPTY,
    };

    /// Begins with a factor and the given multiple of what noise adds to it. Where rows say nothing at all of
    /// a parameter, to rounding, the factor stays as it is.
    #[inline(never)]
    pub fn begin<const N: usize, const M: usize>(
        &mut self,
        factor: &InformationFactor<T, N>,
        gram: &Gram<T, M>,
        times: T,
    ) {
        const { assert!(N <= ROOM, "no more parameters than there is room for") }
        self.n = N;
        (self.residual_sum_of_squares, self.scalar_rows) = (factor.residual_sum_of_squares, factor.rows);
        let Triangle { r, z } = &factor.triangle;
        for (to, from) in self.triangle.iter_mut().zip(r.iter().chain([z])) {
            to.fill(T::ZERO);
            add_scaled(to, from, T::ONE);
        }
        self.rows.as_flattened_mut().fill(T::ZERO);
        for (to, from) in self.rows.iter_mut().zip(&gram.columns) {
            add_scaled(to, from, times);
        }
        let noisy = self.rows.as_flattened().iter().any(|entry| *entry != T::ZERO);
        self.stage = if noisy && self.is_determined() { Stage::First(0) } else { Stage::Idle };
    }

    fn is_determined(&self) -> bool {
        self.triangle.iter().take(self.n).enumerate().all(|(j, column)| {
            let diagonal = column.get(j).copied().unwrap_or_default();
            diagonal * diagonal > T::EPSILON * dot_slices(column, column)
        })
    }

    /// Does one step. Returns true when [`Self::factor`] is compensated.
    #[inline(never)]
    pub fn step(&mut self) -> bool {
        let n = self.n;
        let next = |k: u8| Some(k + COLUMNS as u8).filter(|k| usize::from(*k) < n);
        let stage = self.stage;
        self.stage = match stage {
            Stage::Idle | Stage::Done => Stage::Idle,
            Stage::First(j) => {
                self.substitute(usize::from(j), false);
                next(j).map_or(Stage::Second(0), Stage::First)
            }
            Stage::Second(j) => {
                self.substitute(usize::from(j), true);
                next(j).map_or(Stage::Test, Stage::Second)
            }
            Stage::Test if self.is_small() => Stage::Subtract,
            Stage::Subtract => {
                self.subtract();
                Stage::Reduce(0)
            }
            Stage::Test => {
                self.jacobi.begin(n);
                Stage::Rotate
            }
            Stage::Rotate if !self.jacobi.rotate_pairs(ROTATION / n.max(1)) => Stage::Rotate,
            Stage::Rotate => Stage::Directions(0),
            Stage::Directions(k) => {
                self.write_directions(usize::from(k));
                next(k).map_or(Stage::Reduce(0), Stage::Directions)
            }
            Stage::Reduce(part) => {
                self.reduce(usize::from(part));
                if (usize::from(part) + 1) * BLOCK_ROWS < n { Stage::Reduce(part + 1) } else { Stage::Done }
            }
        };
        self.stage == Stage::Idle
    }

    /// Returns the factor, compensated when every step is done, of as many parameters as began.
    pub fn factor<const N: usize>(&self) -> InformationFactor<T, N> {
        let mut factor = InformationFactor::EMPTY;
        let Triangle { r, z } = &mut factor.triangle;
        for (to, from) in r.iter_mut().chain([z]).zip(&self.triangle) {
            add_scaled(to, from, T::ONE);
        }
        factor.set_residual(self.residual_sum_of_squares, self.scalar_rows);
        factor
    }

    /// Computes `R⁻ᵀ` of some columns of K, or of the rows of the result.
    fn substitute(&mut self, first: usize, second: bool) {
        for j in first..(first + COLUMNS).min(self.n) {
            let mut from = [T::ZERO; ROOM];
            for (k, slot) in from.iter_mut().enumerate() {
                let place = if second { (k, j) } else { (j, k) };
                *slot = entry(&self.rows, place);
            }
            let mut x = [T::ZERO; ROOM];
            for (i, (column, value)) in self.triangle.iter().zip(&from).take(self.n).enumerate() {
                let known = x.get(..i).unwrap_or_default();
                let solved = (*value - dot_slices(known, column)) / column.get(i).copied().unwrap_or(T::ONE);
                if let Some(slot) = x.get_mut(i) {
                    *slot = solved;
                }
            }
            let to = if second { self.jacobi.w.get_mut(j) } else { self.rows.get_mut(j) };
            if let Some(to) = to {
                *to = x;
            }
        }
    }

    /// Returns whether `½ − C` is positive definite, by Cholesky.
    fn is_small(&mut self) -> bool {
        let half = T::from_f32(0.5);
        let Jacobi { w: c, v: lower, .. } = &mut self.jacobi;
        for i in 0..self.n.min(ROOM) {
            let (done, rest) = lower.split_at_mut(i);
            let (Some(row), Some(c)) = (rest.first_mut(), c.get(i)) else { return false };
            for (j, other) in done.iter().enumerate() {
                let known = row.get(..j).unwrap_or_default();
                let sum = c.get(j).copied().unwrap_or_default() + dot_slices(known, other);
                let solved = -sum / other.get(j).copied().unwrap_or(T::ONE);
                if let Some(slot) = row.get_mut(j) {
                    *slot = solved;
                }
            }
            let known = row.get(..i).unwrap_or_default();
            let left = half - c.get(i).copied().unwrap_or_default() - dot_slices(known, known);
            let is_positive = left > T::EPSILON;
            if !is_positive {
                return false;
            }
            if let Some(slot) = row.get_mut(i) {
                *slot = left.sqrt();
            }
        }
        true
    }

    /// Computes the rows `R − R⁻ᵀ K`.
    fn subtract(&mut self) {
        for (own, r) in self.rows.iter_mut().zip(&self.triangle).take(self.n + 1) {
            for (own, r) in own.iter_mut().zip(r) {
                *own = *r - *own;
            }
        }
    }

    /// Writes the rows of some eigenvectors v of C: `(1 − λ) vᵀ R φ = vᵀ z`.
    fn write_directions(&mut self, first: usize) {
        let half = T::from_f32(0.5);
        let n = self.n;
        let directions = self.jacobi.v.iter().zip(&self.jacobi.w).enumerate().take(n);
        for (k, (v, w)) in directions.skip(first).take(COLUMNS) {
            let share = T::ONE - dot_slices(v, w);
            let z = self.triangle.get(n).map_or(T::ZERO, |z| dot_slices(v, z));
            let weight = share.max(half);
            let found = z / weight;
            let mut certain = weight;
            if share < half {
                let (own, size) = (T::ONE / weight, z / share.max(T::from_f32(LEAST_SHARE)));
                let most = size + size;
                certain = T::ONE / (own * own + most * most).sqrt();
            }
            for (j, (column, r)) in self.rows.iter_mut().zip(&self.triangle).take(n + 1).enumerate() {
                if let Some(slot) = column.get_mut(k) {
                    *slot = certain * if j == n { found } else { dot_slices(v, r) };
                }
            }
        }
    }

    /// Reduces twelve of the rows.
    fn reduce(&mut self, part: usize) {
        if part == 0 {
            let used = self.triangle.as_flattened_mut().get_mut(..(self.n + 1) * ROOM);
            used.unwrap_or_default().fill(T::ZERO);
        }
        let mut columns = [Column::ZERO; ROOM + 1];
        for (target, column) in columns.iter_mut().zip(&self.rows).take(self.n + 1) {
            for (slot, entry) in target.rows.iter_mut().zip(column.iter().skip(part * BLOCK_ROWS)) {
                *slot = *entry;
            }
        }
        if let Some(columns) = columns.get_mut(..=self.n) {
            // What the rows leave is theirs, not the compensation's.
            T::reduce(self.triangle.as_flattened_mut(), ROOM, columns);
        }
    }
}

fn entry<T: Scalar>(columns: &[[T; ROOM]; ROOM + 1], (column, row): (usize, usize)) -> T {
    columns.get(column).and_then(|column| column.get(row)).copied().unwrap_or_default()
}
