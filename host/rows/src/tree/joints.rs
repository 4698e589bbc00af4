//! Coordinates and rates of joints from attitudes and gyros of links, or from columns of their own.

use nalgebra::{Matrix2, Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector2, Vector3};
use rigident_shared::tree::{Joint, Link};

/// The knowledge of a joint at one instant.
#[derive(Clone, Debug, PartialEq)]
pub enum Seen {
    /// Attitude of its link relative to S (S axes ← link axes) and the link's rate, link axes, rad/s.
    Link {
        /// Attitude.
        attitude: Matrix3<f64>,
        /// Rate.
        rate: Vector3<f64>,
    },
    /// Coordinate of the joint and its rate.
    Coordinate(f64, f64),
}

/// A link at one instant: its attitude and rate as measured, and the coordinates and rates of its joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolved {
    /// S axes ← link axes.
    pub attitude: Matrix3<f64>,
    /// Link axes, rad/s.
    pub rate: Vector3<f64>,
    /// The joint's coordinates, as [`rigident_model::rows::Moving::set`] takes them.
    pub positions: Vec<f64>,
    /// The joint's rates, as [`rigident_model::rows::Moving::set`] takes them.
    pub rates: Vec<f64>,
    /// Angle by which the measured attitude is turned against what the joint can do, rad.
    pub misfit: f64,
}

/// Returns the rotation S axes ← link axes of a quaternion w, x, y, z; `None` if that is none.
pub fn attitude(q: &[f64; 4]) -> Option<Matrix3<f64>> {
    let quaternion = Quaternion::new(q[0], q[1], q[2], q[3]);
    // As tolerant as rig files are.
    let norm = quaternion.norm();
    (norm.is_finite() && (norm - 1.0).abs() < 0.01)
        .then(|| UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix().into_inner())
}

fn turn(axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    rigident_shared::tree::joint::turn(axis, angle.sin(), angle.cos())
}

/// Returns the angle of the rotation about `axis` that is nearest to `r`.
fn angle_about(r: &Matrix3<f64>, axis: &Vector3<f64>) -> f64 {
    // tr(R(−a, q) r) is largest: tan q = a·axial(r) / (tr r − a·r a)
    axis.dot(&axial(r)).atan2(r.trace() - axis.dot(&(r * axis)))
}

fn axial(r: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12)
}

fn angle_of(r: &Matrix3<f64>) -> f64 {
    axial(r).norm().atan2(r.trace() - 1.0)
}

/// Resolves the joint of a link, seen from its parent.
///
/// Returns `None` for what cannot be determined: a joint that slides or is free, by attitudes; one of several
/// freedoms, by a coordinate.
pub fn resolve(link: &Link<f64>, parent: &Resolved, seen: &Seen) -> Option<Resolved> {
    match seen {
        Seen::Coordinate(q, v) => {
            let (relative, rate) = match &link.joint {
                Joint::Revolute(axis) => (link.rotation * turn(axis, *q), axis * *v),
                Joint::Prismatic(_) => (link.rotation, Vector3::zeros()),
                _ => return None,
            };
            Some(Resolved {
                attitude: parent.attitude * relative,
                rate: relative.tr_mul(&parent.rate) + rate,
                positions: vec![*q],
                rates: vec![*v],
                misfit: 0.0,
            })
        }
        Seen::Link { attitude, rate } => {
            let relative = parent.attitude.tr_mul(attitude);
            let turned = link.rotation.tr_mul(&relative);
            let spin = rate - relative.tr_mul(&parent.rate);
            let (positions, rates, misfit) = match &link.joint {
                Joint::Spherical => {
                    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turned));
                    (vec![q.w, q.i, q.j, q.k], vec![spin.x, spin.y, spin.z], 0.0)
                }
                Joint::Revolute(axis) => {
                    let q = angle_about(&turned, axis);
                    (vec![q], vec![axis.dot(&spin)], angle_of(&turn(axis, q).tr_mul(&turned)))
                }
                Joint::Universal(first, second) => {
                    let (qa, qb) = universal(&turned, first, second);
                    let inner = turn(second, qb);
                    let carried = inner.tr_mul(first);
                    // ω = R₂ᵀ a v₁ + b v₂
                    let c = carried.dot(second);
                    let solve = Matrix2::new(1.0, c, c, 1.0).try_inverse()?;
                    let v = solve * Vector2::new(carried.dot(&spin), second.dot(&spin));
                    let fitted = turn(first, qa) * inner;
                    (vec![qa, qb], vec![v.x, v.y], angle_of(&fitted.tr_mul(&turned)))
                }
                Joint::Fixed | Joint::Prismatic(_) | Joint::Free => return None,
            };
            Some(Resolved { attitude: *attitude, rate: *rate, positions, rates, misfit })
        }
    }
}

/// Angles of the turn about `a` and then about `b` nearest to `r`: exact if it is one, else by turns.
fn universal(r: &Matrix3<f64>, a: &Vector3<f64>, b: &Vector3<f64>) -> (f64, f64) {
    // R b = R(a, q₁) b: the angle about a from b to R b.
    let (from, to) = (b - a * a.dot(b), r * b);
    let to = to - a * a.dot(&to);
    let mut first = a.dot(&from.cross(&to)).atan2(from.dot(&to));
    let mut second = angle_about(&(turn(a, first).transpose() * r), b);
    for _ in 0..3 {
        first = angle_about(&(r * turn(b, second).transpose()), a);
        second = angle_about(&(turn(a, first).transpose() * r), b);
    }
    (first, second)
}

#[cfg(test)]
mod tests {
    use rigident_shared::tree::{BaseMotion, JointMotion, LinkState, motion};

    use super::*;

    /// The values of a chain by ideal IMUs and attitudes of links, by the shared kinematics.
    #[test]
    fn joints_are_those_that_moved_the_links() {
        let skew = Vector3::new(0.3, -0.5, 0.7).normalize();
        let turned = Rotation3::from_euler_angles(0.4, -0.2, 1.0).into_inner();
        let link =
            |parent, joint| Link { parent, joint, rotation: turned, position: Vector3::new(0.1, 0.2, 0.3) };
        let links = [
            link(0, Joint::Free),
            link(0, Joint::Revolute(skew)),
            link(1, Joint::Universal(Vector3::x(), Vector3::new(0.1, 0.9, 0.2).normalize())),
            link(2, Joint::Spherical),
            link(3, Joint::Prismatic(skew)),
        ];
        let ball = Rotation3::from_euler_angles(1.0, 0.3, -2.0).into_inner();
        let Joint::Universal(a, b) = links[2].joint else { unreachable!() };
        let moves = [
            JointMotion::rest(&links[0]),
            JointMotion::revolute(&links[1], &skew, 2.5_f64.sin_cos(), 0.7, 0.0),
            JointMotion::universal(
                &links[2],
                [&a, &b],
                [0.6_f64.sin_cos(), (-1.1_f64).sin_cos()],
                [0.4, -0.9],
                [0.0; 2],
            ),
            JointMotion::spherical(&links[3], &ball, [0.1, -0.2, 0.3], [0.0; 3]),
            JointMotion::prismatic(&links[4], &skew, 0.2, 0.5, 0.0),
        ];
        let base = BaseMotion {
            specific_force: Vector3::z(),
            rate: Vector3::new(0.3, 0.2, -0.5),
            angular_acceleration: Vector3::zeros(),
        };
        let mut states = [LinkState::zero(); 5];
        motion::states(&links, &moves, &base, &mut states).unwrap();
        let mut before = Resolved {
            attitude: Matrix3::identity(),
            rate: base.rate,
            positions: Vec::new(),
            rates: Vec::new(),
            misfit: 0.0,
        };
        for (i, (positions, rates)) in [
            (vec![2.5], vec![0.7]),
            (vec![0.6, -1.1], vec![0.4, -0.9]),
            (vec![], vec![0.1, -0.2, 0.3]),
            (vec![0.2], vec![0.5]),
        ]
        .into_iter()
        .enumerate()
        {
            let state = &states[i + 1];
            let seen = if i == 3 {
                Seen::Coordinate(0.2, 0.5)
            } else {
                Seen::Link { attitude: state.rotation, rate: state.rotation.tr_mul(&state.rate) }
            };
            let got = resolve(&links[i + 1], &before, &seen).unwrap();
            assert!(got.misfit < 1e-7, "{i}: {}", got.misfit);
            for (a, b) in got.rates.iter().zip(rates) {
                assert!((a - b).abs() < 1e-13, "{i}");
            }
            for (a, b) in got.positions.iter().zip(positions) {
                assert!((a - b).abs() < 1e-13, "{i}");
            }
            assert!((got.rate - state.rotation.tr_mul(&state.rate)).norm() < 1e-13);
            before = got;
        }
        // A link that turned about another axis does not fit, by just that angle.
        let wrong = links[1].rotation * turn(&skew.cross(&Vector3::x()).normalize(), 0.2);
        let root = Resolved { attitude: Matrix3::identity(), ..before };
        let seen = Seen::Link { attitude: wrong, rate: Vector3::zeros() };
        assert!((resolve(&links[1], &root, &seen).unwrap().misfit - 0.2).abs() < 1e-9);
        assert_eq!(resolve(&links[4], &root, &seen), None);
    }
}
