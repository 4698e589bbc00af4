//! Householder reflections that move rows into a triangle.
//!
//! A column `x` of rows meets the diagonal entry `r`: `r′ = √(r² + |x|²)`, and with `e = (r + r′)/|x|²`
//!
//! ```text
//! y = e x      k = 1/(e r′)
//! u = k (y·c − ρ)   ρ ← ρ + u   c ← c − u y       for every later column c with its entry ρ in r's row
//! ```
//!
//! which is `1 − τ v vᵀ` with `v = [−|x|²/(r + r′); x]`, the reflection that keeps the diagonal positive,
//! scaled so that M rows of a column cost 4M + 2 operations. ρ is only ever added to: with the textbook sign
//! each block would round it anew.

use core::ops::Range;

use crate::Scalar;

/// Rows of a block: two wrenches, or the forces or moments of four.
pub const BLOCK_ROWS: usize = 12;

/// The rows of one column. After the reduction: the reflection `y, k` that it led to.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Column<T: Scalar> {
    /// The coefficients; y after the reduction.
    pub rows: [T; BLOCK_ROWS],
    k: T,
}

impl<T: Scalar> Column<T> {
    /// A column of zeros.
    pub const ZERO: Self = Self { rows: [T::ZERO; BLOCK_ROWS], k: T::ZERO };

    /// Writes the rows `3 third..3 third + 3`.
    #[inline(always)]
    pub(super) fn set_third(&mut self, third: usize, rows: [T; 3]) {
        if let Some(target) = self.rows.as_chunks_mut::<3>().0.get_mut(third) {
            *target = rows;
        }
    }
}

impl<T: Scalar> Column<T> {
    /// Writes the rows `6 half..6 half + 6`.
    #[inline(always)]
    pub(super) fn set_half(&mut self, half: usize, rows: [T; 6]) {
        if let Some(target) = self.rows.as_chunks_mut::<6>().0.get_mut(half) {
            *target = rows;
        }
    }
}

impl<T: Scalar> From<[T; BLOCK_ROWS]> for Column<T> {
    fn from(rows: [T; BLOCK_ROWS]) -> Self {
        Self { rows, k: T::ZERO }
    }
}

/// Returns `a·b − from`, summed over even and odd rows, then both: the order of two lanes, or of two
/// accumulators.
#[inline(always)]
fn dot<T: Scalar>(a: &[T; BLOCK_ROWS], b: &[T; BLOCK_ROWS], from: T) -> T {
    let (mut even, mut odd) = (a[0] * b[0], a[1] * b[1]);
    even = even + a[2] * b[2] - from;
    odd += a[3] * b[3];
    for i in (4..BLOCK_ROWS).step_by(2) {
        even += a[i] * b[i];
        odd += a[i + 1] * b[i + 1];
    }
    even + odd
}

/// Reduces the columns, the last one being the right-hand side, into `[R z]`, whose column j, of at least j +
/// 1 numbers, starts at `j stride`: those of `range` alone, when those before have been. Returned is, with
/// the last one, the sum of squares of what is left in the right-hand side. The columns are used up.
#[inline]
pub(crate) fn reduce<T: Scalar>(
    triangle: &mut [T],
    stride: usize,
    columns: &mut [Column<T>],
    range: Range<usize>,
) -> T {
    let all = columns.len();
    for (j, entries) in
        triangle.chunks_mut(stride.max(1)).enumerate().take(all.min(range.end)).skip(range.start)
    {
        reduce_column(entries, j, columns);
    }
    columns
        .last()
        .filter(|_| range.end >= all)
        .map_or(T::ZERO, |Column { rows, .. }| dot(rows, rows, T::ZERO))
}

/// Reduces the columns as [`reduce`] does, into a packed triangle: column j of `[R z]` starts at `j (j + 1) /
/// 2`.
#[inline]
pub(crate) fn reduce_packed<T: Scalar>(triangle: &mut [T], columns: &mut [Column<T>]) -> T {
    let mut rest = triangle;
    for j in 0..columns.len() {
        // The right-hand side has no diagonal, so it may be one shorter.
        let end = rest.len().min(j + 1);
        let Some((entries, later)) = core::mem::take(&mut rest).split_at_mut_checked(end) else { break };
        reduce_column(entries, j, columns);
        rest = later;
    }
    columns.last().map_or(T::ZERO, |Column { rows, .. }| dot(rows, rows, T::ZERO))
}

/// Applies the reflections of the earlier columns to column j and its entries, and makes its own, unless it
/// is the last.
#[inline(always)]
fn reduce_column<T: Scalar>(entries: &mut [T], j: usize, columns: &mut [Column<T>]) {
    let pivots = columns.len().saturating_sub(1);
    let Some((earlier, rest)) = columns.split_at_mut_checked(j) else { return };
    let Some(column) = rest.first_mut() else { return };
    let mut c = column.rows;
    let mut entries = entries.iter_mut();
    for (Column { rows: y, k }, entry) in earlier.iter().zip(&mut entries) {
        let u = dot(y, &c, *entry) * *k;
        *entry += u;
        for (c, y) in c.iter_mut().zip(y) {
            *c -= *y * u;
        }
    }
    *column = match entries.next() {
        Some(r) if j < pivots => reflection(&c, r),
        _ => Column { rows: c, k: T::ZERO },
    };
}

/// Returns y and k of the column `x`; `r` becomes r′. A column of (near) zeros reflects nothing. With one
/// division: the entries may be up to 1e8 in f32.
#[inline(always)]
fn reflection<T: Scalar>(x: &[T; BLOCK_ROWS], r: &mut T) -> Column<T> {
    let xx = dot(x, x, T::ZERO);
    // Also keeps a squared underflow from becoming 0/0.
    if xx <= T::TINY_SQUARE {
        return Column::ZERO;
    }
    let norm = (*r * *r + xx).sqrt();
    let s = *r + norm;
    let product = norm * s;
    let inverse = T::ONE / (product * xx);
    *r = norm;
    let e = product * s * inverse;
    Column { rows: x.map(|x| x * e), k: xx * xx * inverse }
}

/// Reduces as [`reduce`] does, by the kernels of the reference core: the same operations on every number, so
/// the same bits.
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub(crate) fn reduce_on_core(
    triangle: &mut [f32],
    stride: usize,
    columns: &mut [Column<f32>],
    range: Range<usize>,
) -> f32 {
    unsafe extern "C" {
        fn rigident_reduce(
            r_z: *mut f32,
            stride_bytes: usize,
            pivots: usize,
            columns: *mut Column<f32>,
        ) -> f32;
        /// Reduces with fewer instructions and more cycles: where the code no longer fits a small cache the
        /// fetch decides.
        fn rigident_reduce_large(
            r_z: *mut f32,
            stride_bytes: usize,
            pivots: usize,
            columns: *mut Column<f32>,
        ) -> f32;
        /// Reduces the columns from `first` to `end`; the number returned has a meaning if that is behind the
        /// last one.
        fn rigident_reduce_part(
            r_z: *mut f32,
            stride_bytes: usize,
            pivots: usize,
            columns: *mut Column<f32>,
            first: usize,
            end: usize,
        ) -> f32;
    }
    let pivots = columns.len().saturating_sub(1);
    if pivots == 0 || stride < pivots || triangle.len() < pivots * stride + pivots {
        return 0.0;
    }
    let (r_z, columns) = (triangle.as_mut_ptr(), columns.as_mut_ptr());
    if range.start > 0 || range.end <= pivots {
        let Range { start, end } = range;
        if start >= end || start > pivots {
            return 0.0;
        }
        // SAFETY: as below; it begins with one of these columns.
        let sum = unsafe { rigident_reduce_part(r_z, 4 * stride, pivots, columns, start, end) };
        return if end > pivots { sum } else { 0.0 };
    }
    // SAFETY: the kernels read and write the first `pivots` numbers of the columns 0..=pivots of `[R z]`, and
    // as many columns of the block, `repr(C)` of thirteen floats each. Both slices hold that, as was just
    // checked.
    unsafe {
        if pivots > 16 {
            rigident_reduce_large(r_z, 4 * stride, pivots, columns)
        } else {
            rigident_reduce(r_z, 4 * stride, pivots, columns)
        }
    }
}

/// Reduces as [`reduce_packed`] does, by the kernel of the reference core.
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub(crate) fn reduce_packed_on_core(triangle: &mut [f32], columns: &mut [Column<f32>]) -> f32 {
    unsafe extern "C" {
        fn rigident_reduce_packed(
            r_z: *mut f32,
            first_stride_bytes: usize,
            pivots: usize,
            columns: *mut Column<f32>,
        ) -> f32;
    }
    let pivots = columns.len().saturating_sub(1);
    if pivots == 0 || triangle.len() < pivots * (pivots + 1) / 2 + pivots {
        return 0.0;
    }
    // SAFETY: as above; column j starts at j (j + 1) / 2, the right-hand side's after all others, and the
    // slice holds its `pivots` numbers, as was just checked.
    unsafe { rigident_reduce_packed(triangle.as_mut_ptr(), 4, pivots, columns.as_mut_ptr()) }
}

#[cfg(all(target_arch = "arm", target_os = "none"))]
core::arch::global_asm!(include_str!("reflection_armv7em.s"), options(raw));
