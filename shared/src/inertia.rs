//! The ten inertial parameters of a rigid body.
//!
//! Lives here: parameters about a frame's origin, conversion to the centre of mass, change of frame,
//! pseudo-inertia and physical consistency. May not live here: estimation. Next: [`crate::regressor`].

use core::marker::PhantomData;

use nalgebra::{Matrix3, Matrix4, Vector3};

use crate::Scalar;
use crate::spatial::{Frame, Position, Rotation};

/// Names of the ten parameters and the six wrench offsets, in their order everywhere.
pub const PARAMETER_NAMES: [&str; 16] = [
    "m",
    "mcx",
    "mcy",
    "mcz",
    "Ixx",
    "Iyy",
    "Izz",
    "Iyz",
    "Izx",
    "Ixy",
    "offset_fx",
    "offset_fy",
    "offset_fz",
    "offset_mx",
    "offset_my",
    "offset_mz",
];

/// SI units of [`PARAMETER_NAMES`].
pub const PARAMETER_UNITS: [&str; 16] = [
    "kg", "kg m", "kg m", "kg m", "kg m2", "kg m2", "kg m2", "kg m2", "kg m2", "kg m2", "N", "N", "N", "N m",
    "N m", "N m",
];

/// Inertial parameters about the origin of frame `F`, in its axes. Products of inertia are tensor elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialParameters<F: Frame, T: Scalar> {
    /// Mass m, kg.
    pub mass: T,
    /// First moment m·c, kg m.
    pub first_moment: Vector3<T>,
    /// Inertia tensor about the frame's origin, kg m².
    pub inertia: Matrix3<T>,
    frame: PhantomData<F>,
}

/// Returns `S(v) = vᵀv 1 − v vᵀ`, so that `I_O = I_c + m S(c)` (parallel-axis theorem).
fn steiner<T: Scalar>(v: &Vector3<T>) -> Matrix3<T> {
    let (x, y, z) = (v.x, v.y, v.z);
    Matrix3::new(
        y * y + z * z,
        -(x * y),
        -(z * x),
        -(x * y),
        x * x + z * z,
        -(y * z),
        -(z * x),
        -(y * z),
        x * x + y * y,
    )
}

/// Returns `[Ixx, Iyy, Izz, Iyz, Izx, Ixy]` as a symmetric matrix.
pub fn tensor_from_elements<T: Scalar>(e: [T; 6]) -> Matrix3<T> {
    let [xx, yy, zz, yz, zx, xy] = e;
    Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz)
}

/// Returns a symmetric matrix as `[Ixx, Iyy, Izz, Iyz, Izx, Ixy]`.
pub fn tensor_elements<T: Scalar>(i: &Matrix3<T>) -> [T; 6] {
    [i.m11, i.m22, i.m33, i.m23, i.m31, i.m12]
}

impl<F: Frame, T: Scalar> InertialParameters<F, T> {
    /// Makes the parameters from `φ = [m, mcx, mcy, mcz, Ixx, Iyy, Izz, Iyz, Izx, Ixy]`, kg, kg m, kg m².
    pub fn from_vector(phi: [T; 10]) -> Self {
        let [m, x, y, z, xx, yy, zz, yz, zx, xy] = phi;
        Self {
            mass: m,
            first_moment: Vector3::new(x, y, z),
            inertia: tensor_from_elements([xx, yy, zz, yz, zx, xy]),
            frame: PhantomData,
        }
    }

    /// Makes the parameters from mass (kg), centre of mass (m) and inertia tensor about the centre of mass
    /// (kg m²).
    pub fn from_centre_of_mass(mass: T, com: Position<F, T>, inertia_com: Matrix3<T>) -> Self {
        let c = com.vector();
        Self { mass, first_moment: c * mass, inertia: inertia_com + steiner(&c) * mass, frame: PhantomData }
    }

    /// Returns the parameters as `φ`, in the order of [`PARAMETER_NAMES`].
    pub fn to_vector(&self) -> [T; 10] {
        let [xx, yy, zz, yz, zx, xy] = tensor_elements(&self.inertia);
        let c = &self.first_moment;
        [self.mass, c.x, c.y, c.z, xx, yy, zz, yz, zx, xy]
    }

    /// Returns the centre of mass `c`, m. Not finite where the mass is zero.
    pub fn centre_of_mass(&self) -> Position<F, T> {
        let c = self.first_moment / self.mass;
        Position::new(c.x, c.y, c.z)
    }

    /// Returns the inertia tensor about the centre of mass, `I_c = I − m S(c)`, kg m².
    pub fn inertia_com(&self) -> Matrix3<T> {
        self.inertia - steiner(&self.centre_of_mass().vector()) * self.mass
    }

    /// Returns the body's parameters about the origin of `G`, in G's axes. `origin` is G's origin in `F`.
    pub fn expressed_in<G: Frame>(
        &self,
        rotation: &Rotation<G, F, T>,
        origin: Position<F, T>,
    ) -> InertialParameters<G, T> {
        let c = self.centre_of_mass();
        let r = rotation.matrix();
        InertialParameters::from_centre_of_mass(
            self.mass,
            *rotation * (c - origin),
            r * self.inertia_com() * r.transpose(),
        )
    }

    /// Returns the pseudo-inertia `J = [[Σ, mc], [mcᵀ, m]]`, `Σ = ½ tr(I) 1 − I` (Wensing, Kim, Slotine
    /// 2018).
    pub fn pseudo_inertia(&self) -> Matrix4<T> {
        let half_trace = self.inertia.trace() / (T::ONE + T::ONE);
        let s = -self.inertia;
        let c = &self.first_moment;
        Matrix4::new(
            s.m11 + half_trace,
            s.m12,
            s.m13,
            c.x,
            s.m21,
            s.m22 + half_trace,
            s.m23,
            c.y,
            s.m31,
            s.m32,
            s.m33 + half_trace,
            c.z,
            c.x,
            c.y,
            c.z,
            self.mass,
        )
    }

    /// Returns whether some distribution of positive mass has these parameters: `J ≻ 0`.
    pub fn is_physically_consistent(&self) -> bool {
        let mut j = self.pseudo_inertia();
        // Cholesky in place; J ≻ 0 iff every pivot is positive.
        for k in 0..4 {
            let pivot = j[(k, k)];
            if !pivot.is_finite() || pivot <= T::ZERO {
                return false;
            }
            for row in k + 1..4 {
                let factor = j[(row, k)] / pivot;
                for col in k + 1..4 {
                    let update = factor * j[(k, col)];
                    j[(row, col)] -= update;
                }
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::{Body, Sensor};

    fn plate() -> InertialParameters<Sensor, f64> {
        InertialParameters::from_centre_of_mass(
            20.0,
            Position::new(0.001, -0.002, 0.053),
            tensor_from_elements([0.3813, 0.0185, 0.3791, 0.001, -0.002, 0.003]),
        )
    }

    #[test]
    fn moving_to_another_frame_and_back_changes_nothing() {
        let r = Rotation::<Body, Sensor, f64>::from_quaternion([0.9, 0.1, -0.3, 0.2]).unwrap();
        let origin = Position::new(0.1, 0.2, -0.3);
        let there = plate().expressed_in(&r, origin);
        let back_origin = r * (Position::zero() - origin);
        let back: InertialParameters<Sensor, f64> = there.expressed_in(&r.inverse(), back_origin);
        for (a, b) in back.to_vector().iter().zip(plate().to_vector()) {
            assert!((a - b).abs() < 1e-13);
        }
    }

    #[test]
    fn inertia_of_point_masses_is_the_sum_over_the_points() {
        // Four points; the tensor by its definition ∫(rᵀr 1 − r rᵀ)dm.
        let points = [
            (1.0, [0.1, 0.2, 0.3]),
            (2.0, [-0.2, 0.1, 0.0]),
            (0.5, [0.0, 0.0, 0.4]),
            (1.5, [0.3, -0.1, 0.1]),
        ];
        let mass: f64 = points.iter().map(|p| p.0).sum();
        let mut mc = Vector3::zeros();
        let mut about_origin = Matrix3::zeros();
        for (m, r) in points {
            let r = Vector3::from(r);
            mc += r * m;
            about_origin += (Matrix3::identity() * r.dot(&r) - r * r.transpose()) * m;
        }
        let [xx, yy, zz, yz, zx, xy] = tensor_elements(&about_origin);
        let body =
            InertialParameters::<Sensor, f64>::from_vector([mass, mc.x, mc.y, mc.z, xx, yy, zz, yz, zx, xy]);
        let mut about_com = Matrix3::zeros();
        for (m, r) in points {
            let r = Vector3::from(r) - mc / mass;
            about_com += (Matrix3::identity() * r.dot(&r) - r * r.transpose()) * m;
        }
        assert!((body.inertia_com() - about_com).abs().max() < 1e-14);
        // J is Σ m [r; 1][r; 1]ᵀ.
        let mut j = Matrix4::zeros();
        for (m, r) in points {
            let h = nalgebra::Vector4::new(r[0], r[1], r[2], 1.0);
            j += h * h.transpose() * m;
        }
        assert!((body.pseudo_inertia() - j).abs().max() < 1e-14);
        assert!(body.is_physically_consistent());
    }

    #[test]
    fn a_tensor_that_breaks_the_triangle_inequality_is_inconsistent() {
        let mut phi = plate().to_vector();
        assert!(plate().is_physically_consistent());
        phi[4] += 1.0;
        assert!(!InertialParameters::<Sensor, f64>::from_vector(phi).is_physically_consistent());
        phi[4] = f64::NAN;
        assert!(!InertialParameters::<Sensor, f64>::from_vector(phi).is_physically_consistent());
    }
}
