//! A humanoid that stands with flat soles on a level floor, and what its encoders and its IMU read in poses.
//!
//! The legs are those of the check in which the identifiability of offsets was found: hip z, x, y, knee y,
//! shank z, ankle y, x. Where the soles are is computed here by matrices of four by four and differences, not
//! by the kinematics of the search.
#![allow(clippy::missing_panics_doc, reason = "of a robot that is made here")]

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use rigident_shared::tree::{Joint, Link};

use super::noise::Noise;
use rigident_identify::joint_offsets::{JointTree, Pose, Setup, Sole};
use rigident_model::{Model, ModelLink};

/// Joints of a leg from the hip down: name, axis, place in the parent, m.
const LEG: [(&str, [f64; 3], [f64; 3]); 7] = [
    ("hip_z", [0.0, 0.0, 1.0], [0.0, 0.0, -0.06]),
    ("hip_x", [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
    ("hip_y", [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]),
    ("knee_y", [0.0, 1.0, 0.0], [0.0, 0.0, -0.38]),
    ("shank_z", [0.0, 0.0, 1.0], [0.0, 0.0, -0.10]),
    ("ankle_y", [0.0, 1.0, 0.0], [0.0, 0.0, -0.26]),
    ("ankle_x", [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
];
/// Half the distance between the hips, m.
const HALF_WIDTH_M: f64 = 0.09;
/// Corners of a sole in its link's frame, m.
const CORNERS: [[f64; 3]; 4] =
    [[0.13, 0.05, -0.07], [0.13, -0.05, -0.07], [-0.07, 0.05, -0.07], [-0.07, -0.05, -0.07]];
/// Ranges of a leg's joints in random poses, rad.
const RANGES: [[f64; 2]; 7] =
    [[-0.4, 0.4], [-0.3, 0.3], [-1.0, 0.1], [0.2, 1.5], [-0.3, 0.3], [-0.8, 0.2], [-0.3, 0.3]];
/// Soles are flat and level to this, rad and m.
const FLAT: f64 = 1e-13;

/// 1 σ of what is read of a pose, rad.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reading {
    /// Of every encoder.
    pub encoder_rad: f64,
    /// Of the IMU's attitude about each axis.
    pub attitude_rad: f64,
}

/// Returns the humanoid: a pelvis with two legs of seven joints.
pub fn humanoid() -> Model {
    let base =
        Link { parent: 0, joint: Joint::Free, rotation: Matrix3::identity(), position: Vector3::zeros() };
    let mut links = vec![ModelLink::new("pelvis", "", base, None)];
    for (side, sign) in [("left", 1.0), ("right", -1.0)] {
        let mut parent = 0;
        for (k, (name, axis, place)) in LEG.into_iter().enumerate() {
            let mut position = Vector3::from(place);
            if k == 0 {
                position.y += sign * HALF_WIDTH_M;
            }
            let joint = Joint::Revolute(Vector3::from(axis));
            let link = Link { parent, joint, rotation: Matrix3::identity(), position };
            parent = links.len();
            links.push(ModelLink::new(format!("{side}_{name}_link"), format!("{side}_{name}"), link, None));
        }
    }
    Model { name: "humanoid".to_owned(), links, findings: Vec::new(), gravity_mps2: None }
}

/// Returns the two soles of the humanoid.
pub fn soles() -> Vec<Sole> {
    let sole =
        |name: &str, link: usize| Sole { name: name.to_owned(), link, corners_m: CORNERS.to_vec(), plane: 0 };
    vec![sole("left", 7), sole("right", 14)]
}

/// Returns the setup in which all 14 offsets are asked for and the pelvis has the IMU.
pub fn setup(noise: rigident_identify::joint_offsets::Noise) -> Setup {
    Setup::new(JointTree::new(&humanoid()), soles(), vec![0], &[], noise).expect("joints that turn")
}

/// Returns where the sole's link of a leg is in the pelvis, by angles of its seven joints, rad.
fn foot(side: usize, angles: &[f64]) -> Isometry3<f64> {
    let sign = if side == 0 { 1.0 } else { -1.0 };
    let mut at = Isometry3::translation(0.0, sign * HALF_WIDTH_M, 0.0);
    for ((_, axis, place), angle) in LEG.iter().zip(angles) {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from(*axis) * *angle);
        at *= Isometry3::from_parts(Translation3::from(Vector3::from(*place)), turn);
    }
    at
}

/// Returns what keeps the soles from being flat on one level floor: tilts of both, and by how much one is
/// higher.
fn unevenness(pelvis: &UnitQuaternion<f64>, angles: &[f64]) -> DVector<f64> {
    let feet = [0, 1].map(|side| foot(side, &angles[7 * side..7 * side + 7]));
    let normal = feet.map(|foot| pelvis * foot.rotation * Vector3::z());
    let height = feet.map(|foot| (pelvis * (foot * nalgebra::Point3::from(CORNERS[0])).coords).z);
    DVector::from_vec(vec![normal[0].x, normal[0].y, normal[1].x, normal[1].y, height[0] - height[1]])
}

/// Moves angles by the shortest way to where both soles are flat and level; `None` if there is none near.
fn flattened(pelvis: &UnitQuaternion<f64>, mut angles: Vec<f64>) -> Option<Vec<f64>> {
    for _ in 0..50 {
        let off = unevenness(pelvis, &angles);
        if off.amax() < FLAT {
            return Some(angles);
        }
        let mut slope = DMatrix::zeros(5, 14);
        for k in 0..14 {
            let by = |step: f64| {
                let mut moved = angles.clone();
                moved[k] += step;
                unevenness(pelvis, &moved)
            };
            slope.set_column(k, &((by(1e-5) - by(-1e-5)) / 2e-5));
        }
        let square = &slope * slope.transpose();
        let step = slope.tr_mul(&square.cholesky()?.solve(&off));
        angles.iter_mut().zip(step.iter()).for_each(|(angle, step)| *angle -= step);
    }
    None
}

/// Returns poses with flat soles and legs that differ, as they are read with these offsets: true less
/// measured angle, rad.
pub fn random_poses(count: usize, offsets: &[f64], reading: Reading, seed: u64) -> Vec<Pose> {
    let mut noise = Noise(Some(seed));
    let mut poses = Vec::with_capacity(count);
    while poses.len() < count {
        let mut angle = |range: [f64; 2]| range[0] + (range[1] - range[0]) * noise.uniform();
        let start: Vec<f64> = RANGES.iter().chain(&RANGES).map(|range| angle(*range)).collect();
        let [roll, pitch, yaw] = [[-0.15, 0.15], [-0.25, 0.25], [-3.0, 3.0]].map(&mut angle);
        let pelvis = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let Some(angles) = flattened(&pelvis, start) else { continue };
        // A knee that turns backwards is none of a robot's.
        if angles[3] < 0.1 || angles[10] < 0.1 {
            continue;
        }
        poses.push(read(poses.len(), &angles, &pelvis, offsets, reading, &mut noise));
    }
    poses
}

/// Returns symmetric level squats, pelvis upright, as they are read.
pub fn squats(count: usize, offsets: &[f64], reading: Reading, seed: u64) -> Vec<Pose> {
    let mut noise = Noise(Some(seed));
    let squat = |k: usize, noise: &mut Noise| {
        let knee = 0.2 + 1.2 * k as f64 / count.max(2) as f64;
        // Thigh and shank lean by as much as keeps the sole level.
        let leg = [0.0, 0.0, -0.5 * knee, knee, 0.0, -0.5 * knee, 0.0];
        let angles = [leg, leg].concat();
        read(k, &angles, &UnitQuaternion::identity(), offsets, reading, noise)
    };
    (0..count).map(|k| squat(k, &mut noise)).collect()
}

fn read(
    k: usize,
    angles: &[f64],
    pelvis: &UnitQuaternion<f64>,
    offsets: &[f64],
    reading: Reading,
    noise: &mut Noise,
) -> Pose {
    let positions = angles
        .iter()
        .zip(offsets)
        .map(|(angle, offset)| angle - offset + noise.normal(reading.encoder_rad))
        .collect();
    let off = Vector3::from_fn(|_, _| noise.normal(reading.attitude_rad));
    let attitudes = vec![UnitQuaternion::from_scaled_axis(off) * pelvis];
    Pose { name: format!("pose {}", k + 1), positions, attitudes, stands: vec![true; 2] }
}

/// Returns offsets of up to ± `most_rad`, the same for a seed.
pub fn random_offsets(most_rad: f64, seed: u64) -> Vec<f64> {
    let mut noise = Noise(Some(seed));
    (0..14).map(|_| most_rad * (2.0 * noise.uniform() - 1.0)).collect()
}

/// Returns the text of a file of poses.
pub fn csv(setup: &Setup, poses: &[Pose]) -> String {
    let mut header = vec!["pose".to_owned()];
    header.extend(setup.joints.iter().map(|link| format!("{}_rad", setup.tree.joint_name(*link))));
    for link in &setup.measured_links {
        let name = setup.tree.link_name(*link);
        header.extend(["qw", "qx", "qy", "qz"].map(|part| format!("{name}_{part}")));
    }
    let mut out = header.join(",") + "\n";
    for pose in poses {
        let turned = pose.attitudes.iter().flat_map(|q| [q.w, q.i, q.j, q.k]);
        let numbers = pose.positions.iter().copied().chain(turned).map(|value| value.to_string());
        out += &std::iter::once(pose.name.clone()).chain(numbers).collect::<Vec<_>>().join(",");
        out.push('\n');
    }
    out
}

/// Returns the text of the file of contacts of the humanoid.
pub fn contacts() -> String {
    let tree = JointTree::new(&humanoid());
    let table = |sole: Sole| {
        format!(
            "[[sole]]\nname = \"{}\"\nlink = \"{}\"\ncorners_m = {:?}\n",
            sole.name,
            tree.link_name(sole.link),
            sole.corners_m
        )
    };
    soles().into_iter().map(table).collect()
}
