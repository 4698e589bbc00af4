//! The experiment of the vibration paper: two links on a spherical joint, on a platform on springs.
//!
//! Printed: both links (Table 1) and the rotations of the three postures (Table 2). Chosen here, for the
//! paper does not print them: the platform, the springs and where the base link is.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use hexapod::{BodyParameters, Mounting, STANDARD_GRAVITY_MPS2};

use super::{Joint, JointedLink, Spring, Start, Suspended, Suspension};
use crate::links::quaternion;

/// Joint of link 1 in link 0 by the paper: the base frame's origin is the joint, m.
pub const JOINT_M: [f64; 3] = [0.0; 3];
/// A joint elsewhere, which the paper has not, m.
pub const JOINT_ELSEWHERE_M: [f64; 3] = [0.05, 0.3, 0.1];

/// Angle by which link 1 is released off its rest, rad.
pub const RELEASE_RAD: f64 = 25.0 * std::f64::consts::PI / 180.0;

/// Stiffness of each of the springs along x, N/m.
const SIDEWAYS_NPM: f64 = 190.0;

/// `⁰R₁` of the three postures as Table 2 prints them.
pub const POSTURES: [[[f64; 3]; 3]; 3] = [
    [[0.9999, 0.0071, 0.0099], [-0.0096, 0.9576, 0.2880], [-0.0074, -0.2881, 0.9576]],
    [[0.9998, 0.0037, 0.0179], [0.0014, 0.9620, -0.2730], [-0.0182, 0.2730, 0.9618]],
    [[-0.0010, 0.0, -1.0], [-0.0316, 0.9995, 0.0], [0.9995, 0.0316, -0.0010]],
];

/// Returns link 0 in the base frame, Table 1.
pub fn link_0() -> BodyParameters {
    BodyParameters {
        mass_kg: 65.921,
        com_m: [0.0, -0.3072, -0.1152],
        inertia_com_kgm2: [1.8506, 1.4892, 1.4157, -0.1659, -0.0024, -0.0081],
    }
}

/// Returns link 1 in its own frame, whose origin is the joint, Table 1.
pub fn link_1() -> BodyParameters {
    BodyParameters {
        mass_kg: 14.896,
        com_m: [0.0, 0.0217, -0.1747],
        inertia_com_kgm2: [0.0774, 0.1020, 0.0458, 0.0041, 0.0, 0.0],
    }
}

/// Returns the platform: a plate of 15 kg, 0.9 m square.
pub fn platform() -> BodyParameters {
    BodyParameters { mass_kg: 15.0, com_m: [0.0; 3], inertia_com_kgm2: [1.02, 1.02, 2.03, 0.0, 0.0, 0.0] }
}

/// Returns four upright springs at the corners that carry the weight, and four weak ones along x beside them
/// that carry nothing, so that the two sideways vibrations are not alike. With all 95.817 kg on them,
/// `√(Σ k / m) / 2π` is 1.15 Hz along x, 1.06 Hz along y and 3.03 Hz upward.
pub fn springs() -> Vec<Spring> {
    let corners =
        [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(|[x, y]| [0.38 * x, 0.32 * y, -0.05]);
    let upright = corners.map(|at_m| Spring::upright(at_m, 8700.0, 1060.0));
    let along =
        corners.map(|at_m| Spring { axis: [1.0, 0.0, 0.0], ..Spring::upright(at_m, SIDEWAYS_NPM, 0.0) });
    [upright, along].concat()
}

/// Returns the rig with link 1 on `joint_m` in link 0, whose whole centre of mass in posture 1 is over P's
/// origin, 0.28 m high ([`JOINT_M`]).
pub fn suspension(joint_m: [f64; 3]) -> Suspension {
    let link = JointedLink {
        parent: 0,
        joint_m,
        joint: Joint::Spherical,
        locked: false,
        damping_nmspr: 0.0,
        body: link_1(),
    };
    Suspension {
        platform: platform(),
        springs: springs(),
        locked: [false; 6],
        mount: Mounting { position_m: [0.0, 0.256, 0.406], rotation_wxyz: [1.0, 0.0, 0.0, 0.0] },
        base: link_0(),
        links: vec![link],
        support: None,
        gravity_mps2: STANDARD_GRAVITY_MPS2,
    }
}

/// Returns the posture's rotation, w, x, y, z: the one nearest to the printed digits.
pub fn posture_wxyz(printed: &[[f64; 3]; 3]) -> [f64; 4] {
    let m = Matrix3::from_fn(|r, c| printed[r][c]);
    let svd = m.svd(true, true);
    let nearest = match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => {
            let sign = (u * v_t).determinant().signum();
            u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t
        }
        _ => Matrix3::identity(),
    };
    quaternion(&nearest)
}

/// Returns the rotation at which link 1 hangs at rest: the least that puts its centre of mass below the
/// joint; w, x, y, z.
pub fn hanging_wxyz() -> [f64; 4] {
    let com = Vector3::from(link_1().com_m);
    let turn = UnitQuaternion::rotation_between(&com, &-Vector3::z()).unwrap_or_default();
    [turn.w, turn.i, turn.j, turn.k]
}

/// Returns the start of the relative motion: everything at rest, link 1 turned off its own by `tilt_rad`
/// about an axis of link 0.
pub fn released(tilt_rad: [f64; 3]) -> Start {
    let [w, x, y, z] = hanging_wxyz();
    let rest = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
    let turn = UnitQuaternion::from_scaled_axis(Vector3::from(tilt_rad)) * rest;
    Start::resting(&[[turn.w, turn.i, turn.j, turn.k]])
}

/// Returns a start of free vibration in every mode: the reference pose, joints at rest in this posture, with
/// a blow's velocities along what is free. The platform then moves by some millimetres.
pub fn struck(rig: &Suspended, joint_wxyz: &[[f64; 4]]) -> Start {
    let blow = [0.02, -0.015, 0.03, 0.06, 0.05, 0.08];
    let [x, y, z, roll, pitch, yaw] =
        std::array::from_fn(|k| if rig.suspension().locked[k] { 0.0 } else { blow[k] });
    Start { velocity_mps: [x, y, z], rate_radps: [roll, pitch, yaw], ..Start::resting(joint_wxyz) }
}
