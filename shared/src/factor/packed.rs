//! One level of a factor, in half the room, that is handed over row by row.
//!
//! Every row of `[R z]` is a whitened equation of its own. A row may therefore be taken out at any time
//! ([`PackedFactor::forget_row`]) and absorbed elsewhere; what is left is the factor of what is left. So a
//! device without room for a second copy gives its level away while it goes on absorbing, and no row is
//! counted twice or lost.

use super::{BLOCK_ROWS, Column};
use crate::Scalar;

/// Returns the count of numbers of a packed `[R z]` of N parameters: N (N + 1) / 2 and N.
pub const fn packed_entries(n: usize) -> usize {
    n * (n + 1) / 2 + n
}

/// `[R z]` of up to `N` parameters by columns, only what is not zero by construction: column j has j + 1
/// numbers and starts at j (j + 1) / 2. `E` must be [`packed_entries`] of N. One level: in `f32` it is to be
/// handed over at least every 1e5 samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackedFactor<T: Scalar, const N: usize, const E: usize> {
    entries: [T; E],
    parameters: u16,
    residual_sum_of_squares: T,
    rows: u32,
}

impl<T: Scalar, const N: usize, const E: usize> PackedFactor<T, N, E> {
    /// The factor of no parameters. All bits are zero.
    pub const EMPTY: Self =
        Self { entries: [T::ZERO; E], parameters: 0, residual_sum_of_squares: T::ZERO, rows: 0 };

    /// Forgets everything; from now on of the given number of parameters, at most N.
    pub fn clear(&mut self, parameters: usize) {
        const { assert!(E == packed_entries(N) && N <= u16::MAX as usize) }
        self.entries.fill(T::ZERO);
        self.parameters = parameters.min(N) as u16;
        (self.residual_sum_of_squares, self.rows) = (T::ZERO, 0);
    }

    /// Makes it the factor of the rows of `smaller`, of the given number of parameters, of which the first
    /// are those of `smaller`.
    pub fn extend<const M: usize, const F: usize>(
        &mut self,
        smaller: &PackedFactor<T, M, F>,
        parameters: usize,
    ) {
        self.clear(parameters);
        let (n, all) = (smaller.parameters(), self.parameters());
        // Columns are packed one after the other, so the first ones are where they were.
        let (triangle, z) = smaller.entries.split_at(smaller.entries.len().min(n * (n + 1) / 2));
        self.entries.iter_mut().zip(triangle).for_each(|(slot, value)| *slot = *value);
        let slots = self.entries.iter_mut().skip(all * (all + 1) / 2).take(n);
        slots.zip(z).for_each(|(slot, value)| *slot = *value);
        (self.residual_sum_of_squares, self.rows) = (smaller.residual_sum_of_squares, smaller.rows);
    }

    /// Multiplies all rows.
    pub fn scale(&mut self, by: T) {
        self.entries.iter_mut().for_each(|entry| *entry *= by);
        self.residual_sum_of_squares *= by * by;
    }

    /// Returns the sum of squares of the right-hand side that the parameters from `first` on explain beside
    /// those before them.
    pub fn explained_from(&self, first: usize) -> T {
        let n = self.parameters();
        let z = self.entries.iter().skip(n * (n + 1) / 2).take(n);
        z.skip(first).map(|z| *z * *z).sum()
    }

    /// Returns the values of the last parameters, from `first` on, by back substitution; zero of one that
    /// nothing is known of.
    pub fn last<const L: usize>(&self, first: usize) -> [T; L] {
        let n = self.parameters();
        let entry = |i: usize, j: usize| self.entries.get(j * (j + 1) / 2 + i).copied().unwrap_or(T::ZERO);
        let mut x = [T::ZERO; L];
        for k in (0..n.saturating_sub(first).min(L)).rev() {
            let i = first + k;
            let mut rest = entry(i, n);
            for (j, known) in x.iter().enumerate().skip(k + 1) {
                rest -= entry(i, first + j) * *known;
            }
            rest /= entry(i, i);
            if let (Some(slot), true) = (x.get_mut(k), rest.is_finite()) {
                *slot = rest;
            }
        }
        x
    }

    /// Returns the root of the inflation of a parameter's variance by all others: 1 where no other one
    /// resembles it. Infinite where it is not determined.
    pub fn inflation(&self, j: usize) -> T {
        let first = j * (j + 1) / 2;
        let column = self.entries.get(first..=first + j).unwrap_or_default();
        self.standard_deviation(j) * column.iter().map(|r| *r * *r).sum::<T>().sqrt()
    }

    /// Returns the number of parameters.
    pub fn parameters(&self) -> usize {
        usize::from(self.parameters)
    }

    /// Returns the number of scalar rows absorbed since it was last empty.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Returns the sum of squares that no φ can explain.
    pub fn residual_sum_of_squares(&self) -> T {
        self.residual_sum_of_squares
    }

    /// Absorbs `rows` of the rows of a block: a column for every parameter, then the right-hand side; the
    /// others are zero. The columns are used up. Not-finite rows must be kept out by the caller. Nothing is
    /// done if the columns are not those of the parameters.
    #[inline]
    pub fn absorb(&mut self, columns: &mut [Column<T>], rows: usize) {
        if columns.len() != self.parameters() + 1 || rows > BLOCK_ROWS {
            return;
        }
        self.residual_sum_of_squares += T::reduce_packed(&mut self.entries, columns);
        self.rows = self.rows.saturating_add(rows as u32);
    }

    /// Returns row `i` from the diagonal on, then its z. Empty if there is no such row.
    pub fn row(&self, i: usize) -> impl Iterator<Item = T> + '_ {
        let columns = if i < self.parameters() { i..self.parameters() + 1 } else { 0..0 };
        columns.map(move |j| self.entries.get(j * (j + 1) / 2 + i).copied().unwrap_or(T::ZERO))
    }

    /// Returns the standard deviation of parameter `j`, the length of row j of `R⁻¹`: `x R = e_j` from the
    /// diagonal on. Infinite where the rows do not determine what comes after it, or there is no such
    /// parameter.
    #[inline(never)]
    pub fn standard_deviation(&self, j: usize) -> T {
        let mut x = [T::ZERO; N];
        let mut square = if j < self.parameters() { T::ZERO } else { T::ONE / T::ZERO };
        for k in j..self.parameters() {
            let first = k * (k + 1) / 2;
            let Some((diagonal, above)) = self.entries.get(first..=first + k).and_then(<[T]>::split_last)
            else {
                break;
            };
            let (Some(known), Some(above)) = (x.get(j..k), above.get(j..k)) else { break };
            let mut rest = if k == j { T::ONE } else { T::ZERO };
            for (x, r) in known.iter().zip(above) {
                rest -= *x * *r;
            }
            rest /= *diagonal;
            square += rest * rest;
            if let Some(slot) = x.get_mut(k) {
                *slot = rest;
            }
        }
        // A zero on the diagonal leaves infinity or NaN.
        if square.is_finite() { square.sqrt() } else { T::ONE / T::ZERO }
    }

    /// Makes row `i` zero, when it has been handed over.
    pub fn forget_row(&mut self, i: usize) {
        if i >= self.parameters() {
            return;
        }
        for j in i..=self.parameters() {
            if let Some(entry) = self.entries.get_mut(j * (j + 1) / 2 + i) {
                *entry = T::ZERO;
            }
        }
    }

    /// Takes out the sum of squares that no φ can explain and the count of the rows absorbed.
    pub fn take_residual(&mut self) -> (T, u32) {
        (core::mem::take(&mut self.residual_sum_of_squares), core::mem::take(&mut self.rows))
    }

    /// Absorbs a row that was handed over: its coefficients from parameter `first` on, then its right-hand
    /// side. Nothing is done if it is not that long.
    pub fn merge_row(&mut self, first: usize, row: &[T]) {
        if first + row.len() != self.parameters() + 1 {
            return;
        }
        let mut columns = [Column::ZERO; MERGED];
        let Some(columns) = columns.get_mut(..=self.parameters()) else { return };
        for (column, value) in columns.iter_mut().skip(first).zip(row) {
            column.rows[0] = *value;
        }
        self.absorb(columns, 0);
    }

    /// Adds what was taken out with [`Self::take_residual`].
    pub fn merge_residual(&mut self, residual_sum_of_squares: T, rows: u32) {
        self.residual_sum_of_squares += residual_sum_of_squares;
        self.rows = self.rows.saturating_add(rows);
    }
}

/// Columns of the longest row that is merged.
const MERGED: usize = 129;
