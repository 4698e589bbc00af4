//! Inertial parameters that move with frames: φ as a plain vector of ten.

use nalgebra::{Matrix3, SMatrix, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::Body;

/// φ = [m, mcx, mcy, mcz, Ixx, Iyy, Izz, Iyz, Izx, Ixy] about a frame's origin.
pub type Parameters = [f64; 10];
/// A linear map of φ to φ.
pub type ParameterMap = SMatrix<f64, 10, 10>;

/// Returns `S(p, q) = pᵀq 1 − p qᵀ`, symmetrised: `2 p·q 1 − p qᵀ − q pᵀ`.
fn steiner(p: &Vector3<f64>, q: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::identity() * (2.0 * p.dot(q)) - p * q.transpose() - q * p.transpose()
}

/// Returns φ of a body about the parent's frame: R parent ← link, p the link's origin in the parent. Holds
/// for a mass of zero too.
///
/// `ms = M p + R MS`, `I = R J Rᵀ + M S(p) + S(p, R MS) + S(p, R MS)ᵀ`
pub fn in_parent(phi: &Parameters, rotation: &Matrix3<f64>, position: &Vector3<f64>) -> Parameters {
    let body = InertialParameters::<Body, f64>::from_vector(*phi);
    let turned = rotation * body.first_moment;
    let tensor = rotation * body.inertia * rotation.transpose()
        + steiner(position, position) * (0.5 * body.mass)
        + steiner(position, &turned);
    let ms = position * body.mass + turned;
    let i = tensor;
    [body.mass, ms.x, ms.y, ms.z, i.m11, i.m22, i.m33, i.m23, i.m31, i.m12]
}

/// Returns [`in_parent`] as a matrix.
pub fn map_to_parent(rotation: &Matrix3<f64>, position: &Vector3<f64>) -> ParameterMap {
    ParameterMap::from_fn(|row, column| {
        let unit = std::array::from_fn(|k| f64::from(u8::from(k == column)));
        in_parent(&unit, rotation, position)[row]
    })
}

/// Returns why no distribution of mass has these parameters; `None` if one has.
pub fn impossibility(phi: &Parameters) -> Option<String> {
    let body = InertialParameters::<Body, f64>::from_vector(*phi);
    if phi.iter().any(|v| !v.is_finite()) {
        return Some("its inertia holds a number that is not finite".to_owned());
    }
    if body.mass < 0.0 {
        return Some(format!("its mass is negative, {} kg", body.mass));
    }
    if body.mass == 0.0 {
        return Some("it has moments of inertia and no mass".to_owned());
    }
    if body.is_physically_consistent() {
        return None;
    }
    let moments = body.inertia_com().symmetric_eigenvalues();
    let mut sorted = [moments.x, moments.y, moments.z];
    sorted.sort_by(f64::total_cmp);
    let [a, b, c] = sorted;
    Some(format!(
        "no distribution of mass has its inertia: principal moments {a:.4e}, {b:.4e}, {c:.4e} kg m² about \
         the centre of mass{}",
        if a < 0.0 {
            ", one of them negative"
        } else if a + b < c {
            ", of which the largest exceeds the sum of the others"
        } else {
            ", flat or thinner to rounding"
        }
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;
    use rigident_shared::spatial::{Position, Rotation, Sensor};

    #[test]
    fn the_move_to_the_parent_is_that_by_the_centre_of_mass() {
        let q = [0.9, 0.1, -0.3, 0.2];
        let phi = [2.0, 0.2, -0.1, 0.4, 0.5, 0.6, 0.4, 0.01, -0.02, 0.03];
        let p = Vector3::new(0.3, -0.2, 0.5);
        let r = Rotation::<Sensor, Body, f64>::from_quaternion(q).unwrap();
        // Origin of the parent in the link's frame.
        let origin = -(r.matrix().transpose() * p);
        let oracle = InertialParameters::<Body, f64>::from_vector(phi)
            .expressed_in(&r, Position::new(origin.x, origin.y, origin.z))
            .to_vector();
        let got = in_parent(&phi, &r.matrix(), &p);
        let by_map = map_to_parent(&r.matrix(), &p) * SMatrix::<f64, 10, 1>::from(phi);
        for k in 0..10 {
            assert!((got[k] - oracle[k]).abs() < 1e-14, "{k}");
            assert!((by_map[k] - oracle[k]).abs() < 1e-14, "{k}");
        }
    }

    #[test]
    fn impossible_inertias_are_distinguished() {
        let body = |mass: f64, i: [f64; 3]| {
            let tensor = Matrix3::from_diagonal(&i.into());
            let turned = Rotation3::from_euler_angles(0.1, 0.2, 0.3);
            let tensor = turned * tensor * turned.inverse();
            InertialParameters::<Body, f64>::from_centre_of_mass(mass, Position::new(0.1, 0.0, 0.2), tensor)
                .to_vector()
        };
        assert_eq!(impossibility(&body(1.0, [0.1, 0.2, 0.25])), None);
        assert!(impossibility(&body(1.0, [0.1, 0.2, 0.35])).unwrap().contains("exceeds the sum"));
        assert!(impossibility(&body(1.0, [-0.1, 0.2, 0.2])).unwrap().contains("negative"));
        assert!(impossibility(&body(-1.0, [0.1, 0.2, 0.2])).unwrap().contains("mass is negative"));
        let massless = impossibility(&[0.0, 0.0, 0.0, 0.0, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0]).unwrap();
        assert!(massless.contains("no mass") && !massless.contains("NaN"), "{massless}");
        assert!(impossibility(&[f64::NAN; 10]).unwrap().contains("not finite"));
    }
}
