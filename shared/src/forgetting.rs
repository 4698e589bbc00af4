//! Forgetting and windows over information factors, a segment at a time.
//!
//! Lives here: exponential forgetting with a guard against wind-up ([`Forgetting`]) and the sliding window
//! ([`Window`]), and which of them an estimator keeps ([`MemoryConfig`]). May not live here: the rows; a
//! segment is an ordinary factor of some tenths of a second ([`crate::factor`]).
//!
//! # Directional forgetting
//! Plain exponential forgetting, `M ← λ M + S`, halves what is known about *every* direction whether or not
//! the segment S says anything about it: when the motion stops, M decays to what noise brings and the
//! estimate wanders (wind-up). Here only what the segment renews is forgotten (Cao and Schwartz 2000; Lai and
//! Bernstein, SIFt-RLS, 2024). Let the columns of X span the directions the segment excites. M splits
//! uniquely into
//! ```text
//! M = M∥ + M⊥,   M∥ = M X (Xᵀ M X)⁻¹ Xᵀ M,   M⊥ X = 0
//! ```
//! and `M ← λ M∥ + M⊥ + S`. M⊥ is what is known about the rest when nothing is known about the excited
//! directions (the marginal), so no rest is lost; and `Xᵀ M X ← λ Xᵀ M X + Xᵀ S X`, so that X forgets exactly
//! as with plain forgetting: under constant excitation M tends to `S / (1 − λ)`.
//!
//! With `M = RᵀR` and Q an orthonormal basis of the columns of `R X`, `M∥ = Rᵀ Q Qᵀ R`; hence
//! `R ← (1 − β Q Qᵀ) R`, `z ← (1 − β Q Qᵀ) z` with `β = 1 − √λ`, and one reduction to a triangle: orthogonal
//! transformations only, no matrix is squared or inverted.
//!
//! # Single precision
//! Every segment that excites a part re-triangularises all of R, and z with it; rounding z by its own size,
//! far above the noise where the body is heavy, would move what is not renewed. The memory is therefore
//! stored about a reference φ_r, as `z − R φ_r` ([`Forgetting::recentre`]): rounding then scales with the
//! deviation from it.
//!
//! # Noise in the coefficients
//! Noise of the signals adds to M. The expectation K of that part is forgotten the same way to first order:
//! with the projection `E = X (Xᵀ M X)⁻¹ Xᵀ M` the change of M∥ is `K E + Eᵀ K − Eᵀ K E`, so that
//! `K ← λ K + (1 − λ) (1 − E)ᵀ K (1 − E) + K_S`.
//!
//! # What counts as excited
//! Sensor noise in the regressor fakes information. Let `n_j` be the root mean square of column j of the
//! whitened rows that noise alone brings ([`Forgetting::new`]). In coordinates `ψ_j = n_j √rows φ_j` a
//! segment of pure noise has singular values squared of about 1, at most `(1 + √(N / rows))²` of independent
//! rows (Marchenko and Pastur 1967). A direction is excited if its squared singular value exceeds
//! [`SIGNIFICANCE`] times that: it then holds at least three parts of signal to one of noise. What the
//! segment says about other directions is dropped, or a day of standing still would add up to a motion.

use crate::Scalar;
use crate::factor::{Gram, InformationFactor};
use crate::linear_algebra::{Jacobi, dot};

mod memory;
mod window;

/// Parameters at most that may have noise in their coefficients, or lie beside such.
const NOISY: usize = 16;

/// Parameters at most: with room for this many in every size the target decomposes all of them by the same
/// code.
const ROOM: usize = 25;

pub use memory::{ImuNoise, MemoryConfig, Span};
pub(crate) use memory::{Memory, Plan, Rows};
pub use window::Window;

/// Tells how many times the most information that noise alone brings makes a direction an excited one.
pub const SIGNIFICANCE: u32 = 4;

/// Returns the part of the memory that is retained per segment, λ, for a time constant:
/// `λ = 1 / (1 + Δt / τ)`.
///
/// The memory then holds `1 + τ / Δt` segments, and λ is the exact exponential of a time constant that is
/// longer by `Δt / 2` to first order. 1 (no forgetting) if the time constant is infinite or not a positive
/// number, or the segment has no length.
pub fn retention<T: Scalar>(segment_s: T, time_constant_s: T) -> T {
    let share = segment_s / time_constant_s;
    if share.is_finite() && share > T::ZERO { T::ONE / (T::ONE + share) } else { T::ONE }
}

/// A memory of segments that forgets what newer segments renew.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forgetting<T: Scalar, const N: usize> {
    noise: [T; N],
    /// Tells how many independent rows each row is worth.
    independence: T,
    /// φ_r
    reference: [T; N],
    /// R and `z − R φ_r`.
    memory: InformationFactor<T, N>,
    /// K
    gram: Gram<T, NOISY>,
    rows: T,
}

impl<T: Scalar, const N: usize> Forgetting<T, N> {
    /// Returns a memory of nothing. `noise[j]`: root mean square, per whitened row, of what sensor noise
    /// alone brings to the coefficients of parameter j, in 1 / unit of the parameter. Zero where the
    /// coefficients are exact (the wrench offset): the rounding level of the column replaces it.
    pub fn new(noise: [T; N]) -> Self {
        Self {
            noise,
            independence: T::ONE,
            reference: [T::ZERO; N],
            memory: InformationFactor::new(),
            gram: Gram::ZERO,
            rows: T::ZERO,
        }
    }

    /// Takes another noise per row; see [`Self::new`].
    pub(crate) fn set_noise(&mut self, noise: &[T; N]) {
        self.noise = *noise;
    }

    /// Returns what noise in the coefficients has added to what is retained.
    pub fn gram(&self) -> &Gram<T, NOISY> {
        &self.gram
    }

    /// Multiplies all rows.
    pub(crate) fn scale(&mut self, by: T) {
        self.memory.scale(by);
        self.gram.scale(by * by);
    }

    /// Adapts the memory to rows whose noise is correlated, of overlapping filters say: each is worth
    /// `independence` (0 to 1) independent ones, so that what noise alone brings spreads more.
    #[must_use]
    pub fn of_coloured_rows(self, independence: T) -> Self {
        Self { independence: if independence < T::ONE { independence } else { T::ONE }, ..self }
    }

    /// Returns the factor of everything retained. Its row count is the effective one.
    pub fn factor(&self) -> InformationFactor<T, N> {
        self.memory.about(&self.reference.map(|v| -v))
    }

    /// Keeps the memory about these parameters from now on, say the estimate after the first seconds: no
    /// change but of rounding. Not-finite parameters are not taken. Before the first call the reference is
    /// zero.
    pub fn recentre(&mut self, reference: &[T; N]) {
        if reference.iter().all(|v| v.is_finite()) {
            let change = core::array::from_fn(|j| reference[j] - self.reference[j]);
            self.memory = self.memory.about(&change);
            self.reference = *reference;
        }
    }

    /// Takes in a segment and keeps the share `lambda` (0 to 1) of what it renews. Returns how many
    /// directions it excites.
    ///
    /// With `lambda` 1 nothing is forgotten and nothing dropped: the segment is merged, to the last bit. A
    /// segment or `lambda` that is not finite is not taken.
    pub fn take(&mut self, segment: &InformationFactor<T, N>, lambda: T) -> usize {
        self.take_noisy(segment, &Gram::ZERO, lambda)
    }

    /// Takes a segment to which noise in the coefficients has added `gram`.
    pub fn take_noisy(
        &mut self,
        segment: &InformationFactor<T, N>,
        gram: &Gram<T, NOISY>,
        lambda: T,
    ) -> usize {
        if segment.rows() == 0 || !segment.is_finite() || !lambda.is_finite() {
            return 0;
        }
        let segment = &segment.about(&self.reference);
        if lambda >= T::ONE {
            self.memory.merge(segment);
            self.gram.add(gram, T::ONE);
            self.rows = T::from_u32(self.memory.rows());
            return N;
        }
        let lambda = lambda.max(T::ZERO);
        let count = T::from_u32(segment.rows());
        let edge = T::ONE + (T::from_u32(N as u32) / (count * self.independence)).sqrt();
        let least = T::from_u32(SIGNIFICANCE) * edge * edge;
        let scale = core::array::from_fn(|j| {
            let column2: T = (0..N).map(|i| segment.entry(i, j)).map(|r| r * r).sum();
            let noise = (self.noise[j] * count.sqrt()).max(T::EPSILON * column2.sqrt());
            if noise > T::ZERO { noise } else { T::ONE }
        });
        const { assert!(N <= ROOM, "no more parameters than there is room for") }
        let mut singular = Jacobi::<T, ROOM>::EMPTY;
        for (j, (column, scale)) in singular.w.iter_mut().zip(&scale).enumerate() {
            for (i, entry) in column.iter_mut().enumerate().take(N) {
                *entry = segment.entry(i, j) / *scale;
            }
        }
        singular.begin(N);
        while !singular.rotate_pairs(usize::MAX) {}
        singular.measure();
        let excited = core::array::from_fn(|k| singular.squares[k] > least);
        let number = excited.iter().filter(|e| **e).count();
        if number == 0 {
            return 0;
        }
        self.forget(&singular, &scale, &excited, lambda);
        let (mut r, mut z) = ([[T::ZERO; N]; N], [T::ZERO; N]);
        for k in (0..N).filter(|k| excited[*k]) {
            // One row per direction: s vᵀ (D φ) = uᵀ z
            let s = singular.squares[k].sqrt();
            for j in 0..N {
                r[k][j] = s * singular.v[k][j] * scale[j];
                z[k] += singular.w[k][j] * segment.z()[j] / s;
            }
        }
        let mut gram = *gram;
        if number == N {
            self.memory.merge(segment);
        } else {
            absorb_all(&mut self.memory, &r, &z);
            for k in (0..N).filter(|k| !excited[*k]) {
                let v = &singular.v[k];
                let x: [T; N] = core::array::from_fn(|j| v[j] / scale[j]);
                let s: [T; N] = core::array::from_fn(|j| v[j] * scale[j]);
                gram.project(&x, &s);
            }
        }
        self.gram.add(&gram, T::ONE);
        self.count(segment, number, lambda);
        number
    }

    /// Forgets: `M ← λ M∥ + M⊥`.
    #[inline(never)]
    fn forget(&mut self, singular: &Jacobi<T, ROOM>, scale: &[T; N], excited: &[bool; N], lambda: T) {
        let root = lambda.sqrt();
        let beta = (T::ONE - lambda) / (T::ONE + root);
        let r = self.memory.r();
        // Columns of R X, made orthonormal; where the memory knows nothing there is nothing to forget.
        let mut basis = [[T::ZERO; N]; N];
        // The same combinations of the columns of X.
        let mut sources = [[T::ZERO; N]; N];
        for k in (0..N).filter(|k| excited[*k]) {
            let mut source: [T; N] = core::array::from_fn(|j| singular.v[k][j] / scale[j]);
            let mut column: [T; N] = core::array::from_fn(|i| (i..N).map(|j| r[i][j] * source[j]).sum());
            let size = dot(&column, &column);
            // Twice is enough (Giraud, Langou and Rozložník 2005).
            for _ in 0..2 {
                for (other, its_source) in basis.iter().zip(&sources).take(k) {
                    let share = dot(other, &column);
                    for (c, o) in column.iter_mut().zip(other).chain(source.iter_mut().zip(its_source)) {
                        *c -= share * *o;
                    }
                }
            }
            let left = dot(&column, &column);
            let rounding = T::EPSILON * T::from_u32(N as u32);
            if left > rounding * rounding * size && left > T::TINY_SQUARE {
                let length = left.sqrt();
                basis[k] = column.map(|c| c / length);
                sources[k] = source.map(|c| c / length);
            }
        }
        let mut rest = self.gram;
        for (q, x) in basis.iter().zip(&sources) {
            let s: [T; N] = core::array::from_fn(|j| (0..=j).map(|i| q[i] * r[i][j]).sum());
            rest.project(x, &s);
        }
        self.gram.scale(lambda);
        self.gram.add(&rest, T::ONE - lambda);
        let (mut r, mut z) = (r, *self.memory.z());
        for q in &basis {
            for j in 0..N {
                let mut share = T::ZERO;
                for (a, row) in q.iter().zip(&r) {
                    share += *a * row[j];
                }
                for (a, row) in q.iter().zip(r.iter_mut()) {
                    row[j] -= beta * share * *a;
                }
            }
            let share = beta * dot(q, &z);
            for (a, b) in q.iter().zip(z.iter_mut()) {
                *b -= share * *a;
            }
        }
        let residual = self.memory.residual_sum_of_squares();
        self.memory = InformationFactor::EMPTY;
        absorb_all(&mut self.memory, &r, &z);
        self.memory.set_residual(residual, 0);
    }

    /// Forgets rows and residuals in proportion to the number of directions: they belong to no direction.
    fn count(&mut self, segment: &InformationFactor<T, N>, number: usize, lambda: T) {
        let share = T::from_u32(number as u32) / T::from_u32(N as u32);
        let kept = T::ONE - (T::ONE - lambda) * share;
        self.rows = kept * self.rows + share * T::from_u32(segment.rows());
        let merged = if number == N { segment.residual_sum_of_squares() } else { T::ZERO };
        let old = (self.memory.residual_sum_of_squares() - merged).max(T::ZERO);
        let residual = kept * old + share * segment.residual_sum_of_squares();
        self.memory.set_residual(residual, whole(self.rows));
    }
}

/// Returns the nearest whole number, without a conversion to integers, which is not in [`Scalar`]: it
/// saturates.
fn whole<T: Scalar>(number: T) -> u32 {
    let mut whole = 0_u32;
    for bit in (0..32).rev() {
        let candidate = whole | 1 << bit;
        if T::from_u32(candidate) <= number + T::ONE / T::from_u32(2) {
            whole = candidate;
        }
    }
    whole
}

#[inline(never)]
fn absorb_all<T: Scalar, const N: usize>(factor: &mut InformationFactor<T, N>, r: &[[T; N]; N], z: &[T; N]) {
    for (row, z) in r.iter().zip(z) {
        factor.absorb::<1>(&row.map(|v| [v]), &[*z]);
    }
}

#[cfg(test)]
mod tests;
