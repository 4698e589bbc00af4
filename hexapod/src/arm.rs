//! An arm that carries the plate: six hinges in a row, their limits, and the joint path that a motion of the
//! plate takes.
//!
//! The flange is the plate. A lies with its origin where the flange is with the joints at home, its axes
//! along those of the arm's base; P is fixed to the flange and coincides with A at home. A motion becomes a
//! path by inverse kinematics, one set of positions every [`STEP_S`], each found from the one before. These
//! are the control points of a uniform cubic B-spline, the path that the controller follows. It lies in the
//! convex hull of its control points, its derivatives in those of their differences: limits that all points,
//! `Δ/h` and `Δ²/h²` keep are kept at every instant, between the points too.

use nalgebra::{Matrix3, Matrix6, Rotation3, UnitQuaternion, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use super::limits::{Limit, Violation};
use super::mounting::Mounting;
use super::pose::Pose;
use super::rotation::rpy_from_rotation;
use super::trajectory::Trajectory;

/// Time between two control points of the joint path, s.
pub const STEP_S: f64 = 0.02;
/// Steps of Newton's method for one pose.
const ITERATIONS: usize = 30;
/// The flange is there when it is nearer than this, m and rad.
const THERE: f64 = 1e-10;
/// Damping, m and rad: joints that turn the flange by less for a radian do not answer to it.
const DAMPING: f64 = 1e-3;
/// Steps of the way from home, m and rad, on which a pose without a neighbour is found.
const WAY: f64 = 0.05;
/// Longest step of one joint between neighbours, rad: farther lies another posture.
const JUMP_RAD: f64 = 0.5;

/// A hinge of an arm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hinge {
    /// The hinge's name.
    pub name: String,
    /// The hinge's frame in that of the hinge before, or in the base's for the first, at position zero.
    pub place: Mounting,
    /// The hinge's axis in its own frame; need not be of unit length.
    pub axis: [f64; 3],
    /// Least and greatest position, rad.
    pub range_rad: [f64; 2],
    /// Highest rate, rad/s.
    pub rate_radps: f64,
    /// Highest acceleration, rad/s².
    pub acceleration_radps2: f64,
}

/// An arm of six hinges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arm {
    /// The hinges from the base to the flange.
    pub hinges: [Hinge; 6],
    /// The flange in the last hinge's frame.
    pub flange: Mounting,
    /// Positions with the plate in its reference pose, rad.
    pub home_rad: [f64; 6],
    /// Heaviest mass at the flange, kg, if it is limited.
    pub payload_kg: Option<f64>,
}

/// Control points of a joint path, [`STEP_S`] apart.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmPath {
    /// Positions, rad.
    pub points_rad: Vec<[f64; 6]>,
}

/// The largest share that a path uses of one limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmPeak {
    /// The limit.
    pub limit: Limit,
    /// The joint, from 1.
    pub joint: usize,
    /// The distance of a position from the middle of its range, rad, or the magnitude of a rate or an
    /// acceleration, rad/s or rad/s².
    pub value: f64,
    /// Half the range, or the limit.
    pub allowed: f64,
    /// When, s.
    pub time_s: f64,
}

/// Frames of the hinges and of the flange in the base.
struct Chain {
    places: [(Vector3<f64>, Matrix3<f64>); 6],
    axes: [Vector3<f64>; 6],
    flange: (Vector3<f64>, Matrix3<f64>),
    home: (Vector3<f64>, Matrix3<f64>),
}

fn frame(mounting: &Mounting) -> (Vector3<f64>, Matrix3<f64>) {
    (Vector3::from(mounting.position_m), mounting.rotation().unwrap_or_else(Matrix3::identity))
}

/// Returns the rotation vector, rad; a quaternion has all digits of small turns, the trace a half.
fn rotation_vector(r: &Matrix3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*r)).scaled_axis()
}

impl Chain {
    fn new(arm: &Arm) -> Self {
        let axis = |hinge: &Hinge| Vector3::from(hinge.axis).try_normalize(1e-9).unwrap_or_else(Vector3::z);
        let mut chain = Self {
            places: std::array::from_fn(|i| frame(&arm.hinges[i].place)),
            axes: std::array::from_fn(|i| axis(&arm.hinges[i])),
            flange: frame(&arm.flange),
            home: (Vector3::zeros(), Matrix3::identity()),
        };
        chain.home = chain.forward(&arm.home_rad).0;
        chain
    }

    /// Returns the flange in the base, and the Jacobian of its velocity and angular rate, base axes.
    fn forward(&self, q: &[f64; 6]) -> ((Vector3<f64>, Matrix3<f64>), Matrix6<f64>) {
        let (mut at, mut turn) = (Vector3::zeros(), Matrix3::identity());
        let mut hinges = [(Vector3::zeros(), Vector3::zeros()); 6];
        for (i, (place, rotation)) in self.places.iter().enumerate() {
            at += turn * place;
            turn *= rotation;
            hinges[i] = (at, turn * self.axes[i]);
            turn *= Rotation3::from_scaled_axis(self.axes[i] * q[i]).into_inner();
        }
        let tip = at + turn * self.flange.0;
        let mut jacobian = Matrix6::zeros();
        for (i, (origin, axis)) in hinges.iter().enumerate() {
            let velocity = axis.cross(&(tip - origin));
            jacobian.fixed_view_mut::<3, 1>(0, i).copy_from(&velocity);
            jacobian.fixed_view_mut::<3, 1>(3, i).copy_from(axis);
        }
        ((tip, turn * self.flange.1), jacobian)
    }

    /// Returns the flange in the base for a plate in A.
    fn wanted(&self, position: Vector3<f64>, rotation: &Matrix3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        (self.home.0 + position, rotation * self.home.1)
    }

    /// Returns positions for a place of the flange, from positions near it; `None` where there are none.
    fn solve(&self, wanted: &(Vector3<f64>, Matrix3<f64>), near: &[f64; 6]) -> Option<[f64; 6]> {
        let mut q = *near;
        for _ in 0..ITERATIONS {
            let ((position, rotation), jacobian) = self.forward(&q);
            let turn = rotation_vector(&(wanted.1 * rotation.transpose()));
            let way = wanted.0 - position;
            let error = Vector6::new(way.x, way.y, way.z, turn.x, turn.y, turn.z);
            if error.iter().any(|e| !e.is_finite()) {
                return None;
            }
            if error.amax() < THERE {
                return Some(q);
            }
            let square = jacobian * jacobian.transpose() + Matrix6::identity() * (DAMPING * DAMPING);
            let step = jacobian.transpose() * square.cholesky()?.solve(&error);
            let longest = step.amax();
            let share = if longest > JUMP_RAD { JUMP_RAD / longest } else { 1.0 };
            q.iter_mut().zip(step.iter()).for_each(|(q, step)| *q += share * step);
        }
        None
    }
}

impl Arm {
    /// Returns the pose of the plate for joint positions, rad.
    pub fn pose(&self, q: &[f64; 6]) -> Pose {
        let chain = Chain::new(self);
        let ((position, rotation), _) = chain.forward(q);
        let turn = rotation * chain.home.1.transpose();
        Pose { position_m: (position - chain.home.0).into(), rpy_rad: rpy_from_rotation(&turn) }
    }

    /// Returns joint positions for a pose, rad, in the posture of home: found on the straight way from there.
    pub fn positions(&self, pose: &Pose) -> Option<[f64; 6]> {
        let chain = Chain::new(self);
        let rotation = crate::rotation_from_rpy(pose.rpy_rad);
        let (to, turned) = (Vector3::from(pose.position_m), rotation_vector(&rotation));
        let steps = (to.norm().max(turned.norm()) / WAY).ceil().clamp(1.0, 1e4) as usize;
        let mut q = self.home_rad;
        for k in 1..=steps {
            let share = k as f64 / steps as f64;
            let part = Rotation3::from_scaled_axis(turned * share).into_inner();
            q = self.next(&chain, &chain.wanted(to * share, &part), &q)?;
        }
        Some(q)
    }

    /// Returns positions for a neighbouring pose, rad; `None` where the arm does not reach it, or only in
    /// another posture.
    pub fn follow(&self, pose: &Pose, near: &[f64; 6]) -> Option<[f64; 6]> {
        let chain = Chain::new(self);
        let rotation = crate::rotation_from_rpy(pose.rpy_rad);
        self.next(&chain, &chain.wanted(Vector3::from(pose.position_m), &rotation), near)
    }

    fn next(
        &self,
        chain: &Chain,
        wanted: &(Vector3<f64>, Matrix3<f64>),
        near: &[f64; 6],
    ) -> Option<[f64; 6]> {
        let q = chain.solve(wanted, near)?;
        q.iter().zip(near).all(|(a, b)| (a - b).abs() < JUMP_RAD).then_some(q)
    }

    /// Checks whether the plate can be at a pose.
    ///
    /// # Errors
    /// It is out of reach, or a joint out of its range.
    pub fn check_pose(&self, pose: &Pose) -> Result<(), Violation> {
        let q = self.positions(pose).ok_or(unreachable_pose())?;
        let worst =
            (0..6).map(|i| self.position_peak(i, q[i], 0.0)).max_by(|a, b| a.share().total_cmp(&b.share()));
        match worst.filter(|peak| peak.share() > 1.0) {
            Some(peak) => Err(self.violation(&peak)),
            None => Ok(()),
        }
    }

    /// Returns the joint path of a motion of the plate.
    ///
    /// # Errors
    /// A pose that is out of reach, and when.
    pub fn path(&self, trajectory: &Trajectory) -> Result<ArmPath, (Violation, f64)> {
        let chain = Chain::new(self);
        let mut q = self.positions(&trajectory.start_pose()).ok_or((unreachable_pose(), 0.0))?;
        let steps = (trajectory.duration_s() / STEP_S).ceil() as usize;
        let mut points_rad = Vec::with_capacity(steps + 1);
        for k in 0..=steps {
            let time_s = k as f64 * STEP_S;
            let state = trajectory.state(time_s);
            let wanted = chain.wanted(state.position, &state.rotation);
            q = self.next(&chain, &wanted, &q).ok_or((unreachable_pose(), time_s))?;
            points_rad.push(q);
        }
        Ok(ArmPath { points_rad })
    }

    /// Returns the largest shares of the limits that a motion uses at any instant: position, rate,
    /// acceleration.
    ///
    /// # Errors
    /// A pose that is out of reach, and when.
    pub fn peaks(&self, trajectory: &Trajectory) -> Result<[ArmPeak; 3], (Violation, f64)> {
        Ok(self.peaks_of(&self.path(trajectory)?))
    }

    /// Returns the largest shares of the limits that a path uses: position, rate, acceleration.
    pub fn peaks_of(&self, path: &ArmPath) -> [ArmPeak; 3] {
        let none = |limit| ArmPeak { limit, joint: 1, value: 0.0, allowed: 1.0, time_s: 0.0 };
        let mut peaks = [none(Limit::ArmPosition), none(Limit::ArmRate), none(Limit::ArmAcceleration)];
        let points = &path.points_rad;
        let at = |k: usize| &points[k.min(points.len() - 1)];
        for k in 0..points.len() {
            // Before the first point and after the last the arm rests there.
            let (before, now, after) = (at(k.saturating_sub(1)), at(k), at(k + 1));
            let time_s = k as f64 * STEP_S;
            for (i, hinge) in self.hinges.iter().enumerate() {
                let magnitude = |limit, value: f64, allowed| ArmPeak {
                    limit,
                    joint: i + 1,
                    value: value.abs(),
                    allowed,
                    time_s,
                };
                let second = (after[i] - 2.0 * now[i] + before[i]) / (STEP_S * STEP_S);
                let found = [
                    self.position_peak(i, now[i], time_s),
                    magnitude(Limit::ArmRate, (after[i] - now[i]) / STEP_S, hinge.rate_radps),
                    magnitude(Limit::ArmAcceleration, second, hinge.acceleration_radps2),
                ];
                for (most, found) in peaks.iter_mut().zip(found) {
                    if found.share() > most.share() || found.share().is_nan() {
                        *most = found;
                    }
                }
            }
        }
        peaks
    }

    /// Checks whether a motion keeps every limit of the joints at every instant.
    ///
    /// # Errors
    /// The first limit in the order of position, rate and acceleration, with joint and time.
    pub fn check(&self, trajectory: &Trajectory) -> Result<(), (Violation, f64)> {
        let peaks = self.peaks(trajectory)?;
        match peaks.iter().find(|peak| peak.share().is_nan() || peak.share() > 1.0) {
            Some(peak) => Err((self.violation(peak), peak.time_s)),
            None => Ok(()),
        }
    }

    /// Returns the arm with rates and accelerations limited to a share of its own.
    #[must_use]
    pub fn slower(&self, share: f64) -> Self {
        let mut slower = self.clone();
        for hinge in &mut slower.hinges {
            hinge.rate_radps *= share;
            hinge.acceleration_radps2 *= share;
        }
        slower
    }

    fn position_peak(&self, i: usize, q: f64, time_s: f64) -> ArmPeak {
        let [low, high] = self.hinges[i].range_rad;
        let value = (q - 0.5 * (low + high)).abs();
        ArmPeak { limit: Limit::ArmPosition, joint: i + 1, value, allowed: 0.5 * (high - low), time_s }
    }

    /// Returns a peak beyond its limit as a violation.
    pub fn violation(&self, peak: &ArmPeak) -> Violation {
        let allowed = [-peak.allowed, peak.allowed];
        Violation { limit: peak.limit, leg: Some(peak.joint), between: None, value: peak.value, allowed }
    }
}

impl ArmPeak {
    /// Returns the share of the limit that is used: one is all of it.
    pub fn share(&self) -> f64 {
        self.value / self.allowed
    }
}

/// Returns the violation of a pose that the arm cannot take.
pub(super) fn unreachable_pose() -> Violation {
    Violation { limit: Limit::ArmReach, leg: None, between: None, value: f64::INFINITY, allowed: [0.0, 1.0] }
}

#[cfg(test)]
#[path = "arm_tests.rs"]
mod tests;
