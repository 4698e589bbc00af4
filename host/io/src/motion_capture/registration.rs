//! Rigid registration: the pose of a body from where its markers were seen.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Returns the rotation nearest to a matrix, by its singular values (S. Umeyama 1991); `None` if there are
/// none.
pub fn nearest_rotation(matrix: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let svd = matrix.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let sign = if (u * v_t).determinant() < 0.0 { -1.0 } else { 1.0 };
    // Singular values fall: the mirror image costs least along the last.
    Some(u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t)
}

/// Returns position (m) and attitude of a body whose markers are at `own_m` in its frame and were seen at
/// `seen_m`, least squares; `None` if fewer than three were seen, or those are on a line.
///
/// ```
/// use nalgebra::Vector3;
/// use rigident_io::motion_capture::registration::register;
///
/// let own = [Vector3::x(), Vector3::y(), Vector3::z()];
/// let seen = own.map(|at| Some(at + Vector3::new(0.1, 0.2, 0.3)));
/// let (position, attitude) = register(&own, &seen).unwrap();
/// assert!((position - Vector3::new(0.1, 0.2, 0.3)).norm() < 1e-12 && attitude.angle() < 1e-7);
/// ```
pub fn register(
    own_m: &[Vector3<f64>],
    seen_m: &[Option<Vector3<f64>>],
) -> Option<(Vector3<f64>, UnitQuaternion<f64>)> {
    let pairs: Vec<(Vector3<f64>, Vector3<f64>)> =
        own_m.iter().zip(seen_m).filter_map(|(own, seen)| Some((*own, (*seen)?))).collect();
    if pairs.len() < 3 {
        return None;
    }
    let n = pairs.len() as f64;
    let (own, seen) =
        pairs.iter().fold((Vector3::zeros(), Vector3::zeros()), |s, p| (s.0 + p.0 / n, s.1 + p.1 / n));
    let cross: Matrix3<f64> = pairs.iter().map(|p| (p.1 - seen) * (p.0 - own).transpose()).sum();
    let spread = cross.singular_values();
    if spread[1] <= 1e-9 * spread[0] {
        return None;
    }
    let turn = nearest_rotation(&cross)?;
    let attitude = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    Some((seen - turn * own, attitude))
}
