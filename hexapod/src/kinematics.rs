//! The plate's rigid motion from six coordinates and their derivatives.

use nalgebra::{Matrix3, Vector3};

use super::pose::Pose;
use super::rotation::rotation_from_sines;

/// The six coordinates x, y, z, roll, pitch, yaw (m, rad) with first and second time derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coordinates {
    /// Values.
    pub value: [f64; 6],
    /// First derivatives, 1/s.
    pub rate: [f64; 6],
    /// Second derivatives, 1/s².
    pub acceleration: [f64; 6],
}

/// Rigid motion of the plate at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlateState {
    /// Roll, pitch, yaw, rad.
    pub rpy: Vector3<f64>,
    /// Origin of P in A, m.
    pub position: Vector3<f64>,
    /// Velocity of P's origin in A, m/s.
    pub velocity: Vector3<f64>,
    /// Acceleration of P's origin in A, m/s². Gravity is not in it.
    pub acceleration: Vector3<f64>,
    /// `R_AP`.
    pub rotation: Matrix3<f64>,
    /// Angular rate in the plate's axes, rad/s.
    pub angular_rate: Vector3<f64>,
    /// Time derivative of the angular rate in the plate's axes, rad/s².
    pub angular_acceleration: Vector3<f64>,
}

impl PlateState {
    /// Returns the pose alone.
    pub fn pose(&self) -> Pose {
        Pose { position_m: self.position.into(), rpy_rad: self.rpy.into() }
    }
}

impl Coordinates {
    /// Returns the coordinates of a rigid motion, pitch within ±π/2: `(roll', pitch', yaw') = E⁻¹ ω_P`, and
    /// the second derivatives from `ω̇_P − Ė (roll', pitch', yaw')`.
    pub(super) fn of_state(state: &PlateState) -> Self {
        let [roll, pitch, _] = state.rpy.into();
        let ((sr, cr), (sp, cp)) = (roll.sin_cos(), pitch.sin_cos());
        let inverse = |v: &Vector3<f64>| {
            let turn = sr * v.y + cr * v.z;
            Vector3::new(v.x + sp / cp * turn, cr * v.y - sr * v.z, turn / cp)
        };
        let rates = inverse(&state.angular_rate);
        let [dr, dp, dy] = rates.into();
        let drift = Vector3::new(
            -cp * dp * dy,
            -sr * dr * dp + (cp * cr * dr - sp * sr * dp) * dy,
            -cr * dr * dp - (cp * sr * dr + sp * cr * dp) * dy,
        );
        let second = inverse(&(state.angular_acceleration - drift));
        let six = |a: &Vector3<f64>, b: &Vector3<f64>| [a.x, a.y, a.z, b.x, b.y, b.z];
        Self {
            value: six(&state.position, &state.rpy),
            rate: six(&state.velocity, &rates),
            acceleration: six(&state.acceleration, &second),
        }
    }

    /// Returns the rigid motion. With `E(roll, pitch)` of the thesis, `ω_P = E (roll', pitch', yaw')` and
    /// `ω̇_P = E (roll'', pitch'', yaw'') + Ė (roll', pitch', yaw')`.
    pub fn plate_state(&self) -> PlateState {
        let [x, y, z, roll, pitch, yaw] = self.value;
        let [vx, vy, vz, dr, dp, dy] = self.rate;
        let [ax, ay, az, ddr, ddp, ddy] = self.acceleration;
        let ((sr, cr), (sp, cp)) = (roll.sin_cos(), pitch.sin_cos());
        let angular_rate = Vector3::new(dr - sp * dy, cr * dp + cp * sr * dy, -sr * dp + cp * cr * dy);
        let angular_acceleration = Vector3::new(
            ddr - sp * ddy - cp * dp * dy,
            cr * ddp + cp * sr * ddy - sr * dr * dp + (cp * cr * dr - sp * sr * dp) * dy,
            -sr * ddp + cp * cr * ddy - cr * dr * dp - (cp * sr * dr + sp * cr * dp) * dy,
        );
        PlateState {
            rpy: Vector3::new(roll, pitch, yaw),
            position: Vector3::new(x, y, z),
            velocity: Vector3::new(vx, vy, vz),
            acceleration: Vector3::new(ax, ay, az),
            rotation: rotation_from_sines((sr, cr), (sp, cp), yaw.sin_cos()),
            angular_rate,
            angular_acceleration,
        }
    }
}
