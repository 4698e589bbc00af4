//! Joints, legs and limits of a hexapod.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::kinematics::{PlateState, rotation_from_rpy};
use super::{MotionError, Pose, Trajectory};

/// A hexapod: leg `i` joins `base_joints_m[i]` (in A) to `plate_joints_m[i]` (in P).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Geometry {
    /// Base joints in A, m.
    pub base_joints_m: [[f64; 3]; 6],
    /// Plate joints in P, m.
    pub plate_joints_m: [[f64; 3]; 6],
    /// Shortest and longest leg, m.
    pub leg_length_m: [f64; 2],
    /// Highest leg speed, m/s.
    pub leg_rate_mps: f64,
}

impl Default for Geometry {
    fn default() -> Self {
        Self::thesis()
    }
}

impl Geometry {
    /// The platform thesis' machine: base joints at azimuth 10, 110, 130, 230, 250, 350° on R = 0.45 m, plate
    /// joints pairwise at 60, 180, 300° on r = 0.25 m and 0.123 m below the plate's origin, legs from 0.55 m with
    /// a stroke of 0.3048 m. The thesis prints the azimuths, the 0.123 m and the stroke; radii, shortest leg and
    /// the leg speed of 0.8 m/s are assumed.
    pub fn thesis() -> Self {
        let ring = |radius: f64, height: f64, azimuth_deg: [f64; 6]| {
            azimuth_deg.map(|d| {
                let (s, c) = d.to_radians().sin_cos();
                [radius * c, radius * s, height]
            })
        };
        Self {
            base_joints_m: ring(0.45, 0.0, [10.0, 110.0, 130.0, 230.0, 250.0, 350.0]),
            plate_joints_m: ring(0.25, -0.123, [60.0, 60.0, 180.0, 180.0, 300.0, 300.0]),
            leg_length_m: [0.55, 0.8548],
            leg_rate_mps: 0.8,
        }
    }

    /// The level pose above the base's centre at which leg 1 is half-way out.
    pub fn home(&self) -> Pose {
        let [lo, hi] = self.leg_length_m;
        let middle = 0.5 * (lo + hi);
        let [[ax, ay, az], ..] = self.base_joints_m;
        let [[bx, by, bz], ..] = self.plate_joints_m;
        let flat = (bx - ax).powi(2) + (by - ay).powi(2);
        Pose { position_m: [0.0, 0.0, az - bz + (middle * middle - flat).max(0.0).sqrt()], rpy_rad: [0.0; 3] }
    }

    /// `l_i = x + R b_i − a_i`, in A, m.
    fn legs(&self, pose: &Pose) -> [Vector3<f64>; 6] {
        let rotation = rotation_from_rpy(pose.rpy_rad);
        let position = Vector3::from(pose.position_m);
        let mut legs = [Vector3::zeros(); 6];
        for ((leg, a), b) in legs.iter_mut().zip(&self.base_joints_m).zip(&self.plate_joints_m) {
            *leg = position + rotation * Vector3::from(*b) - Vector3::from(*a);
        }
        legs
    }

    /// Lengths of the six legs, m.
    pub fn leg_lengths(&self, pose: &Pose) -> [f64; 6] {
        self.legs(pose).map(|l| l.dot(&l).sqrt())
    }

    /// The inverse-kinematics Jacobian: row `i` times the plate's velocity and angular rate, both in A, is the
    /// speed of leg `i`. Rows are `[n_i, (R b_i) × n_i]` with `n_i` the leg's direction (thesis, `H` transposed).
    pub fn jacobian(&self, pose: &Pose) -> [[f64; 6]; 6] {
        let rotation = rotation_from_rpy(pose.rpy_rad);
        let legs = self.legs(pose);
        let mut rows = [[0.0; 6]; 6];
        for ((row, leg), b) in rows.iter_mut().zip(&legs).zip(&self.plate_joints_m) {
            let n = leg / leg.dot(leg).sqrt();
            let arm = (rotation * Vector3::from(*b)).cross(&n);
            *row = [n.x, n.y, n.z, arm.x, arm.y, arm.z];
        }
        rows
    }

    /// Speeds of the six legs, m/s, positive when a leg extends.
    pub fn leg_rates(&self, state: &PlateState) -> [f64; 6] {
        let v = state.velocity;
        let w = state.rotation * state.angular_rate;
        self.jacobian(&state.pose())
            .map(|[nx, ny, nz, mx, my, mz]| nx * v.x + ny * v.y + nz * v.z + mx * w.x + my * w.y + mz * w.z)
    }

    /// Whether the legs can take this state at `time_s`.
    ///
    /// # Errors
    /// The first leg that is too short, too long or too fast.
    pub fn check_state(&self, state: &PlateState, time_s: f64) -> Result<(), MotionError> {
        let [min_m, max_m] = self.leg_length_m;
        for (i, length_m) in self.leg_lengths(&state.pose()).into_iter().enumerate() {
            if !(min_m..=max_m).contains(&length_m) {
                return Err(MotionError::LegLength { leg: i + 1, time_s, length_m, min_m, max_m });
            }
        }
        let limit_mps = self.leg_rate_mps;
        for (i, rate_mps) in self.leg_rates(state).into_iter().enumerate() {
            if rate_mps.abs() > limit_mps || rate_mps.is_nan() {
                return Err(MotionError::LegRate { leg: i + 1, time_s, rate_mps, limit_mps });
            }
        }
        Ok(())
    }

    /// Whether the legs can follow the whole trajectory, looked at every 4 ms.
    ///
    /// # Errors
    /// The first leg that is too short, too long or too fast, with the time at which it is.
    pub fn check(&self, trajectory: &Trajectory) -> Result<(), MotionError> {
        const STEP_S: f64 = 0.004;
        let steps = (trajectory.duration_s() / STEP_S).ceil() as usize;
        for k in 0..=steps {
            let time_s = (k as f64 * STEP_S).min(trajectory.duration_s());
            self.check_state(&trajectory.state(time_s), time_s)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::platform::{MotionProgram, Segment};

    fn some_pose() -> Pose {
        let [x, y, z] = Geometry::thesis().home().position_m;
        Pose { position_m: [x + 0.03, y - 0.02, z + 0.01], rpy_rad: [0.2, -0.3, 0.4] }
    }

    /// Applies a small motion of the plate in A: translation `d`, then rotation by the vector `r` (Rodrigues).
    fn leg_lengths_after(g: &Geometry, pose: &Pose, d: Vector3<f64>, r: Vector3<f64>) -> [f64; 6] {
        let rotation = rotation_from_rpy(pose.rpy_rad);
        let angle = r.dot(&r).sqrt();
        let turn = |v: Vector3<f64>| {
            if angle == 0.0 {
                return v;
            }
            let k = r / angle;
            v * angle.cos() + k.cross(&v) * angle.sin() + k * (k.dot(&v) * (1.0 - angle.cos()))
        };
        let mut out = [0.0; 6];
        for i in 0..6 {
            let b = turn(rotation * Vector3::from(g.plate_joints_m[i]));
            let l = Vector3::from(pose.position_m) + d + b - Vector3::from(g.base_joints_m[i]);
            out[i] = l.dot(&l).sqrt();
        }
        out
    }

    #[test]
    fn leg_jacobian_is_the_finite_difference_of_the_leg_lengths() {
        let (g, pose, h) = (Geometry::thesis(), some_pose(), 1e-6);
        let jacobian = g.jacobian(&pose);
        for axis in 0..6 {
            let mut step = [0.0; 6];
            step[axis] = h;
            let d = Vector3::new(step[0], step[1], step[2]);
            let r = Vector3::new(step[3], step[4], step[5]);
            let plus = leg_lengths_after(&g, &pose, d, r);
            let minus = leg_lengths_after(&g, &pose, -d, -r);
            for leg in 0..6 {
                let slope = (plus[leg] - minus[leg]) / (2.0 * h);
                // Central differences: h² truncation and 1e-16/h rounding, both near 1e-10.
                assert!((slope - jacobian[leg][axis]).abs() < 1e-9, "leg {leg} axis {axis}");
            }
        }
    }

    #[test]
    fn home_is_the_published_height_and_has_equal_legs() {
        let g = Geometry::thesis();
        let lengths = g.leg_lengths(&g.home());
        assert!((g.home().position_m[2] - 0.734).abs() < 5e-4);
        for l in lengths {
            assert!((l - 0.7024).abs() < 1e-12);
        }
    }

    #[test]
    fn the_platform_is_singular_at_a_yaw_of_ninety_degrees() {
        // Fichter's singularity, as the thesis remarks: the Jacobian's determinant vanishes.
        let g = Geometry::thesis();
        let mut pose = g.home();
        pose.rpy_rad[2] = 90_f64.to_radians();
        let mut m = g.jacobian(&pose);
        let mut determinant = 1.0;
        for c in 0..6 {
            let p = (c..6).max_by(|&i, &j| m[i][c].abs().total_cmp(&m[j][c].abs())).unwrap();
            m.swap(c, p);
            determinant *= m[c][c];
            if m[c][c] == 0.0 {
                break;
            }
            for r in c + 1..6 {
                let f = m[r][c] / m[c][c];
                for k in c..6 {
                    m[r][k] -= f * m[c][k];
                }
            }
        }
        assert!(determinant.abs() < 1e-12, "{determinant}");
    }

    #[test]
    fn a_program_beyond_the_reach_names_leg_and_time() {
        let g = Geometry::thesis();
        let mut far = g.home();
        far.position_m[0] += 0.5;
        let program =
            MotionProgram { start: g.home(), segments: vec![Segment::Move { to: far, duration_s: 20.0 }] };
        let error = g.check(&program.trajectory().unwrap()).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("leg ") && text.contains("t = "), "{text}");
        assert!(matches!(error, MotionError::LegLength { .. }), "{error:?}");
    }

    #[test]
    fn a_program_that_is_too_fast_names_leg_and_time() {
        let g = Geometry::thesis();
        let mut up = g.home();
        up.position_m[2] += 0.1;
        let program =
            MotionProgram { start: g.home(), segments: vec![Segment::Move { to: up, duration_s: 0.1 }] };
        let error = g.check(&program.trajectory().unwrap()).unwrap_err();
        assert!(matches!(error, MotionError::LegRate { .. }), "{error:?}");
    }
}
