//! Places of frames in other frames: sensors on the plate, bodies on sensors.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// The place of a frame in another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mounting {
    /// The origin of the frame, m.
    pub position_m: [f64; 3],
    /// Takes its axes to the other's; Hamilton w, x, y, z, normalised when used.
    pub rotation_wxyz: [f64; 4],
}

impl Mounting {
    /// The place of a frame in itself.
    pub const IDENTITY: Self = Self { position_m: [0.0; 3], rotation_wxyz: [1.0, 0.0, 0.0, 0.0] };

    /// Returns the rotation as a matrix; `None` for a quaternion that is zero or not finite.
    pub fn rotation(&self) -> Option<Matrix3<f64>> {
        let [w, x, y, z] = self.rotation_wxyz;
        let n = (w * w + x * x + y * y + z * z).sqrt();
        if !(n.is_finite() && n > 0.0) {
            return None;
        }
        let (s, v) = (w / n, Vector3::new(x, y, z) / n);
        // v' = v + 2 s u×v + 2 u×(u×v), column by column.
        let turn = |e: Vector3<f64>| {
            let t = 2.0 * v.cross(&e);
            e + s * t + v.cross(&t)
        };
        Some(Matrix3::from_columns(&[turn(Vector3::x()), turn(Vector3::y()), turn(Vector3::z())]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mounting_turns_like_its_quaternion() {
        // (0.5, −0.5, 0.5, 0.5): x → −z, y → −x, z → y.
        let r = Mounting { position_m: [0.0; 3], rotation_wxyz: [0.5, -0.5, 0.5, 0.5] }.rotation().unwrap();
        assert_eq!(r, Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0));
    }
}
