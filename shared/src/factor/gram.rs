use crate::Scalar;
use crate::linear_algebra::{add_scaled, dot_slices, scale};

/// The expectation K of the Gram matrix of noise in the coefficients: what it adds to `RᵀR`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gram<T: Scalar, const N: usize> {
    /// Symmetric.
    pub columns: [[T; N]; N],
}

impl<T: Scalar, const N: usize> Gram<T, N> {
    /// The matrix of no noise.
    pub const ZERO: Self = Self { columns: [[T::ZERO; N]; N] };

    /// Adds the given multiple of another one, whose further parameters, if it has more, are left out.
    #[inline(never)]
    pub fn add<const M: usize>(&mut self, other: &Gram<T, M>, times: T) {
        for (column, other) in self.columns.iter_mut().zip(&other.columns) {
            add_scaled(column, other, times);
        }
    }

    /// Multiplies it.
    pub fn scale(&mut self, by: T) {
        scale(self.columns.as_flattened_mut(), by);
    }

    /// Takes the upper triangle by rows, as far as there are numbers.
    #[inline(never)]
    pub fn fill(&mut self, entries: impl IntoIterator<Item = T>) {
        let mut entries = entries.into_iter();
        for i in 0..N {
            for column in self.columns.iter_mut().skip(i) {
                if let (Some(slot), Some(entry)) = (column.get_mut(i), entries.next()) {
                    *slot = entry;
                }
            }
        }
        self.mirror();
    }

    /// Returns row `i` from the diagonal on.
    pub fn row(&self, i: usize) -> impl Iterator<Item = T> + '_ {
        self.columns.iter().skip(i).filter_map(move |column| column.get(i).copied())
    }

    /// Copies what is above the diagonal below it.
    #[inline(never)]
    pub(crate) fn mirror(&mut self) {
        for j in 0..N {
            let (before, rest) = self.columns.split_at_mut(j);
            let Some(column) = rest.first() else { return };
            for (other, entry) in before.iter_mut().zip(column) {
                if let Some(slot) = other.get_mut(j) {
                    *slot = *entry;
                }
            }
        }
    }

    /// Replaces it by `FᵀKF` with `F = 1 − x sᵀ`; numbers of x and s beyond its parameters are not examined.
    #[inline(never)]
    pub(crate) fn project(&mut self, x: &[T], s: &[T]) {
        let mut v = [T::ZERO; N];
        for (v, column) in v.iter_mut().zip(&self.columns) {
            *v = dot_slices(column, x);
        }
        let c = dot_slices(&v, x);
        for ((column, sj), vj) in self.columns.iter_mut().zip(s).zip(&v) {
            add_scaled(column, s, c * *sj - *vj);
            add_scaled(column, &v, -*sj);
        }
    }
}
