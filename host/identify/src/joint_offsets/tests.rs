use super::laboratory::standing::{Reading, random_offsets, random_poses, setup, squats};
use super::result::{Answer, COARSEST, identify};
use super::search::Method;
use super::shared::Shared;
use super::{Held, Noise, Plane, Pose, Setup};

fn answer(setup: &Setup, poses: &[Pose]) -> Answer {
    identify(setup, poses, Method::GaussNewton, COARSEST).unwrap()
}

fn errors(answer: &Answer, truth: &[f64]) -> Vec<f64> {
    let value = |k: usize| answer.offsets[k].measured.map(|own| own.value);
    truth.iter().enumerate().map(|(k, truth)| value(k).expect("identified") - truth).collect()
}

#[test]
fn forty_flat_poses_give_all_fourteen_offsets_exactly() {
    let truth = random_offsets(4.0_f64.to_radians(), 3);
    let poses = random_poses(40, &truth, Reading::default(), 1);
    let setup = setup(Noise::default());
    let found = answer(&setup, &poses);
    assert!(found.converged && found.bad.is_empty(), "{found:?}");
    let worst = errors(&found, &truth).iter().fold(0.0_f64, |most, e| most.max(e.abs()));
    assert!(worst.to_degrees() < 1e-6, "{} deg after {} steps", worst.to_degrees(), found.steps);
    // The weakest combination is of one joint of both legs, alike: pelvis and soles move against each other
    // as a whole.
    let (sigma, shares) = found.weakest.as_ref().unwrap();
    let ends = [0, 1].map(|k| shares[k].0.split_once('_').unwrap());
    assert!(ends[0].1 == ends[1].1 && ends[0].0 != ends[1].0 && shares[1].1 > 0.0, "{shares:?}");
    assert!(sigma.to_degrees() < 1.0, "{sigma}");
}

#[test]
fn symmetric_squats_leave_offsets_open_and_never_return_them_as_zeros() {
    let truth = random_offsets(2.0_f64.to_radians(), 5);
    let setup = setup(Noise::default());
    let found = answer(&setup, &squats(12, &truth, Reading::default(), 1));
    let open: Vec<&str> =
        found.offsets.iter().filter(|o| o.measured.is_none()).map(|o| o.joint.as_str()).collect();
    assert!(open.len() >= 7 && open.contains(&"left_hip_z") && open.contains(&"right_hip_z"), "{open:?}");
    for (offset, truth) in found.offsets.iter().zip(&truth) {
        let Some(own) = offset.measured else { continue };
        assert!((own.value - truth).abs() <= own.u95, "{} {own:?} {truth}", offset.joint);
    }
    assert!(found.covariance.nrows() == 14 - open.len());
}

#[test]
fn conjugate_gradient_ends_where_gauss_and_newton_do() {
    let truth = random_offsets(3.0_f64.to_radians(), 7);
    let reading = Reading { encoder_rad: 0.05_f64.to_radians(), attitude_rad: 0.2_f64.to_radians() };
    let poses = random_poses(40, &truth, reading, 2);
    let setup = setup(Noise::default());
    let [one, other] = [Method::GaussNewton, Method::ConjugateGradient]
        .map(|method| identify(&setup, &poses, method, COARSEST).unwrap());
    assert!(other.converged, "{}", other.steps);
    for (a, b) in one.offsets.iter().zip(&other.offsets) {
        let off = (a.measured.unwrap().value - b.measured.unwrap().value).to_degrees();
        assert!(off.abs() < 1e-6, "{}: {off} deg, {} directions", a.joint, other.steps);
    }
}

/// The humanoid with its right sole on a wall that leans and its left ankle held, mountings uncertain.
fn touching(noise: Noise) -> Setup {
    let mut setup = setup(Noise { mounting_rad: 0.01, ..noise });
    let normal = nalgebra::Vector3::new(-0.8, 0.36, 0.48).normalize();
    let wall = Plane { name: "wall".to_owned(), normal, tilt_rad: 0.01, at_origin: false };
    setup.contacts.planes.push(wall);
    setup.contacts.soles[1].plane = 1;
    for (name, turns) in [("ankle", false), ("shank", true)] {
        let link = setup.tree.link("left_ankle_y_link").unwrap();
        setup.contacts.held.push(Held { name: name.to_owned(), link, point_m: [0.1, 0.02, -0.03], turns });
    }
    setup
}

#[test]
fn columns_are_the_slopes_of_the_expected_readings() {
    for yaw_rad in [0.01, 1.0] {
        let setup = touching(Noise { yaw_rad, ..Noise::default() });
        let mut pose = random_poses(1, &random_offsets(0.1, 2), Reading::default(), 9)[0].clone();
        pose.stands = vec![true; 4];
        let count = setup.shared_columns();
        assert_eq!((count, setup.base_columns()), (14 + 3 + 2 + 3 + 9, 6));
        let mut start = vec![0.02; count];
        // Turns of a normal are exact where they begin.
        start[17..19].fill(0.0);
        start[19..21].fill(0.0);
        let mut shared = Shared::zero(&setup).moved(&setup, &start);
        shared.offsets[3] = -0.05;
        let base = setup.first_base(&pose, &shared).moved(&[0.01, -0.02, 0.015, 0.03, 0.2, -0.3]);
        let rows = setup.rows(&pose, &base, &shared);
        let step = 1e-6;
        for column in 0..6 + count {
            let residual = |by: f64| {
                let mut all = vec![0.0; 6 + count];
                all[column] = by;
                setup.rows(&pose, &base.moved(&all[..6]), &shared.moved(&setup, &all[6..])).residual
            };
            // Measured less expected: the slope of what is expected is its negative.
            let slope = (residual(-step) - residual(step)) / (2.0 * step);
            for (k, of) in rows.of.iter().enumerate() {
                // A heading that is free is turned to where it fits best.
                if yaw_rad > 0.5 && k < 3 {
                    continue;
                }
                let off = (slope[k] - rows.columns[(k, column)]).abs();
                assert!(off < 1e-8, "{of:?} column {column}: {off}");
            }
        }
    }
}

#[test]
fn intervals_hold_the_truth_with_the_noise_of_encoders_and_imu() {
    let reading = Reading { encoder_rad: 0.05_f64.to_radians(), attitude_rad: 0.2_f64.to_radians() };
    // Corners stand exactly on the floor here: their heights are as sure as the encoders.
    let setup = setup(Noise { height_m: 1e-5, ..Noise::default() });
    let (mut inside, mut all, mut widest) = (0, 0, 0.0_f64);
    for seed in 0..60 {
        let truth = random_offsets(2.0_f64.to_radians(), 100 + seed);
        let found = answer(&setup, &random_poses(40, &truth, reading, 1000 + seed));
        for (offset, truth) in found.offsets.iter().zip(&truth) {
            let own = offset.measured.expect("identified");
            inside += u32::from((own.value - truth).abs() <= own.u95);
            widest = widest.max(own.u95 / rigident_fit::COVERAGE_95);
            all += 1;
        }
    }
    let share = f64::from(inside) / f64::from(all);
    // 840 intervals, of which those of one seed are correlated: a standard error of 1 to 1.5 %.
    assert!((0.92..=0.98).contains(&share), "{share}");
    assert!(widest.to_degrees() < 0.6, "{}", widest.to_degrees());
}

#[test]
fn a_bad_pose_is_named_and_does_not_spoil_the_others() {
    let truth = random_offsets(2.0_f64.to_radians(), 11);
    let reading = Reading { encoder_rad: 0.05_f64.to_radians(), attitude_rad: 0.2_f64.to_radians() };
    let setup = setup(Noise::default());
    let good = random_poses(40, &truth, reading, 12);
    let mut poses = good.clone();
    poses[17].positions[5] += 0.2;
    poses[23].attitudes[0] =
        nalgebra::UnitQuaternion::from_euler_angles(0.2, 0.0, 0.0) * poses[23].attitudes[0];
    let found = answer(&setup, &poses);
    let names: Vec<&str> = found.bad.iter().map(|bad| bad.name.as_str()).collect();
    assert_eq!(names, ["pose 18", "pose 24"]);
    let without: Vec<Pose> =
        good.iter().enumerate().filter(|(k, _)| ![17, 23].contains(k)).map(|(_, p)| p.clone()).collect();
    let expected = answer(&setup, &without);
    for (own, other) in found.offsets.iter().zip(&expected.offsets) {
        let (own, other) = (own.measured.unwrap(), other.measured.unwrap());
        assert!((own.value - other.value).abs() < 0.02 * own.u95, "{own:?} {other:?}");
    }
}

#[test]
fn a_mounting_that_may_be_off_widens_the_offsets_it_tilts() {
    let truth = random_offsets(2.0_f64.to_radians(), 13);
    let poses = random_poses(40, &truth, Reading::default(), 14);
    let exact = answer(&setup(Noise::default()), &poses);
    let unsure = answer(&setup(Noise { mounting_rad: 0.5_f64.to_radians(), ..Noise::default() }), &poses);
    let u95 = |answer: &Answer, k: usize| answer.offsets[k].measured.map_or(f64::INFINITY, |own| own.u95);
    for hip_y in [2, 9] {
        assert!(
            u95(&unsure, hip_y) > 1.3 * u95(&exact, hip_y),
            "{} {}",
            u95(&unsure, hip_y),
            u95(&exact, hip_y)
        );
    }
}

#[test]
fn poses_merge_in_any_order() {
    let truth = random_offsets(1.0_f64.to_radians(), 15);
    let mut poses = random_poses(20, &truth, Reading::default(), 16);
    let setup = setup(Noise::default());
    let forth = answer(&setup, &poses);
    poses.reverse();
    let back = answer(&setup, &poses);
    for (a, b) in forth.offsets.iter().zip(&back.offsets) {
        assert!((a.measured.unwrap().value - b.measured.unwrap().value).abs() < 1e-9);
    }
}

/// A second IMU on the left shank, and poses on one leg among those on two.
#[test]
fn further_imus_tell_more_and_soles_may_be_off_the_floor() {
    let truth = random_offsets(2.0_f64.to_radians(), 17);
    let mut poses = random_poses(24, &truth, Reading::default(), 18);
    let one = setup(Noise::default());
    let shank = one.tree.link("left_knee_y_link").unwrap();
    let two = Setup::new(one.tree.clone(), one.contacts.clone(), vec![0, shank], &[], one.noise).unwrap();
    let alone = answer(&one, &poses);
    for (k, pose) in poses.iter_mut().enumerate() {
        // Joints are in the order of the links, the first of which is the base.
        let mut positions = vec![0.0];
        positions.extend(pose.positions.iter().zip(&truth).map(|(measured, offset)| measured + offset));
        let turn = two.tree.places(&positions)[shank].rotation;
        let turn = nalgebra::Rotation3::from_matrix_unchecked(turn);
        pose.attitudes.push(pose.attitudes[0] * nalgebra::UnitQuaternion::from_rotation_matrix(&turn));
        pose.stands[k % 2] = k % 3 > 0;
    }
    let both = answer(&two, &poses);
    let worst = errors(&both, &truth).iter().fold(0.0_f64, |most, e| most.max(e.abs()));
    assert!(worst.to_degrees() < 1e-6 && both.bad.is_empty(), "{worst}");
    let knee = |answer: &Answer| answer.offsets[3].measured.unwrap().u95;
    assert!(knee(&both) < knee(&alone), "{} {}", knee(&both), knee(&alone));
    // A pose in which nothing stands is refused by its name.
    poses[4].stands = vec![false; 2];
    assert!(identify(&one, &poses, Method::GaussNewton, COARSEST).unwrap_err().contains("pose 5"));
}
