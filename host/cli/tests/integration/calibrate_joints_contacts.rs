//! Contacts of every kind, robots of every kind: intervals hold the truth of poses that other kinematics
//! made.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};
use rigident::joint_offsets::result::{Answer, COARSEST, identify};
use rigident::joint_offsets::search::Method;
use rigident::joint_offsets::{Contacts, Held, JointTree, Noise, Plane, Pose, Setup, Sole};
use rigident::laboratory::contacts::{ReadingNoise, Robot, Stance, from_plane, uniform};
use rigident::laboratory::standing::{humanoid, soles};
use rigident::model::human::Person;
use rigident::model::{Model, ModelLink};
use rigident_shared::tree::{Joint, Link};

/// Noise of encoders and IMUs as the command assumes it.
pub const READING: ReadingNoise =
    ReadingNoise { encoder: 8.7266e-4, attitude_rad: 3.4907e-3, yaw_rad: 3.4907e-3 };

fn answer(setup: &Setup, poses: &[Pose]) -> Answer {
    identify(setup, poses, Method::GaussNewton, COARSEST).unwrap()
}

/// The quality of identified offsets, over several answers.
#[derive(Debug, Default)]
struct Coverage {
    known: f64,
    inside: f64,
    /// Sum of squares of errors over their standard deviations.
    squares: f64,
}

impl Coverage {
    /// Adds an answer and returns how many offsets it identified.
    fn add(&mut self, answer: &Answer, truth: &[f64]) -> usize {
        let known = answer.offsets.iter().zip(truth).filter_map(|(own, truth)| Some((own.measured?, truth)));
        let before = self.known;
        for (own, truth) in known {
            let error = (own.value - truth) / own.u95;
            self.known += 1.0;
            self.inside += f64::from(u8::from(error.abs() <= 1.0));
            self.squares += (1.96 * error).powi(2);
        }
        (self.known - before) as usize
    }

    /// Hundreds of intervals, those of one set correlated as if half of them counted: a standard error of at
    /// most 1.8 %. Corners are exact, and said to be so to 0.1 mm, so that intervals may be too wide, but by
    /// no more than a half.
    fn holds(&self) {
        let (share, square) = (self.inside / self.known, self.squares / self.known);
        assert!(
            self.known > 200.0 && share >= 0.91 && square >= 1.5_f64.powi(-2),
            "{share} {square} {self:?}"
        );
    }
}

/// Poses of the humanoid with flat soles, `shape` applied to where each begins; links `stiff` do not move,
/// the left sole is higher and leans by `raised`, m and rad.
pub fn flat_poses(
    setup: &Setup,
    count: usize,
    truth: &[f64],
    shape: &dyn Fn(&mut Stance),
    stiff: &[usize],
    raised: [f64; 2],
) -> Vec<Pose> {
    let model = humanoid();
    let robot = Robot::of(&model);
    let moving: Vec<usize> = (1..model.links.len()).filter(|link| !stiff.contains(link)).collect();
    let corners = soles()[0].corners_m.clone();
    let leaning = Vector3::new(raised[1].sin(), 0.0, raised[1].cos());
    let mut poses = Vec::new();
    // Noise of its own for every set of offsets.
    let noise = 1000 * (1e6 * truth.iter().map(|v| v.abs()).sum::<f64>()) as u64;
    let mut seed = 7000;
    while poses.len() < count {
        seed += 1;
        let mut stance = crouched(model.links.len(), &[[0, 2, 3, 5], [7, 9, 10, 12]], 0.3, seed);
        shape(&mut stance);
        let wanted = |places: &[Isometry3<f64>]| {
            let mut off = from_plane(&places[7], &corners, &leaning, raised[0]);
            off.extend(from_plane(&places[14], &corners, &Vector3::z(), 0.0));
            off
        };
        if let Some(stance) = robot.settled(stance, &moving, &wanted) {
            let name = format!("pose {}", poses.len() + 1);
            poses.push(robot.read(setup, &stance, truth, READING, &name, noise + seed));
        }
    }
    poses
}

/// A crouch with legs that differ: hip, knee and ankle pitch at 1 + the places given, all else spread at
/// random.
fn crouched(links: usize, legs: &[[usize; 4]], spread: f64, seed: u64) -> Stance {
    let random = uniform(links + 4, seed);
    let mut positions: Vec<f64> = random[..links].iter().map(|v| spread * v).collect();
    for (k, [_, hip, knee, ankle]) in legs.iter().enumerate() {
        let bent = 0.7 + 0.5 * random[links + k];
        positions[hip + 1] += -0.5 * bent;
        positions[knee + 1] = bent;
        positions[ankle + 1] += -0.5 * bent;
    }
    let turn = UnitQuaternion::from_euler_angles(0.15 * random[0], 0.2 * random[1], 0.3 * random[2]);
    Stance { base: Isometry3::from_parts(Vector3::new(0.0, 0.0, 0.85).into(), turn), positions }
}

/// Offsets of up to 2°.
fn offsets(count: usize, seed: u64) -> Vec<f64> {
    uniform(count, seed).into_iter().map(|v| 0.035 * v).collect()
}

fn exact() -> Noise {
    Noise { height_m: 1e-4, floor_rad: 0.0, ..Noise::default() }
}

/// Feet bolted to blocks that are neither level nor equally high: nothing of the world is known but that they
/// stay.
#[test]
fn feet_that_are_held_tell_offsets_and_not_those_that_their_unknown_attitudes_hide() {
    let model = humanoid();
    let robot = Robot::of(&model);
    let held = |name: &str, link: usize| Held {
        name: name.to_owned(),
        link,
        point_m: [0.03, 0.0, -0.07],
        turns: false,
    };
    let contacts = Contacts { held: vec![held("left", 7), held("right", 14)], ..Contacts::from(Vec::new()) };
    let setup = Setup::new(JointTree::new(&model), contacts, vec![0], &[], exact()).unwrap();
    let moving: Vec<usize> = (1..15).collect();
    let (mut coverage, mut most) = (Coverage::default(), 0);
    for set in 0..30 {
        let truth = offsets(14, 40 + set);
        let first = crouched(15, &[[0, 2, 3, 5], [7, 9, 10, 12]], 0.2, 900 + set);
        let there = robot.places(&first);
        let mut poses = Vec::new();
        for k in 0..40_u64 {
            // What holds the feet gives as much as is stated: of a uniform play between ±a the standard
            // deviation is a/√3.
            let play: Vec<f64> = uniform(12, 300_000 + 100 * set + k)
                .into_iter()
                .enumerate()
                .map(|(n, v)| 3_f64.sqrt() * v * if n % 6 < 3 { READING.attitude_rad } else { 1e-4 })
                .collect();
            let wanted = |places: &[Isometry3<f64>]| {
                let off = |foot: usize| {
                    let turn = (places[foot].rotation * there[foot].rotation.inverse()).scaled_axis();
                    let point = Point3::new(0.03, 0.0, -0.07);
                    let shift = places[foot] * point - there[foot] * point;
                    [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z]
                };
                let both = [off(7), off(14)].concat();
                both.iter().zip(&play).map(|(off, play)| off - play).collect()
            };
            let mut start = first.clone();
            let random = uniform(21, 5000 + 100 * set + k);
            start.positions.iter_mut().zip(&random).for_each(|(q, v)| *q += 0.3 * v);
            start.base.translation.vector += 0.1 * Vector3::new(random[16], random[17], random[18]);
            start.base.rotation *=
                UnitQuaternion::from_euler_angles(0.2 * random[15], 0.3 * random[19], 0.3 * random[20]);
            if let Some(stance) = robot.settled(start, &moving, &wanted) {
                poses.push(robot.read(
                    &setup,
                    &stance,
                    &truth,
                    READING,
                    &format!("pose {k}"),
                    9_000_000 + 1000 * set + k,
                ));
            }
        }
        assert!(poses.len() >= 15, "{}", poses.len());
        let found = answer(&setup, &poses);
        assert!(found.converged && found.bad.len() <= 1, "{found:?}");
        // The last joint's offset and the foot's unknown attitude are the same thing.
        for last in [6, 13] {
            assert!(found.offsets[last].measured.is_none(), "{:?}", found.offsets[last]);
        }
        most = most.max(coverage.add(&found, &truth));
    }
    assert!(most >= 8, "{most}");
    coverage.holds();
}

/// The humanoid with an arm of four joints and a flat hand.
fn with_arm() -> Model {
    let mut model = humanoid();
    let axes = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let places = [[0.0, -0.2, 0.4], [0.0, 0.0, 0.0], [0.28, 0.0, 0.0], [0.25, 0.0, 0.0], [0.0, 0.0, 0.0]];
    let mut parent = 0;
    for (k, (axis, place)) in axes.into_iter().zip(places).enumerate() {
        let link = Link {
            parent,
            joint: Joint::Revolute(Vector3::from(axis)),
            rotation: Matrix3::identity(),
            position: Vector3::from(place),
        };
        parent = model.links.len();
        model.links.push(ModelLink::new(format!("arm_{k}_link"), format!("arm_{k}"), link, None));
    }
    model
}

/// A hand flat on a wall whose distance and heading are not known exactly.
#[test]
fn a_hand_on_a_wall_tells_offsets_of_the_arm() {
    let model = with_arm();
    let robot = Robot::of(&model);
    let hand = vec![[0.1, 0.04, 0.04], [0.1, -0.04, 0.04], [0.1, 0.04, -0.04], [0.1, -0.04, -0.04]];
    let mut contacts = Contacts::from(soles());
    let tilt_rad = 0.01;
    contacts.planes.push(Plane {
        name: "wall".to_owned(),
        normal: -Vector3::x(),
        tilt_rad,
        at_origin: false,
    });
    contacts.soles.push(Sole { name: "hand".to_owned(), link: 19, corners_m: hand.clone(), plane: 1 });
    let setup = Setup::new(JointTree::new(&model), contacts, vec![0], &[], exact()).unwrap();
    let corners = soles()[0].corners_m.clone();
    let moving: Vec<usize> = (1..20).collect();
    let mut coverage = Coverage::default();
    for set in 0..25 {
        let truth = offsets(19, 400 + set);
        let off = uniform(2, 300 + set);
        let wall =
            UnitQuaternion::from_euler_angles(0.0, tilt_rad * off[0], tilt_rad * off[1]) * -Vector3::x();
        let wanted = |places: &[Isometry3<f64>]| {
            let mut off = from_plane(&places[7], &corners, &Vector3::z(), 0.0);
            off.extend(from_plane(&places[14], &corners, &Vector3::z(), 0.0));
            off.extend(from_plane(&places[19], &hand, &wall, -0.5));
            off
        };
        let mut poses: Vec<Pose> = Vec::new();
        let mut seed = 1000 * set;
        while poses.len() < 30 {
            seed += 1;
            let mut start = crouched(20, &[[0, 2, 3, 5], [7, 9, 10, 12]], 0.3, 77_000 + seed);
            start.positions[17] += 0.6;
            start.positions[18] -= 0.3;
            if let Some(stance) = robot.settled(start, &moving, &wanted) {
                let mut pose = robot.read(&setup, &stance, &truth, READING, "pose", 8_000_000 + seed);
                pose.stands[2] = !poses.len().is_multiple_of(5);
                poses.push(pose);
            }
        }
        let found = answer(&setup, &poses);
        assert!(found.converged, "{found:?}");
        coverage.add(&found, &truth);
    }
    assert!(coverage.known > 375.0, "{coverage:?}");
    coverage.holds();
}

/// Several IMUs, all of which drift in heading.
#[test]
fn headings_that_drift_are_not_used() {
    let model = humanoid();
    let shank = JointTree::new(&model).link("left_knee_y_link").unwrap();
    let setup = |yaw_rad: f64| {
        Setup::new(JointTree::new(&model), soles(), vec![0, shank], &[], Noise { yaw_rad, ..exact() })
            .unwrap()
    };
    let (with, without) = (setup(READING.yaw_rad), setup(std::f64::consts::PI));
    let mut coverage = Coverage::default();
    for set in 0..20 {
        let truth = offsets(14, 70 + set);
        let mut poses = flat_poses(&with, 30, &truth, &|_| {}, &[], [0.0; 2]);
        let drift = uniform(60, 90 + set);
        for (k, pose) in poses.iter_mut().enumerate() {
            for (n, attitude) in pose.attitudes.iter_mut().enumerate() {
                let turn = Vector3::z() * (3.0 * drift[2 * k + n]);
                *attitude = UnitQuaternion::from_scaled_axis(turn) * *attitude;
            }
        }
        let found = answer(&without, &poses);
        assert!(found.converged && found.bad.len() <= 1, "{found:?}");
        coverage.add(&found, &truth);
    }
    coverage.holds();
}

/// A published robot that crouches on both feet.
fn published(file: &str, feet: [&str; 2], bend: [[&str; 3]; 2], corners: [[f64; 3]; 4]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/urdf").join(file);
    let (model, _) =
        rigident::rows::named_model::open(&path.display().to_string(), &Person::default()).unwrap();
    let tree = JointTree::new(&model);
    let sole = |link: &str| Sole {
        name: link.to_owned(),
        link: tree.link(link).unwrap(),
        corners_m: corners.to_vec(),
        plane: 0,
    };
    let feet = feet.map(sole);
    let setup = Setup::new(tree, feet.to_vec(), vec![0], &[], exact()).unwrap();
    assert_eq!(setup.joints.len(), 12, "{:?}", setup.asked_names());
    let robot = Robot::of(&model);
    let legs = bend.map(|[hip, knee, ankle]| {
        let of = |name: &str| model.joint(name).unwrap() - 1;
        [0, of(hip), of(knee), of(ankle)]
    });
    let mut coverage = Coverage::default();
    for set in 0..25 {
        let truth = offsets(12, 5 + set);
        let mut poses = Vec::new();
        let mut seed = 1000 * set;
        while poses.len() < 30 {
            seed += 1;
            let start = crouched(model.links.len(), &legs, 0.25, 31_000 + seed);
            let wanted = |places: &[Isometry3<f64>]| {
                let off = |sole: &Sole| from_plane(&places[sole.link], &sole.corners_m, &Vector3::z(), 0.0);
                [off(&feet[0]), off(&feet[1])].concat()
            };
            if let Some(stance) = robot.settled(start, &setup.joints, &wanted) {
                poses.push(robot.read(&setup, &stance, &truth, READING, "pose", 6_000_000 + seed));
            }
        }
        let found = answer(&setup, &poses);
        assert!(found.converged && found.bad.len() <= 1, "{found:?}");
        coverage.add(&found, &truth);
    }
    assert_eq!(coverage.known, 300.0);
    coverage.holds();
}

#[test]
#[ignore = "needs ../shared/data"]
fn offsets_of_the_g1_of_shared_data_are_covered() {
    published(
        "g1_29dof_rev_1_0.urdf",
        ["left_ankle_roll_link", "right_ankle_roll_link"],
        ["left", "right"].map(|side| match side {
            "left" => ["left_hip_pitch_joint", "left_knee_joint", "left_ankle_pitch_joint"],
            _ => ["right_hip_pitch_joint", "right_knee_joint", "right_ankle_pitch_joint"],
        }),
        [[0.12, 0.03, -0.03], [0.12, -0.03, -0.03], [-0.05, 0.025, -0.03], [-0.05, -0.025, -0.03]],
    );
}

#[test]
#[ignore = "needs ../shared/data"]
fn offsets_of_the_jvrc1_of_shared_data_are_covered() {
    published(
        "jvrc1.urdf",
        ["L_ANKLE_P_S", "R_ANKLE_P_S"],
        [["L_HIP_P", "L_KNEE", "L_ANKLE_P"], ["R_HIP_P", "R_KNEE", "R_ANKLE_P"]],
        [[0.16, 0.06, -0.1], [0.16, -0.06, -0.1], [-0.08, 0.06, -0.1], [-0.08, -0.06, -0.1]],
    );
}
