//! Rotations by roll, pitch and yaw about fixed axes.

use nalgebra::Matrix3;

/// Returns `R = Rz(yaw) Ry(pitch) Rx(roll)`.
pub fn rotation_from_rpy([roll, pitch, yaw]: [f64; 3]) -> Matrix3<f64> {
    let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
    rotation_from_sines((sr, cr), (sp, cp), (sy, cy))
}

/// Returns roll, pitch, yaw of a rotation, pitch within ±π/2. At a pitch of ±π/2 roll is taken as zero.
pub(super) fn rpy_from_rotation(r: &Matrix3<f64>) -> [f64; 3] {
    let level = r[(2, 1)].hypot(r[(2, 2)]);
    let pitch = (-r[(2, 0)]).atan2(level);
    if level > 1e-12 {
        [r[(2, 1)].atan2(r[(2, 2)]), pitch, r[(1, 0)].atan2(r[(0, 0)])]
    } else {
        [0.0, pitch, (-r[(0, 1)]).atan2(r[(1, 1)])]
    }
}

/// Returns the rotation of roll, pitch and yaw, given by their sines and cosines.
pub(super) fn rotation_from_sines(
    (sr, cr): (f64, f64),
    (sp, cp): (f64, f64),
    (sy, cy): (f64, f64),
) -> Matrix3<f64> {
    Matrix3::new(
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )
}
