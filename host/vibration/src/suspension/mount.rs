//! The place of the body, or the base link of a tree, on the platform.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use rigident_shared::tree::BaseMotion;

use super::springs::Displacement;
use rigident_io::rig::SuspensionTable;
use rigident_model::inertial::{ParameterMap, map_to_parent};
use rigident_rows::moved::Moved;
use rigident_rows::tree::Frame;
use rigident_rows::tree::joints::attitude;

/// The platform at the time of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// The platform's position relative to rest.
    pub at: Displacement,
    /// Origin of the base link against O, axes at rest, m.
    pub arm: Vector3<f64>,
}

/// The place of S in P.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mount {
    /// Origin of S against O, axes of P, m.
    pub arm: Vector3<f64>,
    /// P axes ← S axes.
    pub rotation: Matrix3<f64>,
}

impl Mount {
    /// Returns the mount of a rig file.
    pub fn of(table: &SuspensionTable) -> Self {
        let q = table.base_rotation_wxyz.unwrap_or([1.0, 0.0, 0.0, 0.0]);
        Self {
            arm: Vector3::from(table.base_position_m) - Vector3::from(table.at_m),
            rotation: attitude(&q).unwrap_or_else(Matrix3::identity),
        }
    }

    /// Returns the map of ten parameters in S to those about O, axes of P.
    pub fn map(&self) -> ParameterMap {
        map_to_parent(&self.rotation, &self.arm)
    }

    /// Returns the platform, and the tree on it, at an instant.
    pub(super) fn frame(&self, moved: &Moved, time_ns: u64) -> (Instant, Frame) {
        let (p, v) = (&moved.positions, &moved.rates);
        let attitude = UnitQuaternion::from_quaternion(Quaternion::new(p[3], p[4], p[5], p[6]));
        let turn: Matrix3<f64> = attitude.to_rotation_matrix().into_inner();
        let (own_velocity, own_rate) = (Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5]));
        let at =
            Displacement::new(Vector3::new(p[0], p[1], p[2]), turn * own_velocity, turn, turn * own_rate);
        let arm = turn * self.arm;
        let base = turn * self.rotation;
        let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(base));
        let place = at.shift + arm;
        let velocity = base.tr_mul(&(at.velocity + at.rate.cross(&arm)));
        let rate = base.tr_mul(&at.rate);
        let mut positions = vec![place.x, place.y, place.z, q.w, q.i, q.j, q.k];
        positions.extend(&p[7..]);
        let mut rates: Vec<f64> = velocity.iter().chain(rate.iter()).copied().collect();
        rates.extend(&v[6..]);
        let frame = Frame {
            time_ns,
            positions,
            rates,
            base: BaseMotion::still([0.0; 3]),
            wrench: [0.0; 6],
            efforts: Vec::new(),
            standing: Vec::new(),
            ground: Default::default(),
        };
        (Instant { at, arm }, frame)
    }
}
