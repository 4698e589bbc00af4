use super::InformationFactor;
use crate::Scalar;
use crate::linear_algebra::{Jacobi, dot};

/// Holds what a factor says about φ.
///
/// Read from the singular values of R with its columns scaled to unit length, so that units do not matter.
/// Directions below the rounding level of the scalar are left out; a parameter that has a share in one of
/// them is not determined by the rows, whatever their noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution<T: Scalar, const N: usize> {
    /// Least-squares estimate; meaningless where `determined` is false.
    pub estimate: [T; N],
    /// Square root of the diagonal of `(RᵀR)⁻¹`; meaningless where `determined` is false.
    pub standard_deviation: [T; N],
    /// Tells whether the rows alone determine the parameter.
    pub determined: [bool; N],
    /// 2-norm condition number of the column-scaled R, over the directions that are determined.
    pub condition_number: T,
    /// Unit vector, in column-scaled parameters, of the direction that the rows say least about.
    pub weakest_direction: [T; N],
}

/// Returns the 2-norm condition number of the given columns of the factor, each scaled to unit length. `None`
/// if one of them is zero or the set is dependent at the rounding level of the scalar.
pub fn condition_number<T: Scalar, const N: usize>(
    factor: &InformationFactor<T, N>,
    columns: &[bool; N],
) -> Option<T> {
    let Scaled { scale, jacobi } = Scaled::of(factor, columns);
    let (mut least, mut most) = (None, T::ZERO);
    for ((s2, chosen), scale) in jacobi.squares.iter().zip(columns).zip(&scale) {
        if !chosen {
            continue;
        }
        if *scale <= T::ZERO {
            return None;
        }
        most = most.max(*s2);
        least = Some(least.map_or(*s2, |l: T| if *s2 < l { *s2 } else { l }));
    }
    let least = least?;
    let floor = rank_floor::<T>(N) * rank_floor::<T>(N) * most;
    (least > floor).then(|| (most / least).sqrt())
}

/// Returns the share of the largest singular value below which singular values are rounding.
fn rank_floor<T: Scalar>(n: usize) -> T {
    T::EPSILON * T::from_u32(n as u32)
}

/// Solves a factor of at most `M` parameters in steps of bounded size: [`Self::begin`], [`Self::rotate`]
/// until it is done,
/// [`Self::finish`]. [`InformationFactor::solve`] does it in one go, with the same operations.
#[derive(Clone, Copy, Debug)]
pub struct Solver<T: Scalar, const M: usize> {
    scaled: Scaled<T, M>,
    z: [T; M],
    n: usize,
}

impl<T: Scalar, const M: usize> Solver<T, M> {
    /// Solves nothing yet. All bits are zero.
    pub const UNUSED: Self = Self { scaled: Scaled::EMPTY, z: [T::ZERO; M], n: 0 };

    /// Begins with this factor, of no more than `M` parameters.
    pub fn begin<const N: usize>(&mut self, factor: &InformationFactor<T, N>) {
        const { assert!(N <= M, "no more parameters than there is room for") }
        self.scaled.begin(factor, &[true; N]);
        self.n = N;
        for (to, z) in self.z.iter_mut().zip(factor.z()) {
            *to = *z;
        }
    }

    /// Rotates the given number of pairs of the scaled triangle's columns. Returns true when none needs it
    /// any more.
    pub fn rotate(&mut self, pairs: usize) -> bool {
        self.scaled.jacobi.rotate_pairs(pairs)
    }

    /// Returns the solution when everything is rotated; numbers beyond the factor's parameters are zero.
    pub fn finish(&mut self) -> Solution<T, M> {
        self.scaled.jacobi.measure();
        let (Scaled { scale, jacobi }, n) = (&self.scaled, self.n);
        let mut most = T::ZERO;
        for s2 in jacobi.squares.iter().take(n) {
            most = most.max(*s2);
        }
        let floor = rank_floor::<T>(n) * rank_floor::<T>(n) * most;
        // A share of a lost direction larger than rounding can explain.
        let share = T::EPSILON.sqrt() * T::from_u32(3);
        let mut solution = Solution {
            estimate: [T::ZERO; M],
            standard_deviation: [T::ZERO; M],
            determined: [true; M],
            condition_number: T::ONE,
            weakest_direction: [T::ZERO; M],
        };
        let mut least: Option<T> = None;
        let mut weakest: Option<T> = None;
        for ((s2, direction), w) in jacobi.squares.iter().zip(&jacobi.v).zip(&jacobi.w).take(n) {
            let s2 = *s2;
            if weakest.is_none_or(|w| s2 < w) {
                weakest = Some(s2);
                solution.weakest_direction = *direction;
            }
            if s2 <= floor || s2 <= T::ZERO {
                for (determined, v) in solution.determined.iter_mut().zip(direction).take(n) {
                    *determined &= v.abs() <= share;
                }
                continue;
            }
            least = Some(least.map_or(s2, |l| if s2 < l { s2 } else { l }));
            let mut projection = T::ZERO;
            for (a, b) in w.iter().zip(&self.z).take(n) {
                projection += *a * *b;
            }
            projection /= s2;
            let sums = solution.estimate.iter_mut().zip(&mut solution.standard_deviation);
            for ((estimate, variance), v) in sums.zip(direction).take(n) {
                *estimate += *v * projection;
                *variance += *v * *v / s2;
            }
        }
        let all = solution.estimate.iter_mut().zip(&mut solution.standard_deviation);
        for (((estimate, sd), determined), scale) in all.zip(&mut solution.determined).zip(scale).take(n) {
            if *scale > T::ZERO {
                *estimate /= *scale;
                *sd = sd.sqrt() / *scale;
            } else {
                *determined = false;
            }
        }
        if let Some(least) = least {
            solution.condition_number = (most / least).sqrt();
        }
        solution
    }
}

impl<T: Scalar, const N: usize> Solution<T, N> {
    pub(super) fn of(factor: &InformationFactor<T, N>) -> Self {
        let mut solver = Solver::<T, N>::UNUSED;
        solver.begin(factor);
        while !solver.rotate(usize::MAX) {}
        solver.finish()
    }
}

/// Returns the covariance `(RᵀR)⁻¹` over the directions that are determined. Rows and columns of parameters
/// that are not determined (see [`Solution`]) are meaningless.
pub(super) fn covariance<T: Scalar, const N: usize>(factor: &InformationFactor<T, N>) -> [[T; N]; N] {
    let Scaled { scale, jacobi } = Scaled::of(factor, &[true; N]);
    let mut most = T::ZERO;
    for s2 in jacobi.squares {
        most = most.max(s2);
    }
    let floor = rank_floor::<T>(N) * rank_floor::<T>(N) * most;
    let mut covariance = [[T::ZERO; N]; N];
    for (s2, direction) in jacobi.squares.iter().zip(&jacobi.v) {
        if *s2 <= floor || *s2 <= T::ZERO {
            continue;
        }
        for i in 0..N {
            for j in 0..N {
                let scale = scale[i] * scale[j];
                if scale > T::ZERO {
                    covariance[i][j] += direction[i] * direction[j] / (*s2 * scale);
                }
            }
        }
    }
    covariance
}

/// Returns the standard deviation of every parameter: row j of R⁻¹ has the length of that of parameter j. `r`
/// by columns.
pub(super) fn standard_deviations<T: Scalar, const N: usize>(r: &[[T; N]; N]) -> [T; N] {
    let mut deviations = [T::ZERO; N];
    for (j, deviation) in deviations.iter_mut().enumerate() {
        // x R = e_j, from the diagonal on.
        let mut x = [T::ZERO; N];
        let mut square = T::ZERO;
        for k in j..N {
            let mut rest = if k == j { T::ONE } else { T::ZERO };
            let (Some(known), Some(column)) = (x.get(j..k), r[k].get(j..k)) else { break };
            for (x, r) in known.iter().zip(column) {
                rest -= *x * *r;
            }
            x[k] = rest / r[k][k];
            square += x[k] * x[k];
        }
        // A zero on the diagonal leaves infinity or NaN.
        *deviation = if square.is_finite() { square.sqrt() } else { T::ONE / T::ZERO };
    }
    deviations
}

/// Solves `R φ = z` from below, given row lengths of R⁻¹.
pub(super) fn well_determined<T: Scalar, const N: usize>(
    factor: &InformationFactor<T, N>,
    deviations: &[T; N],
) -> Option<[T; N]> {
    let mut phi = *factor.z();
    for j in (0..N).rev() {
        let column = &factor.triangle.r[j];
        // The variance inflation factor: 1 for a column that no other resembles.
        let inflation = dot(column, column) * deviations[j] * deviations[j];
        if !inflation.is_finite() || inflation >= T::ONE / T::EPSILON {
            return None;
        }
        phi[j] /= column[j];
        let value = phi[j];
        for (rest, r) in phi.iter_mut().zip(column).take(j) {
            *rest -= *r * value;
        }
    }
    Some(phi)
}

/// The triangle of at most `M` parameters with its columns scaled to unit length, decomposed.
#[derive(Clone, Copy, Debug)]
struct Scaled<T: Scalar, const M: usize> {
    /// Column norms D of R; zero for a column that is empty or left out.
    scale: [T; M],
    /// The decomposition of `R D⁻¹`.
    jacobi: Jacobi<T, M>,
}

impl<T: Scalar, const M: usize> Scaled<T, M> {
    const EMPTY: Self = Self { scale: [T::ZERO; M], jacobi: Jacobi::EMPTY };

    fn of(factor: &InformationFactor<T, M>, columns: &[bool; M]) -> Self {
        let mut scaled = Self::EMPTY;
        scaled.begin(factor, columns);
        while !scaled.jacobi.rotate_pairs(usize::MAX) {}
        scaled.jacobi.measure();
        scaled
    }

    /// Scales; the rotations are still to be done.
    fn begin<const N: usize>(&mut self, factor: &InformationFactor<T, N>, columns: &[bool; N]) {
        let targets = self.scale.iter_mut().zip(&mut self.jacobi.w);
        for ((scale, w), (column, chosen)) in targets.zip(factor.triangle.r.iter().zip(columns)) {
            (*scale, *w) = (T::ZERO, [T::ZERO; M]);
            let norm2 = dot(column, column);
            if *chosen && norm2 > T::TINY_SQUARE {
                *scale = norm2.sqrt();
                for (to, entry) in w.iter_mut().zip(column) {
                    *to = *entry / *scale;
                }
            }
        }
        self.jacobi.begin(N);
    }
}
