//! The vector loop, the leg Jacobian and what follows from them: speeds, accelerations, forces of the legs.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use super::geometry::Geometry;
use super::kinematics::PlateState;
use super::pose::Pose;
use super::rotation::rotation_from_rpy;

/// The six legs at one pose of the plate. Everything in A.
#[derive(Clone, Copy, Debug)]
pub struct Legs {
    /// `R b_i`: from the plate's origin to the plate's joints, m.
    pub arms: [Vector3<f64>; 6],
    /// `n_i`: unit vectors from base joint to plate joint.
    pub directions: [Vector3<f64>; 6],
    /// `|l_i|`, m.
    pub lengths: [f64; 6],
}

impl Legs {
    /// Returns the Jacobian. Row `i` times `[v; ω]` (the plate's velocity and angular rate in A) is the speed
    /// of leg `i`: `[n_i, (R b_i) × n_i]`. m and rad.
    pub fn jacobian(&self) -> Matrix6<f64> {
        self.force_transmission().transpose()
    }

    /// Returns `H`, which takes six leg forces (N, positive when a leg pushes) to the force and moment about
    /// the plate's origin that they exert on the plate, in A. Columns `[n_i ; (R b_i) × n_i]` (thesis). It is
    /// the Jacobian's transpose.
    pub fn force_transmission(&self) -> Matrix6<f64> {
        let mut h = Matrix6::zeros();
        for (i, (arm, n)) in self.arms.iter().zip(&self.directions).enumerate() {
            h.fixed_view_mut::<3, 1>(0, i).copy_from(n);
            h.fixed_view_mut::<3, 1>(3, i).copy_from(&arm.cross(n));
        }
        h
    }

    /// Returns `H` with moments over a length, m: forces (N) to forces, whatever the machine's size.
    pub fn force_transmission_over(&self, length_m: f64) -> Matrix6<f64> {
        let mut h = self.force_transmission();
        h.fixed_rows_mut::<3>(3).unscale_mut(length_m);
        h
    }

    /// Returns `cond(H)`: 2-norm, moments over a length, m. Infinite where the platform is singular.
    pub fn condition_over(&self, length_m: f64) -> f64 {
        condition_number(&self.force_transmission_over(length_m))
    }

    /// Returns whether `cond(H) ≤ limit`, moments over a length, m. Cheaper than the number itself: mostly
    /// decided by `cond₂ ≤ ‖H‖_F ‖H⁻¹‖_F`.
    pub fn is_conditioned_within(&self, limit: f64, length_m: f64) -> bool {
        let h = self.force_transmission_over(length_m);
        match h.try_inverse() {
            Some(inverse) if h.norm() * inverse.norm() <= limit => true,
            Some(_) => condition_number(&h) <= limit,
            None => false,
        }
    }

    /// Speeds of the legs, m/s, when the plate moves with `velocity` and `angular_rate` (A; m/s, rad/s).
    pub fn rates(&self, velocity: &Vector3<f64>, angular_rate: &Vector3<f64>) -> [f64; 6] {
        std::array::from_fn(|i| self.directions[i].dot(&(velocity + angular_rate.cross(&self.arms[i]))))
    }

    /// Returns the second time derivatives of the leg lengths, m/s². With `u` the velocity of a plate joint,
    /// `l'' = n·u' + (|u|² − (n·u)²) / l`; everything in A.
    pub fn accelerations(
        &self,
        velocity: &Vector3<f64>,
        angular_rate: &Vector3<f64>,
        acceleration: &Vector3<f64>,
        angular_acceleration: &Vector3<f64>,
    ) -> [f64; 6] {
        std::array::from_fn(|i| {
            let (n, arm) = (&self.directions[i], &self.arms[i]);
            let whirl = angular_rate.cross(arm);
            let u = velocity + whirl;
            let du = acceleration + angular_acceleration.cross(arm) + angular_rate.cross(&whirl);
            let along = n.dot(&u);
            n.dot(&du) + (u.dot(&u) - along * along) / self.lengths[i]
        })
    }

    /// Returns the leg forces (N, positive when a leg pushes) that together exert `wrench` (force and moment
    /// about the plate's origin, in A) on the plate. `None` where the platform is singular.
    pub fn forces(&self, wrench: &Vector6<f64>) -> Option<[f64; 6]> {
        self.force_transmission().lu().solve(wrench).map(Into::into)
    }
}

/// Returns the ratio of the largest to the smallest singular value.
pub(super) fn condition_number(h: &Matrix6<f64>) -> f64 {
    let s = h.singular_values();
    let (max, min) = (s.max(), s.min());
    if min > f64::EPSILON * max { max / min } else { f64::INFINITY }
}

impl Geometry {
    /// Returns the legs when the plate's origin is at `position` (A, m) and its axes are the columns of
    /// `rotation`: `l_i = x + R b_i − a_i`.
    pub fn legs_at(&self, position: &Vector3<f64>, rotation: &Matrix3<f64>) -> Legs {
        let arms = self.plate_joints_m.map(|b| rotation * Vector3::from(b));
        let loops: [Vector3<f64>; 6] =
            std::array::from_fn(|i| position + arms[i] - Vector3::from(self.base_joints_m[i]));
        let lengths = loops.map(|l| l.norm());
        let directions = std::array::from_fn(|i| loops[i] / lengths[i]);
        Legs { arms, directions, lengths }
    }

    /// Returns the legs at a pose.
    pub fn legs(&self, pose: &Pose) -> Legs {
        self.legs_at(&Vector3::from(pose.position_m), &rotation_from_rpy(pose.rpy_rad))
    }

    /// Lengths of the six legs, m: the inverse kinematics.
    pub fn leg_lengths(&self, pose: &Pose) -> [f64; 6] {
        self.legs(pose).lengths
    }

    /// Returns the inverse-kinematics Jacobian, see [`Legs::jacobian`].
    pub fn jacobian(&self, pose: &Pose) -> [[f64; 6]; 6] {
        // nalgebra keeps columns: the columns of H are the Jacobian's rows.
        self.legs(pose).force_transmission().into()
    }

    /// Returns the root mean square of the distances of the plate's joints from their mean, m.
    pub fn joint_radius_m(&self) -> f64 {
        let joints = self.plate_joints_m.map(Vector3::from);
        let mean = joints.iter().sum::<Vector3<f64>>() / 6.0;
        (joints.iter().map(|joint| (joint - mean).norm_squared()).sum::<f64>() / 6.0).sqrt()
    }

    /// Returns the length that moments are divided by where `cond(H)` is taken: four times
    /// [`Geometry::joint_radius_m`], m. A machine and its enlargement have the same number; of the built-in
    /// platform it is one metre.
    pub fn moment_length_m(&self) -> f64 {
        4.0 * self.joint_radius_m()
    }

    /// Returns `cond(H)` at a pose, moments over [`Geometry::moment_length_m`].
    pub fn condition_number(&self, pose: &Pose) -> f64 {
        self.legs(pose).condition_over(self.moment_length_m())
    }

    /// Speeds of the six legs, m/s, positive when a leg extends.
    pub fn leg_rates(&self, state: &PlateState) -> [f64; 6] {
        let legs = self.legs_at(&state.position, &state.rotation);
        legs.rates(&state.velocity, &(state.rotation * state.angular_rate))
    }

    /// Accelerations of the six legs, m/s², positive when a leg's extension speeds up.
    pub fn leg_accelerations(&self, state: &PlateState) -> [f64; 6] {
        let legs = self.legs_at(&state.position, &state.rotation);
        let turned = |v| state.rotation * v;
        legs.accelerations(
            &state.velocity,
            &turned(state.angular_rate),
            &state.acceleration,
            &turned(state.angular_acceleration),
        )
    }

    /// Returns whether all legs are inside their lengths. The cheapest question that can be asked of a pose:
    /// no roots, no divisions.
    pub fn reaches(&self, position: &Vector3<f64>, rotation: &Matrix3<f64>) -> bool {
        let [min, max] = self.leg_length_m;
        let (min, max) = (min * min, max * max);
        self.base_joints_m.iter().zip(&self.plate_joints_m).all(|(a, b)| {
            let l = position + rotation * Vector3::from(*b) - Vector3::from(*a);
            let square = l.dot(&l);
            min <= square && square <= max
        })
    }
}
