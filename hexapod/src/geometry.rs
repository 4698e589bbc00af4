//! Joints, legs and limits of a hexapod.

use serde::{Deserialize, Serialize};

use super::arm::Arm;
use super::limits::{JointCones, Limits};
use super::pose::Pose;
use super::travel::Travel;

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
    /// The further limits of the machine.
    #[serde(default)]
    pub limits: Limits,
    /// All that is known of a machine whose joints are not published; what is above does not bind then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub travel: Option<Travel>,
    /// The arm that carries the plate in place of legs; `travel` is the part of its reach that may be used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arm: Option<Arm>,
}

/// A stroke that the legs do not have.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "a stroke of {asked_m} m was asked for; it must be greater than zero and the legs have {available_m:.4} m"
)]
pub struct StrokeError {
    /// Asked for, m.
    pub asked_m: f64,
    /// The length that the legs have, m.
    pub available_m: f64,
}

impl Default for Geometry {
    fn default() -> Self {
        Self::thesis()
    }
}

impl Geometry {
    /// Returns the platform thesis' machine: base joints at azimuth 10, 110, 130, 230, 250, 350° on R = 0.45
    /// m, plate joints pairwise at 60, 180, 300° on r = 0.25 m and 0.123 m below the plate's origin, legs
    /// from 0.55 m with a stroke of 0.3048 m. The thesis prints the azimuths, the 0.123 m and the stroke;
    /// radii, shortest leg and the leg speed of 0.8 m/s are assumed.
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
            limits: Limits::default(),
            travel: None,
            arm: None,
        }
    }

    /// Returns a machine of which nothing but its travel is known. Its joints are stand-ins that no limit
    /// depends on; its base's frame A lies at the plate's reference pose.
    pub fn of_travel(travel: Travel) -> Self {
        let unlimited = Limits { cond_max: f64::INFINITY, ..Limits::default() };
        Self { travel: Some(travel), leg_rate_mps: f64::INFINITY, limits: unlimited, ..Self::thesis() }
    }

    /// Returns the flange of an arm as the plate; `travel` is the part of its reach that may be used.
    pub fn of_arm(arm: Arm, travel: Travel) -> Self {
        Self { arm: Some(arm), ..Self::of_travel(travel) }
    }

    /// Returns true if its joints and legs are known.
    pub fn has_joints(&self) -> bool {
        self.travel.is_none()
    }

    /// Returns the machine with only the middle `stroke_m` of its legs' stroke in use, as in the thesis'
    /// experiments (0.20 m of 0.3048 m).
    ///
    /// # Errors
    /// A stroke that is not positive or longer than the legs'.
    pub fn with_stroke(mut self, stroke_m: f64) -> Result<Self, StrokeError> {
        let [lo, hi] = self.leg_length_m;
        // Rounding of a stroke read back from the limits is no reason to refuse it.
        if !(stroke_m > 0.0 && stroke_m <= (hi - lo) * (1.0 + 1e-12)) {
            return Err(StrokeError { asked_m: stroke_m, available_m: hi - lo });
        }
        let middle = 0.5 * (lo + hi);
        self.leg_length_m = [middle - 0.5 * stroke_m, middle + 0.5 * stroke_m];
        Ok(self)
    }

    /// Returns the machine with a share of its legs' stroke, or of its travel, left unused: half of it at
    /// either end.
    #[must_use]
    pub fn with_reserve(mut self, share: f64) -> Self {
        let [lo, hi] = self.leg_length_m;
        let (middle, half) = (0.5 * (lo + hi), 0.5 * (hi - lo) * (1.0 - share));
        self.leg_length_m = [middle - half, middle + half];
        self.travel = self.travel.map(|travel| travel.reaching(1.0 - share));
        self
    }

    /// Returns the machine with every limit brought in to a share of what it allows: of the stroke about its
    /// middle, of speeds, accelerations, forces and angles, and of `cond(H)`; clearances grow.
    #[must_use]
    pub fn within(&self, share: f64) -> Self {
        let [lo, hi] = self.leg_length_m;
        let (middle, half) = (0.5 * (lo + hi), 0.5 * (hi - lo) * share);
        let less = |limit: Option<f64>| limit.map(|v| v * share);
        let cones = |cones: &Option<JointCones>| {
            let narrower =
                |c: &JointCones| JointCones { half_angle_rad: c.half_angle_rad * share, ..c.clone() };
            cones.as_ref().map(narrower)
        };
        Self {
            leg_length_m: [middle - half, middle + half],
            leg_rate_mps: self.leg_rate_mps * share,
            limits: Limits {
                leg_acceleration_mps2: less(self.limits.leg_acceleration_mps2),
                leg_jerk_mps3: less(self.limits.leg_jerk_mps3),
                leg_force_n: less(self.limits.leg_force_n),
                leg_push_n: less(self.limits.leg_push_n),
                leg_pull_n: less(self.limits.leg_pull_n),
                leg_buckling_nm2: less(self.limits.leg_buckling_nm2),
                base_joints: cones(&self.limits.base_joints),
                plate_joints: cones(&self.limits.plate_joints),
                cond_max: self.limits.cond_max * share,
                bulk: self.limits.bulk.as_ref().map(|bulk| bulk.within(share)),
            },
            travel: self.travel.as_ref().map(|travel| travel.reaching(share).slower(share)),
            arm: self.arm.as_ref().map(|arm| arm.slower(share)),
            ..self.clone()
        }
    }

    /// Returns a level pose in the middle of the stroke: the plate's joints over the base's joints in the
    /// mean and, where all legs are alike, every leg half-way out; else the root mean square of their lengths
    /// is half-way. For a machine without joints it is the reference pose.
    pub fn home(&self) -> Pose {
        if !self.has_joints() {
            return Pose::default();
        }
        let [lo, hi] = self.leg_length_m;
        let middle = 0.5 * (lo + hi);
        let pairs = || self.base_joints_m.iter().zip(&self.plate_joints_m);
        let offset = |k: usize| {
            let mean = pairs().map(|(a, b)| a[k] - b[k]).sum::<f64>() / 6.0;
            // Rounding of a sum that vanishes.
            if mean.abs() < 1e-12 * middle { 0.0 } else { mean }
        };
        let (x, y) = (offset(0), offset(1));
        // Mean over the legs of |flat|² + (z − h)², h = a_z − b_z, set to middle².
        let height = offset(2);
        let rest = pairs()
            .map(|(a, b)| {
                let h = a[2] - b[2] - height;
                (x + b[0] - a[0]).powi(2) + (y + b[1] - a[1]).powi(2) + h * h
            })
            .sum::<f64>()
            / 6.0;
        let z = height + (middle * middle - rest).max(0.0).sqrt();
        Pose { position_m: [x, y, z], rpy_rad: [0.0; 3] }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::{Limit, MotionError, MotionProgram, Segment, Violation, rotation_from_rpy};

    fn some_pose() -> Pose {
        let [x, y, z] = Geometry::thesis().home().position_m;
        Pose { position_m: [x + 0.03, y - 0.02, z + 0.01], rpy_rad: [0.2, -0.3, 0.4] }
    }

    /// Applies a small motion of the plate in A: translation `d`, then rotation by the vector `r`
    /// (Rodrigues).
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
        assert!(
            matches!(error, MotionError::Limit { violation: Violation { limit: Limit::LegLength, .. }, .. }),
            "{error:?}"
        );
    }

    #[test]
    fn a_program_that_is_too_fast_names_leg_and_time() {
        let g = Geometry::thesis();
        let mut up = g.home();
        up.position_m[2] += 0.1;
        let program =
            MotionProgram { start: g.home(), segments: vec![Segment::Move { to: up, duration_s: 0.1 }] };
        let error = g.check(&program.trajectory().unwrap()).unwrap_err();
        assert!(
            matches!(error, MotionError::Limit { violation: Violation { limit: Limit::LegRate, .. }, .. }),
            "{error:?}"
        );
    }
}
