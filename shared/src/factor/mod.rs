//! The information factor: everything rows `A φ = y ± σ` say about φ, in fixed size.
//!
//! Lives here: absorbing row blocks by orthogonal reduction ([`InformationFactor`]), the cascade that keeps
//! `f32` from stagnating ([`Cascade`]), and what can be read off the triangle ([`Solution`]). May not live
//! here: where rows come from. Before this: [`crate::conditioning`]; after it: [`crate::estimator`].
//!
//! After any number of rows, `[R z; 0 ρ]` is the triangular factor of the stacked `[A y]`: recursive least
//! squares in its square-root information form. It needs no prior, survives rank deficiency, loses digits
//! with cond(A) and not with its square, and two factors merge by stacking them and reducing again.

mod body;
mod cascade;
mod compensation;
mod gram;
mod level;
mod marginal;
mod packed;
mod reflection;
mod solution;

pub use body::{BodyCascade, Gathering};
pub use cascade::Cascade;
pub use compensation::Compensation;
pub use gram::Gram;
pub use packed::{PackedFactor, packed_entries};
pub use reflection::{BLOCK_ROWS, Column};
pub use solution::{Solution, Solver, condition_number};

pub(crate) use reflection::{reduce, reduce_packed};
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub(crate) use reflection::{reduce_on_core, reduce_packed_on_core};

use crate::Scalar;
use crate::linear_algebra::{copy, scale};

/// `R`, `z`, the residual sum of squares and the row count of all rows seen.
///
/// Rows are expected whitened (divided by their σ), so that `(RᵀR)⁻¹` is a covariance. The diagonal of R is
/// never negative. Columns are stored in the order of the parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InformationFactor<T: Scalar, const N: usize> {
    triangle: Triangle<T, N>,
    residual_sum_of_squares: T,
    rows: u32,
}

/// `[R z]` by columns: `r[j][i]` is R_ij, zero for i > j.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
struct Triangle<T: Scalar, const N: usize> {
    r: [[T; N]; N],
    z: [T; N],
}

/// Rows `A φ = y`, by columns, y being the last.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block<T: Scalar, const N: usize> {
    /// `columns[j].rows[i]` is row i's coefficient of parameter j.
    pub columns: [Column<T>; N],
    /// `rhs.rows[i]` is row i's right-hand side.
    pub rhs: Column<T>,
}

impl<T: Scalar, const N: usize> Block<T, N> {
    /// Rows of zeros, which say nothing.
    pub const ZERO: Self = Self { columns: [Column::ZERO; N], rhs: Column::ZERO };

    /// Returns the columns `first..` and the right-hand side.
    fn columns_from(&mut self, first: usize) -> &mut [Column<T>] {
        let all: *mut Self = self;
        // SAFETY: `repr(C)`, N columns and one more of the same type, without padding between them.
        let all = unsafe { core::slice::from_raw_parts_mut(all.cast::<Column<T>>(), N + 1) };
        all.get_mut(first..).unwrap_or_default()
    }
}

impl<T: Scalar, const N: usize> Default for InformationFactor<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar, const N: usize> InformationFactor<T, N> {
    /// Tells how many numbers [`Self::entries`] yields: the triangle, z and the residual sum of squares.
    pub const ENTRIES: usize = N * (N + 3) / 2 + 1;

    /// The factor of no rows.
    pub const EMPTY: Self = Self {
        triangle: Triangle { r: [[T::ZERO; N]; N], z: [T::ZERO; N] },
        residual_sum_of_squares: T::ZERO,
        rows: 0,
    };

    /// Returns the factor of no rows.
    #[must_use]
    pub const fn new() -> Self {
        Self::EMPTY
    }

    /// Returns the triangle R, by rows, zero below the diagonal.
    pub fn r(&self) -> [[T; N]; N] {
        core::array::from_fn(|i| core::array::from_fn(|j| self.triangle.r[j][i]))
    }

    /// Returns R_ij; zero where there is none.
    pub(crate) fn entry(&self, i: usize, j: usize) -> T {
        self.triangle.r.get(j).and_then(|column| column.get(i)).copied().unwrap_or_default()
    }

    /// Returns the factor in room for `M` parameters, of which the first are those that it has.
    pub(crate) fn resized<const M: usize>(&self) -> InformationFactor<T, M> {
        let mut resized = InformationFactor::EMPTY;
        for (to, from) in resized.triangle.r.iter_mut().zip(&self.triangle.r) {
            for (to, from) in to.iter_mut().zip(from) {
                *to = *from;
            }
        }
        for (to, from) in resized.triangle.z.iter_mut().zip(&self.triangle.z) {
            *to = *from;
        }
        (resized.residual_sum_of_squares, resized.rows) = (self.residual_sum_of_squares, self.rows);
        resized
    }

    /// Returns the projected right-hand side.
    pub fn z(&self) -> &[T; N] {
        &self.triangle.z
    }

    /// Returns the sum of squares that no φ can explain.
    pub fn residual_sum_of_squares(&self) -> T {
        self.residual_sum_of_squares
    }

    /// Returns the number of scalar rows absorbed.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Absorbs twelve rows. The block is used up.
    ///
    /// Not-finite rows must be kept out by the caller ([`crate::screening`]).
    #[inline]
    pub fn absorb_block(&mut self, block: &mut Block<T, N>) {
        self.reduce(0, block);
        self.rows = self.rows.saturating_add(BLOCK_ROWS as u32);
    }

    /// Absorbs M rows: `columns[j][i]` is row i's coefficient of parameter j.
    pub fn absorb<const M: usize>(&mut self, columns: &[[T; M]; N], rhs: &[T; M]) {
        for first in (0..M).step_by(BLOCK_ROWS) {
            let part = |rows: &[T; M]| {
                Column::from(core::array::from_fn(|i| rows.get(first + i).copied().unwrap_or(T::ZERO)))
            };
            let mut block = Block { columns: core::array::from_fn(|j| part(&columns[j])), rhs: part(rhs) };
            self.reduce(0, &mut block);
        }
        self.rows = self.rows.saturating_add(M as u32);
    }

    /// Reduces rows whose columns before `first` are zero.
    #[inline]
    fn reduce(&mut self, first: usize, block: &mut Block<T, N>) {
        let triangle: *mut Triangle<T, N> = &mut self.triangle;
        // SAFETY: `repr(C)`, N + 1 arrays of N numbers, without padding between them.
        let triangle = unsafe { core::slice::from_raw_parts_mut(triangle.cast::<T>(), N * (N + 1)) };
        let triangle = triangle.get_mut(first * (N + 1)..).unwrap_or_default();
        self.residual_sum_of_squares += T::reduce(triangle, N, block.columns_from(first));
    }

    /// Merges another factor of the same parameters: the result is the factor of both sets of rows.
    pub fn merge(&mut self, other: &Self) {
        for part in 0..Self::PARTS {
            self.merge_part(other, part);
        }
    }

    /// Parts of a merge: twelve rows of the other triangle each.
    pub(crate) const PARTS: usize = N.div_ceil(BLOCK_ROWS);

    /// Does one part of a merge; all of them must be done, in their order.
    #[inline(never)]
    pub(crate) fn merge_part(&mut self, other: &Self, part: usize) {
        let first = part * BLOCK_ROWS;
        let mut block = Block::ZERO;
        let Triangle { r, z } = &other.triangle;
        // Below the diagonal there are zeros.
        for (target, column) in block.columns.iter_mut().zip(r).skip(first) {
            copy(&mut target.rows, column.get(first..).unwrap_or_default());
        }
        copy(&mut block.rhs.rows, z.get(first..).unwrap_or_default());
        self.reduce(first, &mut block);
        if part + 1 == Self::PARTS {
            self.residual_sum_of_squares += other.residual_sum_of_squares;
            self.rows = self.rows.saturating_add(other.rows);
        }
    }

    /// Returns the rows of the upper triangle one after the other, then z, then the residual sum of squares.
    pub fn entries(&self) -> impl Iterator<Item = T> + '_ {
        let Triangle { r, z } = &self.triangle;
        (0..N)
            .flat_map(move |i| r.iter().skip(i).map(move |column| column[i]))
            .chain(z.iter().copied())
            .chain(core::iter::once(self.residual_sum_of_squares))
    }

    /// Returns row `i` of `[R z]` from the diagonal on. Empty if there is no such row.
    pub fn row(&self, i: usize) -> impl Iterator<Item = T> + '_ {
        let Triangle { r, z } = &self.triangle;
        r.iter()
            .chain(core::iter::once(z))
            .skip(i.min(N + 1))
            .filter_map(move |column| column.get(i).copied())
    }

    /// Makes the factor of [`Self::entries`]. `None` if there are not [`Self::ENTRIES`] finite numbers, a
    /// diagonal entry or the residual sum is negative.
    pub fn from_entries(entries: impl IntoIterator<Item = T>, rows: u32) -> Option<Self> {
        let mut factor = Self::new();
        let mut entries = entries.into_iter();
        for i in 0..N {
            for (j, column) in factor.triangle.r.iter_mut().enumerate().skip(i) {
                column[i] = entries.next().filter(|v| v.is_finite() && (i != j || *v >= T::ZERO))?;
            }
        }
        for v in &mut factor.triangle.z {
            *v = entries.next().filter(|v| v.is_finite())?;
        }
        factor.residual_sum_of_squares = entries.next().filter(|v| v.is_finite() && *v >= T::ZERO)?;
        factor.rows = rows;
        entries.next().is_none().then_some(factor)
    }

    /// Makes the factor as [`Self::from_entries`] does, of the first [`Self::ENTRIES`] of these numbers, for
    /// callers who know `N` by a value alone.
    #[inline(never)]
    pub fn like(&self, entries: impl IntoIterator<Item = T>, rows: u32) -> Option<Self> {
        Self::from_entries(entries.into_iter().take(Self::ENTRIES), rows)
    }

    /// Returns the factor of the same rows about other parameters, `z − R φ_r`. The factor stays the same to
    /// the last bit for a reference of zero, or if the numbers would not be finite.
    #[inline(never)]
    pub(crate) fn about(&self, reference: &[T; N]) -> Self {
        let mut shifted = *self;
        for (column, reference) in self.triangle.r.iter().zip(reference) {
            for (z, r) in shifted.triangle.z.iter_mut().zip(column) {
                *z -= *r * *reference;
            }
        }
        if shifted.triangle.z.iter().all(|z| z.is_finite()) { shifted } else { *self }
    }

    /// Returns the rows, whose solution is `estimate`, with standard deviations `by` times as large and the
    /// same solution and correlations.
    pub fn stretched(&self, estimate: &[T; N], by: &[T; N]) -> Self {
        let mut stretched = self.about(estimate);
        for (column, by) in stretched.triangle.r.iter_mut().zip(by) {
            *column = column.map(|r| r / *by);
        }
        stretched.about(&estimate.map(|v| -v))
    }

    /// Multiplies all rows.
    pub(crate) fn scale(&mut self, by: T) {
        scale(self.triangle.r.as_flattened_mut(), by);
        scale(&mut self.triangle.z, by);
        self.residual_sum_of_squares *= by * by;
    }

    /// Sets the residual sum and the row count; the triangle stays.
    pub(crate) fn set_residual(&mut self, residual_sum_of_squares: T, rows: u32) {
        (self.residual_sum_of_squares, self.rows) = (residual_sum_of_squares, rows);
    }

    /// Converts the factor to another scalar.
    pub fn cast<U: Scalar>(&self, convert: impl Fn(T) -> U) -> InformationFactor<U, N> {
        InformationFactor {
            triangle: Triangle {
                r: self.triangle.r.map(|column| column.map(&convert)),
                z: self.triangle.z.map(&convert),
            },
            residual_sum_of_squares: convert(self.residual_sum_of_squares),
            rows: self.rows,
        }
    }

    /// Returns whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.entries().all(Scalar::is_finite)
    }

    /// Returns the covariance `(RᵀR)⁻¹`; entries of parameters that [`Solution::determined`] denies are
    /// meaningless.
    pub fn covariance(&self) -> [[T; N]; N] {
        solution::covariance(self)
    }

    /// Returns `√(RᵀR)⁻¹_jj` at the price of a triangular inverse; infinite where R is singular. Without the
    /// judgement of [`InformationFactor::solve`] about what is determined, and many times cheaper.
    pub fn standard_deviations(&self) -> [T; N] {
        solution::standard_deviations(&self.triangle.r)
    }

    /// Returns the estimate by back substitution, at a price of `N²`; `None` unless every parameter's
    /// variance inflation factor `(RᵀR)_jj (RᵀR)⁻¹_jj` is below `1/ε`. `deviations` are
    /// [`InformationFactor::standard_deviations`].
    pub fn well_determined(&self, deviations: &[T; N]) -> Option<[T; N]> {
        solution::well_determined(self, deviations)
    }

    /// Returns estimate, standard deviations, what is determined, and the condition number.
    pub fn solve(&self) -> Solution<T, N> {
        Solution::of(self)
    }
}

#[cfg(test)]
mod tests;
