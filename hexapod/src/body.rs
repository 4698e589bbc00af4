//! The rigid body under test, in Newton's and Euler's own words.
//!
//! Lives here: mass, centre of mass and inertia, and the wrench that a motion takes. May not live here:
//! regressors or anything else from the estimator's side; this module is its oracle.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::kinematics::PlateState;

/// Standard gravity, m/s².
pub const STANDARD_GRAVITY_MPS2: f64 = 9.80665;

/// Inertial parameters of the body bolted to the load cell, in S.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BodyParameters {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in S, m.
    pub com_m: [f64; 3],
    /// Inertia tensor about the centre of mass in the axes of S, `[Ixx, Iyy, Izz, Iyz, Izx, Ixy]`, kg m².
    /// Tensor elements: `Ixy = −∫ x y dm`.
    pub inertia_com_kgm2: [f64; 6],
}

impl BodyParameters {
    /// Returns the thesis' test body with its plates, lying across the platform: 20 kg (assumed; the bar
    /// alone is 17.97 kg), centre of mass 53 mm above the load cell.
    pub fn thesis_horizontal() -> Self {
        Self {
            mass_kg: 20.0,
            com_m: [0.0, 0.0, 0.053],
            inertia_com_kgm2: [0.3813, 0.0185, 0.3791, 0.0, 0.0, 0.0],
        }
    }

    /// Returns the thesis' test body with its plates standing upright, centre of mass 247 mm above the load
    /// cell.
    pub fn thesis_vertical() -> Self {
        Self {
            mass_kg: 20.0,
            com_m: [0.0, 0.0, 0.247],
            inertia_com_kgm2: [0.5050, 0.5050, 0.0162, 0.0, 0.0, 0.0],
        }
    }

    /// Returns true if some body has these parameters: all are finite, the mass is positive, and so are the
    /// second moments of mass, `½ tr(I) 1 − I`, but for the rounding of printed figures.
    pub fn is_possible(&self) -> bool {
        const ROUNDED: f64 = 0.01;
        let inertia = self.inertia_com();
        let second = Matrix3::identity() * (0.5 * inertia.trace()) - inertia;
        let finite = self.com_m.iter().chain(&self.inertia_com_kgm2).all(|v| v.is_finite());
        if !(finite && self.mass_kg.is_finite() && self.mass_kg > 0.0) {
            return false;
        }
        let eigen = second.symmetric_eigenvalues();
        eigen.max() >= 0.0 && eigen.min() >= -ROUNDED * eigen.max()
    }

    /// Returns the tensor about the centre of mass as a matrix, kg m².
    pub fn inertia_com(&self) -> Matrix3<f64> {
        let [xx, yy, zz, yz, zx, xy] = self.inertia_com_kgm2;
        Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz)
    }

    /// Returns the tensor about S's origin, `[Ixx, Iyy, Izz, Iyz, Izx, Ixy]`, kg m²: parallel axes, a point
    /// mass at the centre of mass added.
    pub fn inertia_origin_kgm2(&self) -> [f64; 6] {
        let [x, y, z] = self.com_m;
        let m = self.mass_kg;
        let [xx, yy, zz, yz, zx, xy] = self.inertia_com_kgm2;
        [
            xx + m * (y * y + z * z),
            yy + m * (z * z + x * x),
            zz + m * (x * x + y * y),
            yz - m * y * z,
            zx - m * z * x,
            xy - m * x * y,
        ]
    }

    /// Returns the ten parameters about S's origin, `[m, mcx, mcy, mcz, Ixx, Iyy, Izz, Iyz, Izx, Ixy]`.
    pub fn parameters(&self) -> [f64; 10] {
        let m = self.mass_kg;
        let [x, y, z] = self.com_m;
        let [xx, yy, zz, yz, zx, xy] = self.inertia_origin_kgm2();
        [m, m * x, m * y, m * z, xx, yy, zz, yz, zx, xy]
    }

    /// Returns the parameters of the body in another frame: this frame's origin is at `offset_m` there and
    /// its axes are the columns of `rotation`. From S to P with the load cell's place on the plate.
    pub fn in_frame(&self, offset_m: &Vector3<f64>, rotation: &Matrix3<f64>) -> Self {
        let com = offset_m + rotation * Vector3::from(self.com_m);
        let i = rotation * self.inertia_com() * rotation.transpose();
        Self {
            mass_kg: self.mass_kg,
            com_m: com.into(),
            inertia_com_kgm2: [i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(1, 2)], i[(2, 0)], i[(0, 1)]],
        }
    }

    /// Returns the wrench on the body by the sensor side at S's origin, in S, that makes the body follow
    /// `motion`; N, N m.
    ///
    /// In the earth's axes: `F = m (p̈_com − g)` and, about the centre of mass, `dL/dt = I_A α + ω × I_A ω`
    /// with `I_A = R I_c Rᵀ`. The moment is then moved to S's origin and both are turned into S.
    pub fn wrench(&self, motion: &FrameMotion, gravity: &Vector3<f64>) -> [f64; 6] {
        let FrameMotion { rotation, acceleration, angular_rate, angular_acceleration, .. } = *motion;
        let arm = rotation * Vector3::from(self.com_m);
        let com_acceleration =
            acceleration + angular_acceleration.cross(&arm) + angular_rate.cross(&angular_rate.cross(&arm));
        let force = self.mass_kg * (com_acceleration - gravity);
        let inertia = rotation * self.inertia_com() * rotation.transpose();
        let spin_change = inertia * angular_acceleration + angular_rate.cross(&(inertia * angular_rate));
        let moment = spin_change + arm.cross(&force);
        let (f, m) = (rotation.transpose() * force, rotation.transpose() * moment);
        [f.x, f.y, f.z, m.x, m.y, m.z]
    }
}

/// Motion of a frame fixed to the plate, everything in the earth's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameMotion {
    /// Origin, m.
    pub position: Vector3<f64>,
    /// Velocity of the origin, m/s.
    pub velocity: Vector3<f64>,
    /// Acceleration of the origin, m/s². Gravity is not in it.
    pub acceleration: Vector3<f64>,
    /// Frame axes to the earth's.
    pub rotation: Matrix3<f64>,
    /// rad/s.
    pub angular_rate: Vector3<f64>,
    /// rad/s².
    pub angular_acceleration: Vector3<f64>,
}

impl FrameMotion {
    /// Returns the motion of the plate itself.
    pub fn of_plate(plate: &PlateState) -> Self {
        Self {
            position: plate.position,
            velocity: plate.velocity,
            acceleration: plate.acceleration,
            rotation: plate.rotation,
            angular_rate: plate.rotation * plate.angular_rate,
            angular_acceleration: plate.rotation * plate.angular_acceleration,
        }
    }

    /// Returns the motion of another frame fixed to the same rigid body: its origin at `offset` in this
    /// frame, its axes turned by `rotation` (its axes to this frame's).
    pub fn fixed_frame(&self, offset: &Vector3<f64>, rotation: &Matrix3<f64>) -> Self {
        let arm = self.rotation * offset;
        let whirl = self.angular_rate.cross(&arm);
        Self {
            position: self.position + arm,
            velocity: self.velocity + whirl,
            acceleration: self.acceleration
                + self.angular_acceleration.cross(&arm)
                + self.angular_rate.cross(&whirl),
            rotation: self.rotation * rotation,
            ..*self
        }
    }

    /// Returns what an ideal accelerometer at the origin reads along the frame's axes, m/s².
    pub fn specific_force(&self, gravity: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * (self.acceleration - gravity)
    }

    /// Returns what an ideal gyro reads along the frame's axes, rad/s.
    pub fn body_rate(&self) -> Vector3<f64> {
        self.rotation.transpose() * self.angular_rate
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Axis, MotionProgram, Pose, Segment, SineTerm, Trajectory};

    const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.80665);

    fn body() -> BodyParameters {
        BodyParameters {
            mass_kg: 3.2,
            com_m: [0.03, -0.05, 0.11],
            inertia_com_kgm2: [0.031, 0.042, 0.025, 0.003, -0.004, 0.006],
        }
    }

    fn trajectory() -> Trajectory {
        let term =
            |axis, amplitude, frequency_hz, phase_rad| SineTerm { axis, amplitude, frequency_hz, phase_rad };
        MotionProgram {
            start: Pose { position_m: [0.0, 0.0, 0.734], rpy_rad: [0.2, -0.1, 0.4] },
            segments: vec![Segment::Multisine {
                duration_s: 6.0,
                ramp_s: 1.0,
                terms: vec![
                    term(Axis::X, 0.04, 0.9, 0.1),
                    term(Axis::Y, 0.03, 1.1, 0.7),
                    term(Axis::Z, 0.05, 0.8, 1.9),
                    term(Axis::Roll, 0.3, 0.6, 0.3),
                    term(Axis::Pitch, 0.25, 0.7, -1.0),
                    term(Axis::Yaw, 0.4, 0.5, 0.5),
                ],
            }],
        }
        .trajectory()
        .unwrap()
    }

    fn sensor_motion(t: f64) -> FrameMotion {
        let tilt = Matrix3::new(0.8, 0.0, 0.6, 0.0, 1.0, 0.0, -0.6, 0.0, 0.8);
        FrameMotion::of_plate(&trajectory().state(t)).fixed_frame(&Vector3::new(0.01, 0.02, 0.06), &tilt)
    }

    /// Returns point masses with the given total mass, centre of mass and inertia: six on the principal cross
    /// of a Cholesky factor of the second moments. An oracle that knows neither tensors nor Euler's equation.
    fn point_masses(b: &BodyParameters) -> Vec<(f64, Vector3<f64>)> {
        let i = b.inertia_com();
        let second = Matrix3::identity() * (0.5 * i.trace()) - i;
        let mut l = Matrix3::<f64>::zeros();
        for r in 0..3 {
            for c in 0..=r {
                let mut s = second[(r, c)];
                for k in 0..c {
                    s -= l[(r, k)] * l[(c, k)];
                }
                l[(r, c)] = if r == c { s.sqrt() } else { s / l[(c, c)] };
            }
        }
        // Σ w (±d)(±d)ᵀ over a pair with w = m/6 is m/3 d dᵀ: d = √(3/m) × column.
        let stretch = (3.0 / b.mass_kg).sqrt();
        let mut points = Vec::new();
        for c in 0..3 {
            let d: Vector3<f64> = stretch * l.column(c);
            points.push((b.mass_kg / 6.0, Vector3::from(b.com_m) + d));
            points.push((b.mass_kg / 6.0, Vector3::from(b.com_m) - d));
        }
        points
    }

    #[test]
    fn wrench_is_the_rate_of_change_of_momentum_of_point_masses() {
        // d/dt of Σ m v and Σ (r − o) × m v about the fixed point o = S's origin now, by central differences
        // of positions only; gravity's share taken off.
        let h = 2e-4;
        for t in [0.4, 1.3, 2.9, 4.1, 5.6] {
            let now = sensor_motion(t);
            let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
            for (m, p) in point_masses(&body()) {
                let at = |s: f64| {
                    let f = sensor_motion(s);
                    f.position + f.rotation * p
                };
                let acceleration = (at(t + h) - 2.0 * at(t) + at(t - h)) / (h * h);
                let f = m * (acceleration - GRAVITY);
                force += f;
                moment += (at(t) - now.position).cross(&f);
            }
            let (f, m) = (now.rotation.transpose() * force, now.rotation.transpose() * moment);
            let wrench = body().wrench(&now, &GRAVITY);
            for (got, want) in wrench.iter().zip([f.x, f.y, f.z, m.x, m.y, m.z]) {
                // Truncation h²/12 · x⁗ ≈ 1e-6 m/s², rounding 4ε/h² ≈ 2e-8 m/s², times 3.2 kg.
                assert!((got - want).abs() < 1e-5, "t = {t}: {wrench:?}");
            }
        }
    }

    #[test]
    fn power_of_the_wrench_is_the_rate_of_change_of_energy() {
        let h = 1e-4;
        let energy = |t: f64| {
            let s = sensor_motion(t);
            let com = s.fixed_frame(&Vector3::from(body().com_m), &Matrix3::identity());
            let rate = s.body_rate();
            0.5 * body().mass_kg * com.velocity.dot(&com.velocity)
                + 0.5 * rate.dot(&(body().inertia_com() * rate))
                - body().mass_kg * GRAVITY.dot(&com.position)
        };
        for t in [0.5, 1.7, 3.3, 5.2] {
            let s = sensor_motion(t);
            let w = body().wrench(&s, &GRAVITY);
            let v = s.rotation.transpose() * s.velocity;
            let power =
                Vector3::new(w[0], w[1], w[2]).dot(&v) + Vector3::new(w[3], w[4], w[5]).dot(&s.body_rate());
            let slope = (energy(t + h) - energy(t - h)) / (2.0 * h);
            assert!((power - slope).abs() < 1e-6, "{power} against {slope}");
        }
    }

    #[test]
    fn at_rest_and_level_the_wrench_carries_the_weight_at_the_centre_of_mass() {
        let motion = FrameMotion::of_plate(&Trajectory::resting(&Pose::default()).state(0.0));
        let (m, g) = (3.2, 9.80665);
        let w = body().wrench(&motion, &GRAVITY);
        let want = [0.0, 0.0, m * g, -0.05 * m * g, -0.03 * m * g, 0.0];
        for (a, b) in w.iter().zip(want) {
            assert!((a - b).abs() < 1e-12, "{w:?}");
        }
    }

    #[test]
    fn accelerometer_at_a_lever_arm_reads_the_second_difference_of_its_position() {
        let h = 1e-4;
        let arm = Vector3::new(0.05, -0.04, 0.02);
        let turn = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0);
        let at = |t: f64| sensor_motion(t).fixed_frame(&arm, &turn);
        for t in [0.6, 2.2, 4.9] {
            let acceleration = (at(t + h).position - 2.0 * at(t).position + at(t - h).position) / (h * h);
            let want = at(t).rotation.transpose() * (acceleration - GRAVITY);
            let got = at(t).specific_force(&GRAVITY);
            assert!((got - want).iter().all(|e| e.abs() < 2e-6), "{got:?} {want:?}");
        }
    }

    #[test]
    fn parameters_about_the_origin_are_the_sums_over_point_masses() {
        let p = body().parameters();
        let mut sums = [0.0; 10];
        for (m, r) in point_masses(&body()) {
            let each = [
                m,
                m * r.x,
                m * r.y,
                m * r.z,
                m * (r.y * r.y + r.z * r.z),
                m * (r.z * r.z + r.x * r.x),
                m * (r.x * r.x + r.y * r.y),
                -m * r.y * r.z,
                -m * r.z * r.x,
                -m * r.x * r.y,
            ];
            for (s, e) in sums.iter_mut().zip(each) {
                *s += e;
            }
        }
        for (a, b) in p.iter().zip(sums) {
            assert!((a - b).abs() < 1e-14, "{p:?} {sums:?}");
        }
    }
}
