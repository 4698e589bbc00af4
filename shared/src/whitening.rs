//! Whitening of a wrench's six rows, whose noise is correlated from channel to channel and, where rates are
//! differentiated, in time.
//!
//! Lives here: the matrix and the low-passes that make such rows white ([`Whitening`]), and how they follow
//! from the noise ([`Design`]). May not live here: where the noise comes from ([`crate::estimator`]), what
//! absorbs the rows ([`crate::factor`]).
//!
//! Noise of the load cell and of the accelerometer is white, `Σ` per sample; that of an angular acceleration
//! rises with the frequency, `ω² S Sᵀ`. With `Σ = L Lᵀ` and the singular value decomposition
//! `L⁻¹ S = U diag(τ) Vᵀ` the channels of `T = Uᵀ L⁻¹` are independent, with spectra `1 + ω² τ²`, which a
//! low-pass of one pole of the time constant τ makes white. S has three columns, so that three channels at
//! most have a pole: they come first.

use crate::Scalar;
use crate::linear_algebra::{Jacobi, ROOM, add_scaled, dot_slices, scale};

/// Channels of a wrench.
pub const CHANNELS: usize = 6;
/// Channels that may have a low-pass.
pub const POLES: usize = 3;
/// A pole below this share of the period of the rows does nothing.
const LEAST_POLE: f32 = 0.02;
/// Pairs of columns that are rotated in one step.
const PAIRS: usize = 24;

/// Columns of six numbers.
pub type Square<T> = [[T; CHANNELS]; CHANNELS];

/// Holds what the rows of a wrench are multiplied by, and the low-pass of each channel after that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whitening<T: Scalar> {
    /// `columns[k][c]`: what row k gives to channel c.
    pub columns: Square<T>,
    /// `2 τ / T` of the first channels, T being the period of the rows; zero: none.
    pub poles: [T; POLES],
}

impl<T: Scalar> Whitening<T> {
    /// Returns the whitening of independent channels.
    pub fn diagonal(weights: &[T; CHANNELS]) -> Self {
        let mut columns = [[T::ZERO; CHANNELS]; CHANNELS];
        for (c, (column, weight)) in columns.iter_mut().zip(weights).enumerate() {
            if let Some(own) = column.get_mut(c) {
                *own = *weight;
            }
        }
        Self { columns, poles: [T::ZERO; POLES] }
    }

    /// Multiplies six rows, given as a column of them.
    #[inline(always)]
    pub fn whiten(&self, column: &[T; CHANNELS]) -> [T; CHANNELS] {
        combined(&self.columns, column)
    }

    /// Returns the factors `a`, `b` of a channel's low-pass `y ← a y + b (x + x before)`; `None` if it has
    /// none.
    #[inline(always)]
    pub fn low_pass(&self, channel: usize) -> Option<(T, T)> {
        let pole = self.poles.get(channel).copied().filter(|pole| *pole > T::ZERO)?;
        let gain = T::ONE / (pole + T::ONE);
        Some(((pole - T::ONE) * gain, gain))
    }

    /// Returns the variance after the low-pass of a channel, of noise whose autocovariance at the lags of the
    /// rows is this.
    #[inline(never)]
    pub fn gain(&self, channel: usize, autocovariance: &[T]) -> T {
        let Some((a, b)) = self.low_pass(channel) else {
            return autocovariance.first().copied().unwrap_or(T::ZERO);
        };
        // The low-pass' own autocovariance: 2 b²/(1 − a), then b² (1 + a)/(1 − a) aᵏ⁻¹.
        let two = T::from_u32(2);
        let (first, mut other) = (two * b * b / (T::ONE - a), two * b * b * (T::ONE + a) / (T::ONE - a));
        let mut sum = T::ZERO;
        for (lag, covariance) in autocovariance.iter().enumerate() {
            if lag == 0 {
                sum += first * *covariance;
                continue;
            }
            sum += other * *covariance;
            other *= a;
        }
        sum.max(T::ZERO)
    }
}

/// Returns `Σ_k columns[k] v[k]`.
#[inline(always)]
pub fn combined<T: Scalar, const K: usize>(columns: &[[T; CHANNELS]; K], v: &[T; K]) -> [T; CHANNELS] {
    let mut out = [T::ZERO; CHANNELS];
    for (k, (column, v)) in columns.iter().zip(v).enumerate() {
        for (out, t) in out.iter_mut().zip(column) {
            *out = if k == 0 { *t * *v } else { *out + *t * *v };
        }
    }
    out
}

/// Holds what the low-passes store of the rows of up to sixteen parameters and their right-hand side.
#[derive(Clone, Copy, Debug)]
pub struct LowPass<T: Scalar> {
    before: [[T; POLES]; WIDTH],
    after: [[T; POLES]; WIDTH],
    /// The next block is the first.
    begins: bool,
}

/// Parameters and right-hand side.
const WIDTH: usize = 17;

impl<T: Scalar> LowPass<T> {
    /// The filter before it is set up. All bits are zero.
    pub const UNUSED: Self =
        Self { before: [[T::ZERO; POLES]; WIDTH], after: [[T::ZERO; POLES]; WIDTH], begins: false };

    /// The filter before the first block.
    pub const NEW: Self =
        Self { before: [[T::ZERO; POLES]; WIDTH], after: [[T::ZERO; POLES]; WIDTH], begins: true };

    /// Forgets all blocks.
    pub fn reset(&mut self) {
        self.begins = true;
    }

    /// Takes the `position`th column of a block through the low-passes. The last column must be announced by
    /// [`Self::end`].
    ///
    /// The noise is `n + τ ṅ` of a white n: from zero the low-pass is off by the first n, no more.
    #[inline(always)]
    pub(crate) fn pass(&mut self, position: usize, passes: &Passes<T>, column: &mut [T; CHANNELS]) {
        let (Some(before), Some(after)) = (self.before.get_mut(position), self.after.get_mut(position))
        else {
            return;
        };
        if self.begins {
            (*before, *after) = ([column[0], column[1], column[2]], [T::ZERO; POLES]);
        }
        for ((x, (a, b)), (before, after)) in
            column.iter_mut().zip(passes.0.iter().take(passes.1)).zip(before.iter_mut().zip(after))
        {
            *after = *a * *after + *b * (*x + *before);
            *before = *x;
            *x = *after;
        }
    }

    /// Ends a block.
    #[inline(always)]
    pub(crate) fn end(&mut self) {
        self.begins = false;
    }
}

/// Factors of the low-passes, and how many there are.
pub(crate) struct Passes<T>([(T, T); POLES], usize);

impl<T: Scalar> Passes<T> {
    pub(crate) fn of(whitening: &Whitening<T>) -> Self {
        let mut passes = Self([(T::ZERO, T::ZERO); POLES], 0);
        for (channel, slot) in passes.0.iter_mut().enumerate() {
            // Without a pole after one with: what comes in goes out.
            let Some(pass) = whitening.low_pass(channel) else { break };
            (*slot, passes.1) = (pass, channel + 1);
        }
        passes
    }
}

/// A whitening that is being made, in steps of bounded size.
#[derive(Clone, Copy, Debug)]
pub struct Design<T: Scalar> {
    /// `L⁻¹`, by rows.
    inverse: Square<T>,
    jacobi: Jacobi<T, ROOM>,
}

impl<T: Scalar> Design<T> {
    /// Makes none. All bits are zero.
    pub const UNUSED: Self = Self { inverse: [[T::ZERO; CHANNELS]; CHANNELS], jacobi: Jacobi::EMPTY };

    /// Begins with the white part `Σ` of the noise, of which the lower triangle counts, by rows, and the
    /// columns S of its rising part. Returns false if Σ is not positive definite.
    #[inline(never)]
    pub fn begin(&mut self, white: &Square<T>, slope: &[[T; CHANNELS]; POLES]) -> bool {
        let mut lower = [[T::ZERO; CHANNELS]; CHANNELS];
        self.inverse = [[T::ZERO; CHANNELS]; CHANNELS];
        for (i, own) in white.iter().enumerate() {
            let (done, rest) = lower.split_at_mut(i);
            let Some(row) = rest.first_mut() else { return false };
            for (j, (other, value)) in done.iter().zip(own).enumerate() {
                let known = row.get(..j).unwrap_or_default();
                let solved = (*value - dot_slices(known, other)) / other.get(j).copied().unwrap_or(T::ONE);
                if let Some(slot) = row.get_mut(j) {
                    *slot = solved;
                }
            }
            let diagonal = own.get(i).copied().unwrap_or_default();
            let left = diagonal - dot_slices(row, row);
            if !left.is_finite() || left <= T::EPSILON * diagonal {
                return false;
            }
            let root = left.sqrt();
            let (before, rest) = self.inverse.split_at_mut(i);
            let Some(inverse) = rest.first_mut() else { return false };
            for (other, l) in before.iter().zip(row.iter()) {
                add_scaled(inverse, other, -*l / root);
            }
            if let (Some(slot), Some(one)) = (row.get_mut(i), inverse.get_mut(i)) {
                (*slot, *one) = (root, T::ONE / root);
            }
        }
        self.jacobi = Jacobi::EMPTY;
        for (w, column) in self.jacobi.w.iter_mut().zip(slope) {
            for (w, row) in w.iter_mut().zip(&self.inverse) {
                *w = dot_slices(row, column);
            }
        }
        self.jacobi.begin(CHANNELS);
        true
    }

    /// Does one step. Returns true when [`Self::finish`] may be called.
    pub fn step(&mut self) -> bool {
        self.jacobi.rotate_pairs(PAIRS)
    }

    /// Returns the whitening; a row represents `every` samples, and `period_s` is the time between two (zero:
    /// they have none).
    #[inline(never)]
    pub fn finish(&mut self, every: T, period_s: T) -> Whitening<T> {
        self.jacobi.measure();
        // Columns of U, the largest τ first; what is missing of them is any orthonormal completion.
        let (mut basis, mut poles) = ([[T::ZERO; CHANNELS]; CHANNELS], [T::ZERO; POLES]);
        let (w, squares) = (&self.jacobi.w, &mut self.jacobi.squares);
        let mut found = 0;
        for (pole, u) in poles.iter_mut().zip(&mut basis) {
            let all = squares.iter_mut().zip(w).take(POLES);
            let Some((square, w)) = all.reduce(|best, other| if *other.0 > *best.0 { other } else { best })
            else {
                break;
            };
            let tau = square.sqrt();
            *square = T::ZERO;
            let share = if period_s > T::ZERO { T::from_u32(2) * tau / period_s } else { T::ZERO };
            let reaches = share > T::from_f32(LEAST_POLE);
            if !reaches {
                break;
            }
            *pole = share;
            add_scaled(u, w, T::ONE / tau);
            found += 1;
        }
        complete(&mut basis, found);
        let root = every.sqrt();
        let mut columns = [[T::ZERO; CHANNELS]; CHANNELS];
        for (c, u) in basis.iter().enumerate() {
            let mut row = [T::ZERO; CHANNELS];
            for (u, inverse) in u.iter().zip(&self.inverse) {
                add_scaled(&mut row, inverse, *u * root);
            }
            for (column, t) in columns.iter_mut().zip(row) {
                if let Some(slot) = column.get_mut(c) {
                    *slot = t;
                }
            }
        }
        Whitening { columns, poles }
    }
}

/// Completes the first `found` orthonormal vectors to six.
fn complete<T: Scalar>(basis: &mut Square<T>, found: usize) {
    // What is left of the unit vectors.
    let mut left = [T::ONE; CHANNELS];
    for k in 0..CHANNELS {
        let (before, rest) = basis.split_at_mut(k);
        let Some(vector) = rest.first_mut() else { return };
        if k >= found {
            let mut most = (T::ZERO, 0);
            for (i, left) in left.iter().enumerate() {
                if *left > most.0 {
                    most = (*left, i);
                }
            }
            if let Some(slot) = vector.get_mut(most.1) {
                *slot = T::ONE;
            }
            // Twice is enough (Giraud, Langou and Rozložník 2005).
            for _ in 0..2 {
                for other in before.iter() {
                    let share = dot_slices(vector, other);
                    add_scaled(vector, other, -share);
                }
            }
            let length = dot_slices(vector, vector).sqrt();
            scale(vector, T::ONE / length);
        }
        for (left, a) in left.iter_mut().zip(vector.iter()) {
            *left -= *a * *a;
        }
    }
}
