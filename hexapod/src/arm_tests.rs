//! Comparison with Denavit and Hartenberg's parameters, as Universal Robots publishes them for the UR5.

use nalgebra::Matrix4;

use super::*;
use crate::{Axis, Geometry, MotionError, MotionProgram, Segment, SineTerm, Travel};

/// `a`, `d` (m) and `alpha` of each joint.
const UR5: [[f64; 3]; 6] = [
    [0.0, 0.089_159, std::f64::consts::FRAC_PI_2],
    [-0.425, 0.0, 0.0],
    [-0.392_25, 0.0, 0.0],
    [0.0, 0.109_15, std::f64::consts::FRAC_PI_2],
    [0.0, 0.094_65, -std::f64::consts::FRAC_PI_2],
    [0.0, 0.0823, 0.0],
];
const HOME: [f64; 6] = [0.3, -1.3, 1.9, -2.2, -1.5, 0.4];

/// Returns the fixed part of a joint, which comes after its turn.
fn after([a, d, alpha]: [f64; 3]) -> Mounting {
    let (s, c) = (0.5 * alpha).sin_cos();
    Mounting { position_m: [a, 0.0, d], rotation_wxyz: [c, s, 0.0, 0.0] }
}

pub(crate) fn ur5() -> Arm {
    let hinge = |i: usize| Hinge {
        name: format!("joint {}", i + 1),
        place: if i == 0 { Mounting::IDENTITY } else { after(UR5[i - 1]) },
        axis: [0.0, 0.0, 1.0],
        range_rad: [-6.2, 6.2],
        rate_radps: 3.0,
        acceleration_radps2: 10.0,
    };
    Arm { hinges: std::array::from_fn(hinge), flange: after(UR5[5]), home_rad: HOME, payload_kg: Some(5.0) }
}

/// Returns the flange by the product of the parameters' matrices.
fn tool(q: &[f64; 6]) -> Matrix4<f64> {
    UR5.iter().zip(q).fold(Matrix4::identity(), |so_far, ([a, d, alpha], q)| {
        let ((st, ct), (sa, ca)) = (q.sin_cos(), alpha.sin_cos());
        let row = [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0.0, sa, ca, *d],
            [0.0, 0.0, 0.0, 1.0],
        ];
        so_far * Matrix4::from_fn(|i, j| row[i][j])
    })
}

fn program(roll_rad: f64, frequency_hz: f64) -> MotionProgram {
    let term = |axis, amplitude, frequency_hz| SineTerm { axis, amplitude, frequency_hz, phase_rad: 0.4 };
    let terms = vec![
        term(Axis::X, 0.03, 0.4),
        term(Axis::Z, 0.02, 0.7),
        term(Axis::Roll, roll_rad, frequency_hz),
        term(Axis::Yaw, 0.3, 0.3),
    ];
    let segments = vec![Segment::Multisine { duration_s: 6.0, ramp_s: 1.5, terms }];
    MotionProgram { start: Pose::default(), segments }
}

#[test]
fn poses_are_those_of_the_published_parameters() {
    let arm = ur5();
    let home = tool(&HOME);
    let q = [0.5, -1.1, 1.7, -2.0, -1.3, 0.1];
    let (there, pose) = (tool(&q), arm.pose(&q));
    let turn = crate::rotation_from_rpy(pose.rpy_rad);
    let want = there.fixed_view::<3, 3>(0, 0) * home.fixed_view::<3, 3>(0, 0).transpose();
    for i in 0..3 {
        assert!((pose.position_m[i] - (there[(i, 3)] - home[(i, 3)])).abs() < 1e-14);
        for j in 0..3 {
            assert!((turn[(i, j)] - want[(i, j)]).abs() < 1e-14, "{i} {j}");
        }
    }
    assert_eq!(arm.pose(&HOME).coordinates().map(|v| v.abs() < 1e-15), [true; 6]);
}

#[test]
fn positions_of_a_pose_lead_back_to_it_in_the_posture_of_home() {
    let arm = ur5();
    for rpy_rad in [[0.5, 0.0, 0.0], [0.0, -0.6, 0.2], [0.3, 0.3, -0.8]] {
        let pose = Pose { position_m: [0.08, -0.1, 0.05], rpy_rad };
        let q = arm.positions(&pose).unwrap();
        let there = arm.pose(&q);
        for (a, b) in there.coordinates().iter().zip(pose.coordinates()) {
            assert!((a - b).abs() < 1e-9, "{there:?} {pose:?}");
        }
        assert!(q.iter().zip(HOME).all(|(a, b)| (a - b).abs() < 1.6), "{q:?}");
    }
    // The arm is 0.95 m long.
    assert_eq!(arm.positions(&Pose { position_m: [0.0, 0.0, 2.0], rpy_rad: [0.0; 3] }), None);
}

/// The curve between the control points, evaluated finely by the recursion of de Boor and its differences.
#[test]
fn limits_that_control_points_keep_are_kept_between_them() {
    let arm = ur5();
    let path = arm.path(&program(0.25, 1.1).trajectory().unwrap()).unwrap();
    let peaks = arm.peaks_of(&path);
    let points = &path.points_rad;
    let at = |k: isize, i: usize| points[k.clamp(0, points.len() as isize - 1) as usize][i];
    let curve = |t: f64, i: usize| {
        let k = (t / STEP_S).floor();
        let (u, k) = (t / STEP_S - k, k as isize);
        let mut d = [at(k - 1, i), at(k, i), at(k + 1, i), at(k + 2, i)];
        for r in 1..4 {
            for j in (r..4).rev() {
                let share = (u + 3.0 - j as f64) / (4 - r) as f64;
                d[j] = (1.0 - share) * d[j - 1] + share * d[j];
            }
        }
        d[3]
    };
    let (h, mut most) = (2e-4, [0.0_f64; 3]);
    for i in 0..6 {
        for n in 2..30_400 {
            let t = f64::from(n) * h;
            let (before, now, next) = (curve(t - h, i), curve(t, i), curve(t + h, i));
            most[0] = most[0].max(now.abs() / 6.2);
            most[1] = most[1].max((next - before).abs() / (2.0 * h) / 3.0);
            most[2] = most[2].max((next - 2.0 * now + before).abs() / (h * h) / 10.0);
        }
    }
    for (most, peak) in most.iter().zip(peaks) {
        // Below the bound, and not far below it.
        assert!(*most <= peak.share() * (1.0 + 1e-6) && *most > 0.9 * peak.share(), "{most} {peak:?}");
    }
}

/// A B-spline lies `h²/6 q''` from its control points.
#[test]
fn the_curve_stays_near_the_program() {
    let arm = ur5();
    let trajectory = program(0.25, 1.1).trajectory().unwrap();
    let path = arm.path(&trajectory).unwrap();
    for k in 1..path.points_rad.len() - 1 {
        let [a, b, c] = [k - 1, k, k + 1].map(|k| path.points_rad[k]);
        let knot = std::array::from_fn(|i| (a[i] + 4.0 * b[i] + c[i]) / 6.0);
        let (pose, want) = (arm.pose(&knot), trajectory.state(k as f64 * STEP_S).pose());
        for (a, b) in pose.coordinates().iter().zip(want.coordinates()) {
            assert!((a - b).abs() < 2e-3, "{k}: {pose:?} {want:?}");
        }
    }
}

#[test]
fn a_joint_beyond_its_limits_is_named_and_the_guarantee_says_the_same() {
    let travel =
        Travel { shift_m: [0.3; 3], turn_rad: [1.2; 3], together: true, speed_mps: None, rate_radps: None };
    let geometry = |change: &dyn Fn(&mut Arm)| {
        let mut arm = ur5();
        arm.hinges.iter_mut().for_each(|hinge| hinge.acceleration_radps2 = 15.0);
        change(&mut arm);
        Geometry::of_arm(arm, travel.clone())
    };
    let trajectory = program(0.25, 1.1).trajectory().unwrap();
    let easy = geometry(&|_| ());
    easy.check(&trajectory).unwrap();
    let guarantee = easy.guarantee(&trajectory, None, f64::INFINITY);
    assert!(guarantee.is_kept());
    assert_eq!(guarantee.peaks.last().unwrap().limit, None);
    for (change, words) in [
        (
            (&|arm: &mut Arm| arm.hinges[3].rate_radps = 0.5) as &dyn Fn(&mut Arm),
            "joint 4 of the arm would turn at",
        ),
        (&|arm| arm.hinges[4].acceleration_radps2 = 0.5, "joint 5 of the arm would accelerate at"),
        (&|arm| arm.hinges[5].range_rad = [0.3, 0.5], "joint 6 of the arm would turn"),
    ] {
        let tight = geometry(change);
        let error = tight.check(&trajectory).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
        let guarantee = tight.guarantee(&trajectory, None, f64::INFINITY);
        let (violation, _) = guarantee.violation(&tight).unwrap();
        assert!(violation.to_string().contains(words), "{violation}");
        assert!(matches!(error, MotionError::Limit { .. }));
    }
    let heavy = crate::Load::body(crate::BodyParameters {
        mass_kg: 6.0,
        com_m: [0.0; 3],
        inertia_com_kgm2: [0.1; 6],
    });
    let error = easy.check_loaded(&trajectory, &heavy).unwrap_err().to_string();
    assert!(error.contains("would carry 6.00 kg, its limit is 5.00 kg"), "{error}");
}
