//! Turns: their logarithms, how these change, and their part about the vertical.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Angles below this, rad, have the coefficient of their logarithm by its series.
const SMALL_ANGLE: f64 = 1e-4;

/// Returns the turn of a rotation, rad; by a quaternion, which loses no digits near none.
pub(super) fn turn_of(rotation: &Rotation3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_rotation_matrix(rotation).scaled_axis()
}

/// `J⁻¹` of `log(exp(ρ) exp(−φ)) ≈ ρ − J⁻¹ φ`.
pub(super) fn log_slope(rho: &Vector3<f64>) -> Matrix3<f64> {
    let angle = rho.norm();
    let cross = rho.cross_matrix();
    let by = if angle < SMALL_ANGLE {
        1.0 / 12.0
    } else {
        (1.0 - 0.5 * angle * (0.5 * angle).cos() / (0.5 * angle).sin()) / (angle * angle)
    };
    Matrix3::identity() + 0.5 * cross + by * cross * cross
}

/// Returns the turn about the vertical that comes nearest to a rotation.
pub(super) fn heading(rotation: &Rotation3<f64>) -> Rotation3<f64> {
    let q = UnitQuaternion::from_rotation_matrix(rotation);
    Rotation3::from_axis_angle(&Vector3::z_axis(), 2.0 * q.k.atan2(q.w))
}
