//! The information factor: everything rows `A φ = y ± σ` say about φ, in fixed size.
//!
//! Lives here: absorbing row blocks by orthogonal reduction ([`InformationFactor`]), the cascade that keeps
//! `f32` from stagnating ([`Cascade`]), and what can be read off the triangle ([`Solution`]). May not live
//! here: where rows come from. Before this: [`crate::conditioning`]; after it: [`crate::estimator`].
//!
//! After any number of rows, `[R z; 0 ρ]` is the triangular factor of the stacked `[A y]`: recursive least
//! squares in its square-root information form. It needs no prior, survives rank deficiency, loses digits
//! with cond(A) and not with its square, and two factors merge by stacking them and reducing again.

mod cascade;
mod marginal;
mod solution;

pub use cascade::Cascade;
pub use solution::{Solution, condition_number};

use crate::Scalar;

/// `R`, `z`, the residual sum of squares and the row count of all rows seen.
///
/// Rows are expected whitened (divided by their σ), so that `(RᵀR)⁻¹` is a covariance. The diagonal of R is
/// never negative. Columns are stored in the order of the parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InformationFactor<T: Scalar, const N: usize> {
    /// Upper triangle, row-major; entries below the diagonal are zero.
    r: [[T; N]; N],
    z: [T; N],
    residual_sum_of_squares: T,
    rows: u32,
}

impl<T: Scalar, const N: usize> Default for InformationFactor<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar, const N: usize> InformationFactor<T, N> {
    /// How many numbers [`Self::entries`] yields: the triangle, z and the residual sum of squares.
    pub const ENTRIES: usize = N * (N + 3) / 2 + 1;

    /// The factor of no rows.
    #[must_use]
    pub fn new() -> Self {
        Self { r: [[T::ZERO; N]; N], z: [T::ZERO; N], residual_sum_of_squares: T::ZERO, rows: 0 }
    }

    /// The triangle R, row-major, zero below the diagonal.
    pub fn r(&self) -> &[[T; N]; N] {
        &self.r
    }

    /// The projected right-hand side.
    pub fn z(&self) -> &[T; N] {
        &self.z
    }

    /// Sum of squares that no φ can explain.
    pub fn residual_sum_of_squares(&self) -> T {
        self.residual_sum_of_squares
    }

    /// Scalar rows absorbed.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Absorbs M rows, given by columns: `columns[j][i]` is row i's coefficient of parameter j.
    ///
    /// Householder reflections, one per column, `R_jj ← +√(R_jj² + |x|²)`. The reflection that keeps the
    /// diagonal positive takes a difference for its first component, here as `−|x|²/(r + r′)`, which loses no
    /// digits; with the textbook sign each absorption would flip R and round every entry anew.
    /// Not-finite rows must be kept out by the caller ([`crate::screening`]).
    #[inline]
    pub fn absorb<const M: usize>(&mut self, columns: &mut [[T; M]; N], rhs: &mut [T; M]) {
        self.reduce::<M>(0, columns, rhs);
        self.rows = self.rows.saturating_add(M as u32);
    }

    #[inline]
    fn reduce<const M: usize>(&mut self, first: usize, columns: &mut [[T; M]; N], rhs: &mut [T; M]) {
        for j in first..N {
            let (done, rest) = columns.split_at_mut(j + 1);
            let Some(x) = done.last() else { return };
            let x = *x;
            let mut xx = T::ZERO;
            for v in x {
                xx += v * v;
            }
            // Also keeps a squared underflow from becoming 0/0.
            if xx <= T::TINY_SQUARE {
                continue;
            }
            let row = &mut self.r[j];
            let r = row[j];
            let norm = (r * r + xx).sqrt();
            let first_component = -(xx / (r + norm));
            // H = 1 − τ v vᵀ, v = [first_component; x], τ = (r + r′) / (r′ |x|²)
            let tau = (r + norm) / (norm * xx);
            row[j] = norm;
            for (entry, column) in row[j + 1..].iter_mut().zip(rest) {
                reflect(entry, column, first_component, tau, &x);
            }
            reflect(&mut self.z[j], rhs, first_component, tau, &x);
        }
        for y in rhs {
            self.residual_sum_of_squares += *y * *y;
        }
    }

    /// Merges another factor of the same parameters: the factor of both sets of rows.
    pub fn merge(&mut self, other: &Self) {
        for j in 0..N {
            let mut columns = other.r[j].map(|v| [v]);
            self.reduce::<1>(j, &mut columns, &mut [other.z[j]]);
        }
        self.residual_sum_of_squares += other.residual_sum_of_squares;
        self.rows = self.rows.saturating_add(other.rows);
    }

    /// Rows of the upper triangle one after the other, then z, then the residual sum of squares.
    pub fn entries(&self) -> impl Iterator<Item = T> + '_ {
        self.r
            .iter()
            .enumerate()
            .flat_map(|(j, row)| row.iter().skip(j))
            .chain(&self.z)
            .chain(core::iter::once(&self.residual_sum_of_squares))
            .copied()
    }

    /// The inverse of [`Self::entries`]. `None` if there are not [`Self::ENTRIES`] finite numbers, a diagonal
    /// entry or the residual sum is negative.
    pub fn from_entries(entries: impl IntoIterator<Item = T>, rows: u32) -> Option<Self> {
        let mut factor = Self::new();
        let mut entries = entries.into_iter();
        for (j, row) in factor.r.iter_mut().enumerate() {
            for (k, v) in row.iter_mut().enumerate().skip(j) {
                *v = entries.next()?;
                if !v.is_finite() || (k == j && *v < T::ZERO) {
                    return None;
                }
            }
        }
        for v in &mut factor.z {
            *v = entries.next().filter(|v| v.is_finite())?;
        }
        factor.residual_sum_of_squares = entries.next().filter(|v| v.is_finite() && *v >= T::ZERO)?;
        factor.rows = rows;
        entries.next().is_none().then_some(factor)
    }

    /// The same factor in another scalar.
    pub fn cast<U: Scalar>(&self, convert: impl Fn(T) -> U) -> InformationFactor<U, N> {
        InformationFactor {
            r: self.r.map(|row| row.map(&convert)),
            z: self.z.map(&convert),
            residual_sum_of_squares: convert(self.residual_sum_of_squares),
            rows: self.rows,
        }
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.entries().all(Scalar::is_finite)
    }

    /// Covariance `(RᵀR)⁻¹`; entries of parameters that [`Solution::determined`] denies are meaningless.
    pub fn covariance(&self) -> [[T; N]; N] {
        solution::covariance(self)
    }

    /// Estimate, standard deviations, what is determined, and the condition number.
    pub fn solve(&self) -> Solution<T, N> {
        Solution::of(self)
    }
}

/// Applies the reflection `1 − τ v vᵀ`, `v = [v0; x]`, to the stacked `[entry; column]`.
#[inline(always)]
fn reflect<T: Scalar, const M: usize>(entry: &mut T, column: &mut [T; M], v0: T, tau: T, x: &[T; M]) {
    let mut dot = v0 * *entry;
    for (a, b) in x.iter().zip(column.iter()) {
        dot += *a * *b;
    }
    let scaled = tau * dot;
    *entry -= scaled * v0;
    for (a, b) in x.iter().zip(column) {
        *b -= scaled * *a;
    }
}

#[cfg(test)]
mod tests;
