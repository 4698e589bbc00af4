//! The pose of the plate.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use super::rotation::{rotation_from_rpy, rpy_from_rotation};

/// Position and attitude of the plate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Pose {
    /// Origin of the plate's frame in A, m.
    pub position_m: [f64; 3],
    /// Roll, pitch, yaw about the fixed axes of A, rad.
    pub rpy_rad: [f64; 3],
}

impl Pose {
    /// Returns the six coordinates x, y, z, roll, pitch, yaw.
    pub fn coordinates(&self) -> [f64; 6] {
        let [x, y, z] = self.position_m;
        let [roll, pitch, yaw] = self.rpy_rad;
        [x, y, z, roll, pitch, yaw]
    }

    /// Returns `R_AP`, by rows.
    pub fn rotation(&self) -> [[f64; 3]; 3] {
        let r = rotation_from_rpy(self.rpy_rad);
        std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)]))
    }

    /// Returns the pose of these six coordinates.
    pub fn from_coordinates([x, y, z, roll, pitch, yaw]: [f64; 6]) -> Self {
        Self { position_m: [x, y, z], rpy_rad: [roll, pitch, yaw] }
    }
    /// Returns the attitude as a unit quaternion w, x, y, z: the product of the half-angle ones of yaw, pitch
    /// and roll.
    pub fn quaternion_wxyz(&self) -> [f64; 4] {
        let [(sr, cr), (sp, cp), (sy, cy)] = self.rpy_rad.map(|a| (0.5 * a).sin_cos());
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    }

    /// Returns the pose at a position, m, with the attitude of a unit quaternion w, x, y, z.
    pub fn from_quaternion(position_m: [f64; 3], [w, a, b, c]: [f64; 4]) -> Self {
        let rotation = Matrix3::new(
            1.0 - 2.0 * (b * b + c * c),
            2.0 * (a * b - w * c),
            2.0 * (a * c + w * b),
            2.0 * (a * b + w * c),
            1.0 - 2.0 * (a * a + c * c),
            2.0 * (b * c - w * a),
            2.0 * (a * c - w * b),
            2.0 * (b * c + w * a),
            1.0 - 2.0 * (a * a + b * b),
        );
        Self { position_m, rpy_rad: rpy_from_rotation(&rotation) }
    }
}
