//! The physically consistent parameters nearest to what the rows say.
//!
//! Lives here: the projection of a factor's answer onto the cone of bodies, from the factor alone. May not
//! live here: the rows, the free answer's uncertainty ([`crate::factor`]), the parameters' meaning
//! ([`crate::inertia`]).
//!
//! # The problem
//! `min ‖R φ − z‖²` subject to `K(φ) ⪰ 0`. `K` is the pseudo-inertia with a little taken off, so that the
//! answer is strictly inside the cone and stays there when it is rounded:
//! `K = [[Σ − ε tr(Σ) 1, mc], [mcᵀ, m]]`, `ε = `[`FLOOR`]` = 2⁻¹⁷`. About the centre of mass this says
//! `Σ_c ⪰ ε tr(Σ) 1`: no direction holds less than 8 millionths of the body's second moment (a rod whose
//! rms thickness is 1/360 of its length), which is 64 units in the last place of an `f32`. K is linear in φ
//! and the same in rotated axes; in a shifted origin only the size of the floor changes.
//!
//! # The method
//! Primal–dual interior point with Nesterov–Todd scaling (Nesterov and Todd 1997; Todd, Toh and Tütüncü
//! 1998), written so that everything stays in square-root form. With multiplier Λ the conditions of
//! optimality are `RᵀR(φ − φ₀) = K*(Λ)`, `K Λ = 0`, `K, Λ ⪰ 0`, where φ₀ is the free answer. A scaling G
//! makes both equal and diagonal, `G⁻¹ K G⁻ᵀ = Gᵀ Λ G = diag(s)`; Newton's step towards `K Λ = μ 1` is then
//! the least-squares problem
//! ```text
//! ‖ R d − R (φ₀ − φ) ‖² + ‖ G⁻¹ K(d) G⁻ᵀ − diag(μ / s) ‖²
//! ```
//! ten rows more for the triangle, taken in by the same orthogonal reduction as any other rows, with
//! Mehrotra's second-order correction (1992). G is carried along by multiplication and Λ is never formed, so
//! that `f32` keeps its digits where K is nearly singular; φ is read off `K = G diag(s) Gᵀ`, a sum of
//! squares. Every iterate is inside the cone; the duality gap bounds how far it is from the optimum:
//! `½‖R(φ − φ*)‖² ≤ tr(K Λ)`. The iteration ends when that distance is below `√ε_T · max(32, 4·distance)`
//! standard deviations (f32: 0.011 or 0.14 % of the distance).
//!
//! Log-Cholesky coordinates (Rucker and Wensing 2022) describe the same cone, but need `exp`, which is not
//! the same bits everywhere, and converge slowly where the optimum is on the boundary — the only case of
//! interest here.

use crate::Scalar;
use crate::factor::InformationFactor;

mod interior_point;
mod symmetric;

use interior_point::InteriorPoint;
use symmetric::{Sym4, cholesky, eigen};

/// Least share of `tr(Σ)` that `Σ_c` keeps in every direction: 2⁻¹⁷.
pub const FLOOR: f64 = 1.0 / 131_072.0;

/// A bound of iterations that suffices in `f32` for factors that `f32` can hold: 7 to 9 are usual, 14 the
/// most in the tests.
pub const ITERATIONS: u8 = 20;

/// Tells what the cone leaves of the free answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Nearest<T: Scalar, const N: usize> {
    /// The free answer is physically consistent; nothing is to be changed.
    Free,
    /// The free answer is not; these parameters are, and explain the rows best.
    Projected(Consistent<T, N>),
    /// These parameters are consistent, but the iteration bound was met before they were the best ones.
    NotConverged(Consistent<T, N>),
    /// The rows do not determine the parameters (or are not finite), so that nothing is nearest.
    NotDetermined,
}

/// Physically consistent parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consistent<T: Scalar, const N: usize> {
    /// φ, and the wrench offset that goes with it if N = 16. Units of
    /// [`PARAMETER_UNITS`](crate::inertia::PARAMETER_UNITS).
    pub parameters: [T; N],
    /// Tells how far the free answer is outside: `√(‖Rφ − z‖² − ‖Rφ₀ − z‖²)`, in standard deviations if the
    /// rows were whitened. Noise alone seldom makes it larger than 3.
    pub distance_sd: T,
    /// Newton steps taken.
    pub iterations: u8,
}

impl<T: Scalar, const N: usize> Nearest<T, N> {
    /// Returns the consistent parameters, given the free ones. `None` where nothing is determined.
    pub fn parameters(&self, free: &[T; N]) -> Option<[T; N]> {
        match self {
            Self::Free => Some(*free),
            Self::Projected(found) | Self::NotConverged(found) => Some(found.parameters),
            Self::NotDetermined => None,
        }
    }

    /// Returns how far the free answer is outside the cone, standard deviations; zero if it is not.
    pub fn distance_sd(&self) -> Option<T> {
        match self {
            Self::Free => Some(T::ZERO),
            Self::Projected(found) | Self::NotConverged(found) => Some(found.distance_sd),
            Self::NotDetermined => None,
        }
    }
}

/// Returns whether `K(φ) ≻ 0`: consistent with the margin of [`FLOOR`]. φ as in
/// [`crate::inertia::PARAMETER_NAMES`].
pub fn is_consistent_with_margin<T: Scalar>(phi: &[T; 10]) -> bool {
    cholesky(&cone(phi, share())).is_some()
}

/// Returns the free answer `R⁻¹ z` by back-substitution, far cheaper than [`InformationFactor::solve`].
/// `None` if a diagonal entry is at the rounding level of its column: the rows do not determine every
/// parameter.
pub fn free_answer<T: Scalar, const N: usize>(factor: &InformationFactor<T, N>) -> Option<[T; N]> {
    determined(factor, N).then(|| back_substitute(&factor.r(), factor.z()))?
}

/// Returns the physically consistent parameters nearest to the free answer `free` in the metric of the
/// factor.
///
/// `N` is 10 or 16 (with the wrench offset, which is unconstrained and follows). `free` is the factor's own
/// least-squares estimate ([`free_answer`] or [`InformationFactor::solve`]); it is judged as it is given, so
/// that
/// [`Nearest::Free`] speaks of the very numbers that are reported. [`ITERATIONS`] is enough for
/// `max_iterations`; one costs some 28 000 scalar instructions (counted on x86-64). [`Search`] does it in
/// steps.
#[must_use]
pub fn nearest<T: Scalar, const N: usize>(
    factor: &InformationFactor<T, N>,
    free: &[T; N],
    max_iterations: u8,
) -> Nearest<T, N> {
    let mut search = Search::UNUSED;
    search.load(factor);
    search.begin(free, max_iterations);
    while !search.step() {}
    search.nearest()
}

/// Tells what a search does next, or has found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Nothing is determined, or nothing begun. The tag is 0: a search that is not begun is all zero bits.
    NotDetermined,
    /// Turns this row of the factor, so that the offsets come first.
    Turn(u8),
    /// Searches for a body to start with.
    Start,
    /// Goes to the optimum.
    Iterate,
    /// The free answer is consistent.
    Free,
    /// The nearest body is found.
    Projected,
    /// A body is found that is not the nearest.
    NotConverged,
}

/// The search for the nearest consistent parameters in steps of bounded size, for where one sample must not
/// pay for all of it: [`Self::load`], [`Self::begin`], then [`Self::step`] until it is done. [`nearest`] does
/// the same in one go.
#[derive(Clone, Copy, Debug)]
pub struct Search<T: Scalar> {
    phase: Phase,
    offsets: u8,
    max_iterations: u8,
    iterations: u8,
    distance_sd: T,
    parameters: [T; WITH_OFFSET],
    /// The factor as it is given.
    given: InformationFactor<T, WITH_OFFSET>,
    /// The factor with the offsets first.
    turned: InformationFactor<T, WITH_OFFSET>,
    body: InformationFactor<T, 10>,
    interior_point: InteriorPoint<T>,
}

/// Parameters of a body and of the wrench offset.
const WITH_OFFSET: usize = 16;

impl<T: Scalar> Search<T> {
    /// Searches nothing yet.
    pub const UNUSED: Self = Self {
        phase: Phase::NotDetermined,
        offsets: 0,
        max_iterations: 0,
        iterations: 0,
        distance_sd: T::ZERO,
        parameters: [T::ZERO; WITH_OFFSET],
        given: InformationFactor::EMPTY,
        turned: InformationFactor::EMPTY,
        body: InformationFactor::EMPTY,
        interior_point: InteriorPoint::UNUSED,
    };

    /// Keeps a copy of the factor.
    pub fn load<const N: usize>(&mut self, factor: &InformationFactor<T, N>) {
        const { assert!(N == 10 || N == WITH_OFFSET, "ten parameters, or sixteen with the offset") }
        self.offsets = (N - 10) as u8;
        self.given = factor.resized();
    }

    /// Begins with the free answer of the factor; see [`nearest`].
    pub fn begin(&mut self, free: &[T], max_iterations: u8) {
        let n = 10 + usize::from(self.offsets);
        self.max_iterations = max_iterations;
        for (to, from) in self.parameters.iter_mut().zip(free) {
            *to = *from;
        }
        self.phase = if !free.iter().take(n).all(|v| v.is_finite()) || !determined(&self.given, n) {
            Phase::NotDetermined
        } else if is_consistent_with_margin(&self.free()) {
            Phase::Free
        } else if self.offsets == 0 {
            self.body = self.given.resized();
            Phase::Start
        } else {
            self.turned = InformationFactor::EMPTY;
            Phase::Turn(0)
        };
    }

    /// Returns the ten parameters of the body in the free answer.
    fn free(&self) -> [T; 10] {
        core::array::from_fn(|j| self.parameters[j])
    }

    /// Does one step. Returns true when the search is over.
    pub fn step(&mut self) -> bool {
        self.phase = match self.phase {
            Phase::Turn(row) => self.turn(row),
            Phase::Start => self.start(),
            Phase::Iterate if self.interior_point.step() => self.conclude(),
            phase => phase,
        };
        !matches!(self.phase, Phase::Turn(_) | Phase::Start | Phase::Iterate)
    }

    /// Moves the parameters after the tenth to the front, where they can be eliminated.
    fn turn(&mut self, row: u8) -> Phase {
        let i = usize::from(row);
        let Some(z) = self.given.z().get(i) else {
            self.body = self.turned.trailing();
            return Phase::Start;
        };
        let columns = core::array::from_fn(|j| [self.given.entry(i, (j + 10) % WITH_OFFSET)]);
        self.turned.absorb::<1>(&columns, &[*z]);
        Phase::Turn(row + 1)
    }

    fn start(&mut self) -> Phase {
        let free = self.free();
        let Some(start) = start(&free, &self.body) else { return Phase::NotDetermined };
        self.interior_point.begin(&self.body.r(), &free, &start, self.max_iterations);
        Phase::Iterate
    }

    fn conclude(&mut self) -> Phase {
        let (found, iterations, converged) = self.interior_point.found();
        let (found, free) = (*found, self.free());
        self.iterations = iterations;
        let change: [T; 10] = core::array::from_fn(|j| found[j] - free[j]);
        self.parameters[..10].copy_from_slice(&found);
        if self.offsets > 0 {
            follow(&self.turned, &change, &mut self.parameters);
        }
        self.distance_sd = norm(&times(&self.body.r(), &change));
        let all_finite = self.parameters.iter().take(10 + usize::from(self.offsets)).all(|v| v.is_finite());
        if !all_finite || cholesky(&cone(&found, half())).is_none() {
            return Phase::NotDetermined;
        }
        if converged { Phase::Projected } else { Phase::NotConverged }
    }

    /// Returns what was found, about as many parameters as there were.
    pub fn nearest<const N: usize>(&self) -> Nearest<T, N> {
        let found = || Consistent {
            parameters: core::array::from_fn(|j| self.parameters.get(j).copied().unwrap_or_default()),
            distance_sd: self.distance_sd,
            iterations: self.iterations,
        };
        match self.phase {
            Phase::Free => Nearest::Free,
            Phase::Projected => Nearest::Projected(found()),
            Phase::NotConverged => Nearest::NotConverged(found()),
            _ => Nearest::NotDetermined,
        }
    }
}

fn half<T: Scalar>() -> T {
    T::ONE / T::from_u32(2)
}

/// Returns the h for which `Σ − ε tr(Σ) 1 = h tr(I) 1 − I`.
fn share<T: Scalar>() -> T {
    half::<T>() * (T::ONE - T::from_f64_const(FLOOR))
}

/// Returns `[[h tr(I) 1 − I, mc], [mcᵀ, m]]`: K(φ), and the pseudo-inertia for h = ½.
fn cone<T: Scalar>(phi: &[T; 10], h: T) -> Sym4<T> {
    let [m, x, y, z, xx, yy, zz, yz, zx, xy] = *phi;
    let t = h * (xx + yy + zz);
    [[t - xx, -xy, -zx, x], [-xy, t - yy, -yz, y], [-zx, -yz, t - zz, z], [x, y, z, m]]
}

/// Returns true if no diagonal entry of the first `n` is at the rounding level of its column.
fn determined<T: Scalar, const N: usize>(factor: &InformationFactor<T, N>, n: usize) -> bool {
    let share = T::EPSILON * T::from_u32(n as u32);
    (0..n).all(|j| {
        let norm2: T = (0..n).map(|i| factor.entry(i, j)).map(|r| r * r).sum();
        let diagonal = factor.entry(j, j);
        norm2.is_finite() && norm2 > T::TINY_SQUARE && diagonal > share * norm2.sqrt()
    })
}

fn back_substitute<T: Scalar, const N: usize>(r: &[[T; N]; N], z: &[T; N]) -> Option<[T; N]> {
    let mut x = *z;
    for i in (0..N).rev() {
        let mut rest = x[i];
        for j in i + 1..N {
            rest -= r[i][j] * x[j];
        }
        x[i] = rest / r[i][i];
    }
    x.iter().all(|v| v.is_finite()).then_some(x)
}

fn times<T: Scalar, const N: usize>(r: &[[T; N]; N], x: &[T; N]) -> [T; N] {
    core::array::from_fn(|i| {
        let mut sum = T::ZERO;
        for j in i..N {
            sum += r[i][j] * x[j];
        }
        sum
    })
}

fn norm<T: Scalar, const N: usize>(x: &[T; N]) -> T {
    x.iter().map(|v| *v * *v).sum::<T>().sqrt()
}

/// Moves the offsets along with a change of the body: `R_bb Δb = −R_bφ Δφ`, rows of the turned factor.
fn follow<T: Scalar>(
    turned: &InformationFactor<T, WITH_OFFSET>,
    change: &[T; 10],
    parameters: &mut [T; WITH_OFFSET],
) {
    const OFFSETS: usize = WITH_OFFSET - 10;
    let rows = turned.r();
    let mut shift = [T::ZERO; OFFSETS];
    for i in (0..OFFSETS).rev() {
        let row = &rows[i];
        let mut rest = T::ZERO;
        for (r, d) in row[OFFSETS..].iter().zip(change) {
            rest -= *r * *d;
        }
        for j in i + 1..OFFSETS {
            rest -= row[j] * shift[j];
        }
        shift[i] = rest / row[i];
        parameters[10 + i] += shift[i];
    }
}

/// Returns a body well inside the cone near φ: principal second moments about the centre of mass lifted to at
/// least the size of the least one. Where φ has no such body (mass not positive) a ball of the size of its
/// numbers.
fn start<T: Scalar>(phi: &[T; 10], body: &InformationFactor<T, 10>) -> Option<[T; 10]> {
    let [m, x, y, z, ..] = *phi;
    let c = [x / m, y / m, z / m];
    let sigma = cone(phi, half());
    let central: [[T; 3]; 3] =
        core::array::from_fn(|i| core::array::from_fn(|j| sigma[i][j] - m * c[i] * c[j]));
    let (moments, axes) = eigen(&central);
    let mut least = T::ZERO;
    let mut most = T::ZERO;
    for s in moments {
        least = least.max(-s);
        most = most.max(s);
    }
    let about_origin = sigma[0][0] + sigma[1][1] + sigma[2][2];
    let four_floors = T::from_f64_const(4.0 * FLOOR) * about_origin.abs();
    let least = least.max(most * T::from_f64_const(1e-3)).max(four_floors);
    let mut inside = sigma;
    for i in 0..3 {
        for j in 0..3 {
            inside[i][j] = m * c[i] * c[j];
            for (s, axis) in moments.iter().zip(&axes) {
                inside[i][j] += s.max(least) * axis[i] * axis[j];
            }
        }
    }
    let near = from_cone(&inside);
    if m > T::ZERO && is_consistent_with_margin(&near) {
        return Some(near);
    }
    let scale = |j: usize| T::ONE / norm(&body.r().map(|row| row[j]));
    let moment = phi[4..].iter().fold(scale(4), |most, v| most.max(v.abs()));
    let mut ball = [T::ZERO; 10];
    ball[0] = m.abs() + scale(0);
    ball[4..7].fill(moment);
    is_consistent_with_margin(&ball).then_some(ball)
}

/// Returns φ of a pseudo-inertia: `I = tr(Σ) 1 − Σ`.
fn from_cone<T: Scalar>(j: &Sym4<T>) -> [T; 10] {
    let (a, b, c) = (j[0][0], j[1][1], j[2][2]);
    [j[3][3], j[0][3], j[1][3], j[2][3], b + c, c + a, a + b, -j[1][2], -j[2][0], -j[0][1]]
}

#[cfg(test)]
mod tests;
