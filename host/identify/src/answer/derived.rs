//! Quantities derived from the ten parameters, with their standard deviations to first order. Whether the
//! parameters are identified is the caller's to ask.

use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};
use rigident_shared::inertia::{InertialParameters, tensor_elements, tensor_from_elements};
use rigident_shared::spatial::{Body, Position, Rotation, Sensor};

use rigident_fit::{Estimate, Noise};

/// A derived vector and its standard deviations.
#[derive(Clone, Debug, PartialEq)]
pub struct Derived<const K: usize> {
    /// Values, SI.
    pub value: [f64; K],
    /// Standard deviations, the same units.
    pub sd: [f64; K],
    /// Covariance.
    pub covariance: SMatrix<f64, K, K>,
    /// The part of it that does not come from noise.
    beforehand: SMatrix<f64, K, K>,
    /// How the noise is known.
    noise: Noise,
}

impl<const K: usize> Derived<K> {
    /// Returns the 95 % expanded uncertainties of the values, each with the coverage factor that it has.
    pub fn u95(&self) -> [f64; K] {
        std::array::from_fn(|k| {
            self.coverage_factor(self.beforehand[(k, k)], self.sd[k].powi(2)) * self.sd[k]
        })
    }

    /// Returns the coverage factor of a quantity with a variance, and the part of it that is no noise.
    fn coverage_factor(&self, beforehand: f64, variance: f64) -> f64 {
        let share = 1.0 - beforehand / variance;
        self.noise.coverage_factor_of(if share.is_nan() { 1.0 } else { share.clamp(0.0, 1.0) })
    }
}

/// Returns the first ten parameters, determined or not.
pub fn ten(estimate: &Estimate) -> [f64; 10] {
    std::array::from_fn(|j| estimate.unjudged().values.get(j).copied().unwrap_or(0.0))
}

/// `f(φ)` and `J C Jᵀ`.
fn propagate<const K: usize>(estimate: &Estimate, f: impl Fn(&[f64; 10]) -> [f64; K]) -> Derived<K> {
    let jacobian = jacobian(estimate, &f);
    let of = |all: &DMatrix<f64>| {
        let own = &jacobian * all.view((0, 0), (10, 10)) * jacobian.transpose();
        SMatrix::<f64, K, K>::from_fn(|i, j| own[(i, j)])
    };
    let c = of(estimate.unjudged().covariance);
    Derived {
        value: f(&ten(estimate)),
        sd: std::array::from_fn(|k| c[(k, k)].max(0.0).sqrt()),
        covariance: c,
        beforehand: estimate.unjudged().beforehand.map_or_else(SMatrix::zeros, of),
        noise: estimate.noise,
    }
}

/// J, K × 10, by central differences over a thousandth of each parameter's σ.
fn jacobian<const K: usize>(estimate: &Estimate, f: &impl Fn(&[f64; 10]) -> [f64; K]) -> DMatrix<f64> {
    let phi = ten(estimate);
    let mut jacobian = DMatrix::zeros(K, 10);
    for j in 0..10 {
        let sd = estimate.unjudged().covariance[(j, j)].max(0.0).sqrt();
        let step = (1e-3 * sd).max(1e-7 * phi[j].abs()).max(1e-9);
        let shifted = |by: f64| {
            let mut p = phi;
            p[j] += by;
            f(&p)
        };
        let (up, down) = (shifted(step), shifted(-step));
        for k in 0..K {
            jacobian[(k, j)] = (up[k] - down[k]) / (2.0 * step);
        }
    }
    jacobian
}

/// Returns the derivatives of the centre of mass by the ten parameters, row by row.
pub(super) fn centre_of_mass_by_parameters(estimate: &Estimate) -> Vec<Vec<f64>> {
    rows(&jacobian(estimate, &|phi| parameters(phi).centre_of_mass().array()))
}

/// Returns the derivatives of the tensor about the centre of mass by the ten parameters, row by row.
pub(super) fn inertia_com_by_parameters(estimate: &Estimate) -> Vec<Vec<f64>> {
    rows(&jacobian(estimate, &|phi| tensor_elements(&parameters(phi).inertia_com())))
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

fn parameters(phi: &[f64; 10]) -> InertialParameters<Sensor, f64> {
    InertialParameters::from_vector(*phi)
}

/// Centre of mass in S, m.
pub fn centre_of_mass(estimate: &Estimate) -> Derived<3> {
    propagate(estimate, |phi| parameters(phi).centre_of_mass().array())
}

/// Inertia tensor about the centre of mass in the axes of S, `[Ixx, Iyy, Izz, Iyz, Izx, Ixy]`, kg m².
pub fn inertia_com(estimate: &Estimate) -> Derived<6> {
    propagate(estimate, |phi| tensor_elements(&parameters(phi).inertia_com()))
}

/// The customer's frame: its origin in S and the rotation that takes vectors in S to it.
#[derive(Clone, Copy, Debug)]
pub struct BodyFrame {
    /// Origin of the frame in S, m.
    pub origin: Position<Sensor, f64>,
    /// `R_BS`.
    pub rotation: Rotation<Body, Sensor, f64>,
}

/// Centre of mass (3) and inertia tensor about the frame's origin (6) in the customer's frame: m, kg m².
pub fn in_body_frame(estimate: &Estimate, frame: &BodyFrame) -> Derived<9> {
    propagate(estimate, |phi| {
        let there = parameters(phi).expressed_in(&frame.rotation, frame.origin);
        let [x, y, z] = there.centre_of_mass().array();
        let [xx, yy, zz, yz, zx, xy] = tensor_elements(&there.inertia);
        [x, y, z, xx, yy, zz, yz, zx, xy]
    })
}

/// Principal moments about the centre of mass, largest first, and their axes in S.
#[derive(Clone, Debug, PartialEq)]
pub struct Principal {
    /// Moments, kg m².
    pub moments: [f64; 3],
    /// Their standard deviations.
    pub moments_sd: [f64; 3],
    /// Their 95 % expanded uncertainties.
    pub moments_u95: [f64; 3],
    /// Unit axes in S, right-handed, the largest component of each positive (but for the last).
    pub axes: [[f64; 3]; 3],
    /// Standard deviation of each axis' direction, rad. Infinite where two moments cannot be distinguished.
    pub axes_sd_rad: [f64; 3],
    /// Its 95 % expanded uncertainty, likewise.
    pub axes_u95_rad: [f64; 3],
}

/// Principal moments and axes by first-order perturbation: `dλ_i = v_iᵀ dI v_i`, and axis i turns towards
/// axis j by `v_iᵀ dI v_j / (λ_i − λ_j)`.
pub fn principal(inertia_com: &Derived<6>) -> Principal {
    let eigen = tensor_from_elements(inertia_com.value).symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let moments = order.map(|i| eigen.eigenvalues[i]);
    let mut axes = order.map(|i| eigen.eigenvectors.column(i).into_owned());
    for axis in &mut axes[..2] {
        if axis[axis.iamax()] < 0.0 {
            axis.neg_mut();
        }
    }
    axes[2] = axes[0].cross(&axes[1]);
    // v_iᵀ dI v_j as a linear form on the six elements.
    let form = |u: &Vector3<f64>, v: &Vector3<f64>| {
        let s: Matrix3<f64> = u * v.transpose() + v * u.transpose();
        SVector::<f64, 6>::from([s.m11 / 2.0, s.m22 / 2.0, s.m33 / 2.0, s.m23, s.m31, s.m12])
    };
    let variance = |of: &SMatrix<f64, 6, 6>, i: usize, j: usize| {
        let l = form(&axes[i], &axes[j]);
        (l.transpose() * of * l)[0].max(0.0)
    };
    let sd = |i: usize, j: usize| variance(&inertia_com.covariance, i, j).sqrt();
    let of_axis = |i: usize| {
        let (mut square, mut beforehand) = (0.0, 0.0);
        for j in (0..3).filter(|j| *j != i) {
            let gap = (moments[i] - moments[j]).abs();
            // Within the noise of their difference the two axes are interchangeable.
            if gap <= 1.96 * sd(i, i).hypot(sd(j, j)) {
                return [f64::INFINITY; 2];
            }
            square += (sd(i, j) / gap).powi(2);
            beforehand += variance(&inertia_com.beforehand, i, j) / (gap * gap);
        }
        let sd = square.sqrt();
        [sd, inertia_com.coverage_factor(beforehand, square) * sd]
    };
    let of_axes = [0, 1, 2].map(of_axis);
    let of_moment =
        |i: usize| inertia_com.coverage_factor(variance(&inertia_com.beforehand, i, i), sd(i, i).powi(2));
    Principal {
        moments,
        moments_sd: std::array::from_fn(|i| sd(i, i)),
        moments_u95: std::array::from_fn(|i| of_moment(i) * sd(i, i)),
        axes: axes.map(Into::into),
        axes_sd_rad: of_axes.map(|[sd, _]| sd),
        axes_u95_rad: of_axes.map(|[_, u95]| u95),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_fit::Estimate;

    fn estimate() -> Estimate {
        let body = InertialParameters::<Sensor, f64>::from_centre_of_mass(
            20.0,
            Position::new(0.01, -0.02, 0.053),
            tensor_from_elements([0.38, 0.05, 0.2, 0.01, -0.02, 0.03]),
        );
        // Any symmetric positive definite covariance will do: a scaled Hilbert-like matrix.
        let base = DMatrix::from_fn(10, 10, |i, j| 1.0 / (1.0 + (i as f64 - j as f64).abs()));
        let scale = [1e-2, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3];
        let covariance = DMatrix::from_fn(10, 10, |i, j| base[(i, j)] * scale[i] * scale[j]);
        Estimate::of_bound(body.to_vector().to_vec(), covariance)
    }

    /// Draws from N(φ, C) pushed through the functions are the oracle of the first-order covariances.
    #[test]
    fn first_order_uncertainties_are_those_of_a_monte_carlo() {
        let estimate = estimate();
        let lower = estimate.unjudged().covariance.clone().cholesky().unwrap().l();
        let mut state = 42_u64;
        let mut uniform = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let frame = BodyFrame {
            origin: Position::new(0.1, 0.0, 0.02),
            rotation: Rotation::from_quaternion([0.9, 0.1, -0.3, 0.2]).unwrap(),
        };
        let expected_principal = principal(&inertia_com(&estimate));
        let (com, body) = (centre_of_mass(&estimate), in_body_frame(&estimate, &frame));
        let draws = 20_000;
        let (mut com_square, mut body_square, mut moment_square, mut axis_square) =
            ([0.0; 3], [0.0; 9], [0.0; 3], [0.0; 3]);
        for _ in 0..draws {
            let normal = SVector::<f64, 10>::from_fn(|_, _| (0..12).map(|_| uniform()).sum::<f64>() - 6.0);
            let moved =
                estimate.unjudged().values.iter().zip((&lower * normal).iter()).map(|(v, d)| v + d).collect();
            let drawn = estimate.clone().at(moved);
            let add = |sum: &mut [f64], a: &[f64], b: &[f64]| {
                for ((s, x), y) in sum.iter_mut().zip(a).zip(b) {
                    *s += (x - y).powi(2) / f64::from(draws);
                }
            };
            add(&mut com_square, &centre_of_mass(&drawn).value, &com.value);
            add(&mut body_square, &in_body_frame(&drawn, &frame).value, &body.value);
            let p = principal(&inertia_com(&drawn));
            add(&mut moment_square, &p.moments, &expected_principal.moments);
            for i in 0..3 {
                let cosine: f64 = (0..3).map(|k| p.axes[i][k] * expected_principal.axes[i][k]).sum();
                axis_square[i] += cosine.abs().min(1.0).acos().powi(2) / f64::from(draws);
            }
        }
        let close = |square: &[f64], sd: &[f64]| {
            for (s, e) in square.iter().zip(sd) {
                // 20 000 draws leave half a per cent; second order the rest.
                assert!((s.sqrt() / e - 1.0).abs() < 0.03, "{} {e}", s.sqrt());
            }
        };
        close(&com_square, &com.sd);
        close(&body_square, &body.sd);
        close(&moment_square, &expected_principal.moments_sd);
        close(&axis_square, &expected_principal.axes_sd_rad);
    }

    #[test]
    fn axes_of_equal_moments_are_undetermined() {
        let mut derived = inertia_com(&estimate());
        derived.value = [0.3, 0.3001, 0.1, 0.0, 0.0, 0.0];
        let p = principal(&derived);
        assert!(p.axes_sd_rad[0].is_infinite() && p.axes_sd_rad[1].is_infinite());
        assert!(p.axes_sd_rad[2].is_finite());
        let m = Matrix3::from_columns(&p.axes.map(Vector3::from));
        assert!((m.determinant() - 1.0).abs() < 1e-12);
    }
}
