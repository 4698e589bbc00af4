//! The reduction of rows into a triangle, the later columns of a reflection side by side.
//!
//! The operations on every number are those of [`rigident_shared::factor`], in their order, so that the bits
//! are the same; there a column meets all earlier reflections one after the other, here a reflection meets
//! all later columns at once, four to a register.

use rigident_shared::Scalar as _;
use rigident_shared::factor::BLOCK_ROWS;

/// Columns side by side.
const LANES: usize = 4;

type Lanes = [f64; LANES];

/// `[R z]` by rows, and the rows that wait until they are a block.
pub(super) struct Reduction {
    pivots: usize,
    /// Registers of a row.
    wide: usize,
    triangle: Vec<Lanes>,
    rows: Vec<Lanes>,
    waiting: usize,
    residual_sum_of_squares: f64,
}

impl Reduction {
    /// Returns the reduction into a triangle of `columns` columns of `pivots` numbers each: as many, or with
    /// a right-hand side one more.
    pub(super) fn new(triangle: &[f64], pivots: usize, columns: usize) -> Self {
        let wide = columns.div_ceil(LANES);
        let mut own = Self {
            pivots,
            wide,
            triangle: vec![[0.0; LANES]; pivots * wide],
            rows: vec![[0.0; LANES]; BLOCK_ROWS * wide],
            waiting: 0,
            residual_sum_of_squares: 0.0,
        };
        let numbers = own.triangle.as_flattened_mut();
        for (j, column) in triangle.chunks_exact(pivots.max(1)).enumerate() {
            for (i, entry) in column.iter().enumerate().take(j + 1) {
                numbers[i * wide * LANES + j] = *entry;
            }
        }
        own
    }

    /// Begins with the sum of squares that was left before.
    pub(super) fn start(&mut self, residual_sum_of_squares: f64) {
        self.residual_sum_of_squares = residual_sum_of_squares;
    }

    /// Takes a row and its right-hand side, if there is one.
    pub(super) fn push(&mut self, row: &[f64], value: f64) {
        let room = self.wide * LANES;
        let count = row.len().min(self.pivots);
        if let Some(to) = self.rows.as_flattened_mut().get_mut(self.waiting * room..(self.waiting + 1) * room)
        {
            to[..count].copy_from_slice(&row[..count]);
            // Where there is no right-hand side this is room that is not examined.
            to.iter_mut().skip(self.pivots).take(1).for_each(|to| *to = value);
        }
        self.waiting += 1;
        if self.waiting == BLOCK_ROWS {
            self.reduce();
        }
    }

    /// Reduces the rows that wait, beside rows of zeros.
    pub(super) fn settle(&mut self) {
        if self.waiting > 0 {
            self.reduce();
        }
    }

    fn reduce(&mut self) {
        reduce(&mut self.triangle, self.wide, self.pivots, &mut self.rows);
        let (place, lane) = (self.pivots / LANES, self.pivots % LANES);
        if place < self.wide {
            let left = column(&self.rows, self.wide, place, lane);
            self.residual_sum_of_squares += sum_of_squares(&left);
        }
        self.rows.fill([0.0; LANES]);
        self.waiting = 0;
    }

    /// Writes the triangle back by columns, and returns the sum of squares that was left in the right-hand
    /// side.
    pub(super) fn write(mut self, triangle: &mut [f64]) -> f64 {
        self.settle();
        let room = self.wide * LANES;
        let numbers = self.triangle.as_flattened();
        for (j, column) in triangle.chunks_exact_mut(self.pivots.max(1)).enumerate() {
            for (i, entry) in column.iter_mut().enumerate().take(j + 1) {
                *entry = numbers[i * room + j];
            }
        }
        self.residual_sum_of_squares
    }
}

/// Returns a column of a block.
#[inline(always)]
fn column(rows: &[Lanes], wide: usize, place: usize, lane: usize) -> [f64; BLOCK_ROWS] {
    std::array::from_fn(|row| rows[row * wide + place][lane])
}

/// Returns the sum of squares over even and odd rows, then both.
#[inline(always)]
fn sum_of_squares(x: &[f64; BLOCK_ROWS]) -> f64 {
    let (mut even, mut odd) = (x[0] * x[0], x[1] * x[1]);
    for i in (2..BLOCK_ROWS).step_by(2) {
        even += x[i] * x[i];
        odd += x[i + 1] * x[i + 1];
    }
    even + odd
}

/// Returns y and k of the reflection of the column `x`; `r` becomes r′. A column of (near) zeros reflects
/// nothing.
#[inline(always)]
fn reflection(x: &[f64; BLOCK_ROWS], r: &mut f64) -> ([f64; BLOCK_ROWS], f64) {
    let xx = sum_of_squares(x);
    if xx <= f64::TINY_SQUARE {
        return ([0.0; BLOCK_ROWS], 0.0);
    }
    let norm = (*r * *r + xx).sqrt();
    let s = *r + norm;
    let product = norm * s;
    let inverse = 1.0 / (product * xx);
    *r = norm;
    let e = product * s * inverse;
    (x.map(|x| x * e), xx * xx * inverse)
}

/// Reduces a block of rows into the triangle.
#[inline(always)]
fn reduce_lanes(triangle: &mut [Lanes], wide: usize, pivots: usize, rows: &mut [Lanes]) {
    for (j, entries) in triangle.chunks_exact_mut(wide.max(1)).enumerate().take(pivots) {
        let (place, lane) = (j / LANES, j % LANES);
        let mut r = entries[place][lane];
        let (y, k) = reflection(&column(rows, wide, place, lane), &mut r);
        // A column of zeros reflects nothing: most of those of a triangle that is merged.
        if k == 0.0 {
            entries[place][lane] = r;
            continue;
        }
        // Columns before the next one are used up, and are not read again.
        for at in (j + 1) / LANES..wide {
            let mut c: [Lanes; BLOCK_ROWS] = std::array::from_fn(|row| rows[row * wide + at]);
            let entry = &mut entries[at];
            let mut u = [0.0; LANES];
            for l in 0..LANES {
                let (mut even, mut odd) = (y[0] * c[0][l], y[1] * c[1][l]);
                even = even + y[2] * c[2][l] - entry[l];
                odd += y[3] * c[3][l];
                for i in (4..BLOCK_ROWS).step_by(2) {
                    even += y[i] * c[i][l];
                    odd += y[i + 1] * c[i + 1][l];
                }
                u[l] = (even + odd) * k;
            }
            for l in 0..LANES {
                entry[l] += u[l];
            }
            for (row, (c, y)) in c.iter_mut().zip(&y).enumerate() {
                for l in 0..LANES {
                    c[l] -= *y * u[l];
                }
                rows[row * wide + at] = *c;
            }
        }
        entries[place][lane] = r;
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn reduce_avx2(triangle: &mut [Lanes], wide: usize, pivots: usize, rows: &mut [Lanes]) {
    reduce_lanes(triangle, wide, pivots, rows);
}

/// Reduces a block of rows with the widest registers that there are for four columns: the same operations.
fn reduce(triangle: &mut [Lanes], wide: usize, pivots: usize, rows: &mut [Lanes]) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the instructions that the function is compiled for, as was just asked.
        return unsafe { reduce_avx2(triangle, wide, pivots, rows) };
    }
    reduce_lanes(triangle, wide, pivots, rows);
}

#[cfg(test)]
mod tests {
    use rigident_shared::factor::Column;

    use super::*;

    /// Rows with columns of zeros and of next to nothing, in blocks that are not all full.
    #[test]
    fn rows_are_reduced_to_the_bits_of_the_firmware_s_kernel() {
        let mut state = 11_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for n in [1, 3, 4, 7, 10, 16, 36, 63] {
            let mut row = |j: usize| match j % 9 {
                5 => 0.0,
                7 => 1e-90 * next(),
                _ => next() * 10_f64.powi(j as i32 % 5),
            };
            let rows: Vec<Vec<f64>> = (0..101).map(|_| (0..=n).map(&mut row).collect()).collect();
            let mut triangle = vec![0.0; n * (n + 1)];
            let mut own = triangle.clone();
            let (mut left, mut own_left) = (0.0, 0.0);
            for some in rows.chunks(31) {
                for block in some.chunks(BLOCK_ROWS) {
                    let mut columns = vec![Column::<f64>::ZERO; n + 1];
                    for (i, row) in block.iter().enumerate() {
                        columns.iter_mut().zip(row).for_each(|(column, v)| column.rows[i] = *v);
                    }
                    left += f64::reduce(&mut triangle, n, &mut columns);
                }
                let mut reduction = Reduction::new(&own, n, n + 1);
                reduction.start(own_left);
                some.iter().for_each(|row| reduction.push(&row[..n], row[n]));
                own_left = reduction.write(&mut own);
            }
            let bits = |all: &[f64]| all.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            assert_eq!((bits(&own), own_left.to_bits()), (bits(&triangle), left.to_bits()), "{n}");
        }
    }
}
