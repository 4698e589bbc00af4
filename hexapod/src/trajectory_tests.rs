//! Comparison with finite differences, and where segments meet.

use nalgebra::{Matrix3, Vector3};

use super::*;
use crate::{Axis, SineTerm, Sphere};

fn program() -> MotionProgram {
    let tilted = Pose { position_m: [0.02, -0.03, 0.75], rpy_rad: [0.5, -0.4, 0.3] };
    let term =
        |axis, amplitude, frequency_hz, phase_rad| SineTerm { axis, amplitude, frequency_hz, phase_rad };
    MotionProgram {
        start: Pose { position_m: [0.0, 0.0, 0.734], rpy_rad: [0.0; 3] },
        segments: vec![
            Segment::Hold { duration_s: 0.3 },
            Segment::Move { to: tilted, duration_s: 1.7 },
            Segment::Multisine {
                duration_s: 6.0,
                ramp_s: 1.5,
                terms: vec![
                    term(Axis::X, 0.02, 0.7, 0.1),
                    term(Axis::Z, 0.01, 1.3, 1.0),
                    term(Axis::Roll, 0.2, 0.41, 0.3),
                    term(Axis::Roll, 0.05, 1.1, 2.0),
                    term(Axis::Pitch, 0.15, 0.53, -1.0),
                    term(Axis::Yaw, 0.2, 0.67, 0.5),
                ],
            },
            Segment::Sphere(Sphere {
                duration_s: 5.0,
                ramp_s: 1.2,
                amplitude_rad: 0.45,
                frequency_hz: 0.6,
                turns: 1.5,
                still_point_m: [0.02, -0.03, 0.2],
            }),
            Segment::Path {
                via: vec![
                    Pose { position_m: [0.05, 0.02, 0.70], rpy_rad: [0.1, 0.2, -0.1] },
                    Pose { position_m: [-0.01, 0.03, 0.74], rpy_rad: [-0.2, 0.3, 0.1] },
                ],
                to: Pose { position_m: [0.02, -0.03, 0.75], rpy_rad: [-0.5, 0.1, 0.3] },
                duration_s: 2.0,
            },
        ],
    }
}

/// Reads `[v]×` back from a skew matrix.
fn unskew(m: Matrix3<f64>) -> Vector3<f64> {
    0.5 * Vector3::new(m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)])
}

fn check(label: &str, t: f64, got: Vector3<f64>, want: Vector3<f64>, tolerance: f64) {
    let error = got - want;
    assert!(error.dot(&error).sqrt() < tolerance, "{label} at {t}: {got:?} against {want:?}");
}

#[test]
fn rates_and_accelerations_are_finite_differences_of_position_and_rotation_matrix() {
    let trajectory = program().trajectory().unwrap();
    let h = 1e-4;
    // Times inside each segment and inside each ramp, none within h of a seam (the jerk jumps there).
    for t in [0.15, 0.5, 1.1, 1.9, 2.2, 3.1, 4.0, 5.7, 6.9, 7.8, 8.6, 9.9, 11.3, 12.7, 13.3, 14.1, 14.8] {
        let (before, now, after) = (trajectory.state(t - h), trajectory.state(t), trajectory.state(t + h));
        check("v", t, (after.position - before.position) / (2.0 * h), now.velocity, 2e-6);
        check("a", t, (after.velocity - before.velocity) / (2.0 * h), now.acceleration, 2e-5);
        // [ω]× = Rᵀ Ṙ, in the plate's axes.
        let spin = now.rotation.transpose() * (after.rotation - before.rotation) / (2.0 * h);
        check("omega", t, unskew(spin), now.angular_rate, 2e-6);
        // ω̇ from the rotation matrix alone: the axial part of Rᵀ R̈, because [ω]×² is symmetric.
        let second = (after.rotation - 2.0 * now.rotation + before.rotation) / (h * h);
        check("omega dot", t, unskew(now.rotation.transpose() * second), now.angular_acceleration, 2e-5);
    }
}

#[test]
fn rotation_is_orthonormal_and_follows_the_fixed_axes_convention() {
    let state = program().trajectory().unwrap().state(3.3);
    let gap = state.rotation.transpose() * state.rotation - Matrix3::identity();
    assert!(gap.iter().all(|e| e.abs() < 1e-15));
    // Roll 90° then yaw 90° about fixed axes carries y to z and leaves it there.
    let quarter = std::f64::consts::FRAC_PI_2;
    let r = super::super::rotation::rotation_from_rpy([quarter, 0.0, quarter]);
    assert!((r * Vector3::y() - Vector3::z()).iter().all(|e| e.abs() < 1e-15));
}

#[test]
fn position_rate_and_acceleration_are_continuous_across_every_seam() {
    let p = program();
    let trajectory = p.trajectory().unwrap();
    let mut seam = 0.0;
    let mut seams = vec![0.0];
    for s in &p.segments {
        seam += s.duration_s();
        seams.push(seam);
    }
    seams.extend([2.0 + 1.5, 8.0 - 1.5, 8.0 + 1.2, 13.0 - 1.2]);
    for t in seams {
        let (a, b) = (trajectory.coordinates(t - 1e-9), trajectory.coordinates(t + 1e-9));
        for i in 0..6 {
            assert!((a.value[i] - b.value[i]).abs() < 1e-8, "value {i} at {t}");
            assert!((a.rate[i] - b.rate[i]).abs() < 1e-7, "rate {i} at {t}");
            assert!((a.acceleration[i] - b.acceleration[i]).abs() < 1e-6, "acceleration {i} at {t}");
        }
    }
}

#[test]
fn a_sphere_leaves_its_point_where_it_is_and_returns_to_its_pose() {
    let trajectory = program().trajectory().unwrap();
    let point = Vector3::new(0.02, -0.03, 0.2);
    let at = |t: f64| {
        let s = trajectory.state(t);
        s.position + s.rotation * point
    };
    for t in [8.4, 9.3, 10.0, 11.7, 12.9] {
        check("still point", t, at(t), at(8.0), 1e-14);
        assert!((trajectory.state(t).rotation - trajectory.state(8.0).rotation).norm() > 1e-4);
    }
}

/// Differences of exact second derivatives over 0.1 ms never exceed the bound, and the bound is not idle:
/// within a factor of ten of the largest of them.
#[test]
fn third_derivatives_stay_below_their_bounds() {
    let trajectory = program().trajectory().unwrap();
    let seams = trajectory.seams_s();
    assert_eq!(seams.len(), 10);
    for pair in seams.windows(2) {
        let [jerk, second] = trajectory.third_derivatives(0.5 * (pair[0] + pair[1]));
        let (mut most, mut most_turning) = (0.0_f64, 0.0_f64);
        let (steps, h) = (400, 1e-4);
        for k in 0..steps {
            let t = pair[0] + (pair[1] - pair[0] - h) * f64::from(k) / f64::from(steps - 1);
            let (a, b) = (trajectory.state(t), trajectory.state(t + h));
            let turning = b.rotation * b.angular_acceleration - a.rotation * a.angular_acceleration;
            most = most.max((b.acceleration - a.acceleration).norm() / h);
            most_turning = most_turning.max(turning.norm() / h);
        }
        assert!(most <= jerk * (1.0 + 1e-9) + 1e-9, "{pair:?}: {most} {jerk}");
        assert!(most_turning <= second * (1.0 + 1e-9) + 1e-9, "{pair:?}: {most_turning} {second}");
        assert!(second < 10.0 * most_turning + 1e-6, "{pair:?}: {most_turning} {second}");
    }
}

#[test]
fn a_multisine_returns_to_the_pose_it_began_at() {
    let mut p = program();
    p.segments.truncate(3);
    let trajectory = p.trajectory().unwrap();
    assert_eq!(trajectory.end_pose(), Pose { position_m: [0.02, -0.03, 0.75], rpy_rad: [0.5, -0.4, 0.3] });
    assert_eq!(trajectory.coordinates(99.0).rate, [0.0; 6]);
}

#[test]
fn nonsense_segments_are_refused_by_number() {
    let mut p = program();
    p.segments.push(Segment::Hold { duration_s: f64::NAN });
    assert!(matches!(p.trajectory(), Err(MotionError::BadSegment { segment: 6, .. })));
    p.segments[4] = Segment::Multisine { duration_s: 1.0, ramp_s: 0.6, terms: vec![] };
    assert!(matches!(p.trajectory(), Err(MotionError::BadSegment { segment: 5, .. })));
}

#[test]
fn a_path_begins_and_ends_at_rest_and_passes_through_its_poses() {
    let p = program();
    let trajectory = p.trajectory().unwrap();
    let Segment::Path { via, to, .. } = &p.segments[4] else { panic!() };
    // The quintic is 1/3 and 2/3 there: u (1 − u) and its mirror image.
    let (mut low, mut high) = (0.0, 0.5);
    for _ in 0..60 {
        let s: f64 = 0.5 * (low + high);
        if s.powi(3) * (10.0 + s * (6.0 * s - 15.0)) < 1.0 / 3.0 { low = s } else { high = s }
    }
    for (share, pose) in [(low, &via[0]), (1.0 - low, &via[1]), (1.0 - 1e-6, to)] {
        let c = trajectory.coordinates(13.0 + 2.0 * share);
        for (got, want) in c.value.iter().zip(pose.coordinates()) {
            assert!((got - want).abs() < 1e-12, "{share}: {got} {want}");
        }
    }
    for t in [13.0 + 1e-9, 15.0 - 1e-9] {
        let c = trajectory.coordinates(t);
        assert!(
            c.rate.iter().all(|r| r.abs() < 1e-8) && c.acceleration.iter().all(|a| a.abs() < 1e-6),
            "{c:?}"
        );
    }
    // At mid-way it has not stopped.
    assert!(trajectory.state(14.0).angular_rate.norm() > 0.3);
    let mut none = program();
    none.segments.push(Segment::Path { via: Vec::new(), to: *to, duration_s: 1.0 });
    assert!(matches!(none.trajectory(), Err(MotionError::BadSegment { segment: 6, .. })));
}

#[test]
fn a_program_survives_json() {
    let text = serde_json::to_string(&program()).unwrap();
    assert!(text.contains("{\"multisine\":{") && text.contains("\"axis\":\"roll\""), "{text}");
    assert_eq!(serde_json::from_str::<MotionProgram>(&text).unwrap(), program());
}
