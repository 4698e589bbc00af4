//! Kinematics, limits and forces against other ways to compute them.

use nalgebra::{Matrix3, Vector3, Vector6};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::*;
use crate::body::BodyParameters;

/// Uniform numbers from a seed.
struct Uniform(ChaCha8Rng);

impl Uniform {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn within(&mut self, half: f64) -> f64 {
        half * (2.0 * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64 - 1.0)
    }

    fn vector(&mut self, half: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.within(half))
    }
}

/// Returns poses from all over the workspace: within the legs' lengths and the guard, tilts to 69°, yaw to
/// 80°.
fn workspace(g: &Geometry, random: &mut Uniform, count: usize) -> Vec<Pose> {
    let mut poses = Vec::new();
    while poses.len() < count {
        let [x, y] = [random.within(0.4), random.within(0.4)];
        let z = 0.7 + random.within(0.3);
        let rpy_rad = [random.within(1.2), random.within(1.2), random.within(1.4)];
        let pose = Pose { position_m: [x, y, z], rpy_rad };
        let position = Vector3::from(pose.position_m);
        if g.reaches(&position, &rotation_from_rpy(rpy_rad)) && g.check_pose(&pose).is_ok() {
            poses.push(pose);
        }
    }
    poses
}

fn body() -> BodyParameters {
    BodyParameters {
        mass_kg: 20.0,
        com_m: [0.012, -0.02, 0.247],
        inertia_com_kgm2: [0.505, 0.495, 0.0362, 0.011, -0.007, 0.004],
    }
}

fn swing() -> Trajectory {
    let term =
        |axis, amplitude, frequency_hz, phase_rad| SineTerm { axis, amplitude, frequency_hz, phase_rad };
    MotionProgram {
        start: Geometry::thesis().home(),
        segments: vec![Segment::Multisine {
            duration_s: 6.0,
            ramp_s: 1.5,
            terms: vec![
                term(Axis::X, 0.03, 0.7, 0.1),
                term(Axis::Z, 0.02, 1.3, 1.0),
                term(Axis::Roll, 0.25, 0.41, 0.3),
                term(Axis::Pitch, 0.2, 0.53, -1.0),
                term(Axis::Yaw, 0.3, 0.67, 0.5),
            ],
        }],
    }
    .trajectory()
    .unwrap()
}

#[test]
fn forward_kinematics_undoes_inverse_kinematics_from_any_start_to_any_target_in_the_workspace() {
    let g = Geometry::thesis();
    let poses = workspace(&g, &mut Uniform::new(7), 3_000);
    for pair in poses.windows(2) {
        let (start, target) = (&pair[0], &pair[1]);
        let found = g.forward(&g.leg_lengths(target), start).unwrap();
        // Newton stops at length errors of 1e-13 m or their rounding, 6e-12 m; legs answer a unit step of the
        // plate with no less than 1/(40 · √6) (cond(H) ≤ 40, every column of H at least one long).
        let turned = rotation_from_rpy(found.rpy_rad) - rotation_from_rpy(target.rpy_rad);
        let moved = Vector3::from(found.position_m) - Vector3::from(target.position_m);
        assert!(turned.amax() < 1e-9 && moved.amax() < 1e-9, "{start:?} {target:?} {found:?}");
    }
}

#[test]
fn forward_kinematics_names_a_leg_beyond_its_reach_and_lengths_that_fit_no_pose() {
    let g = Geometry::thesis();
    let mut lengths = g.leg_lengths(&g.home());
    lengths[3] = 0.9;
    let error = g.forward(&lengths, &g.home()).unwrap_err().to_string();
    assert!(error.contains("leg 4") && error.contains("0.9"), "{error}");
    // Legs 1 and 2 meet in one plate joint and their base joints are 2 · 0.45 sin 50° = 0.689 m apart: far
    // more stroke than this machine has would be needed to break that triangle, so give it such legs.
    let long = Geometry { leg_length_m: [0.05, 2.0], ..g };
    let error = long.forward(&[0.1, 0.2, 0.7, 0.7, 0.7, 0.7], &long.home()).unwrap_err();
    assert!(matches!(error, ForwardError::NoPose { error_m, .. } if error_m > 1e-3), "{error:?}");
}

#[test]
fn rates_and_accelerations_of_the_legs_are_finite_differences_of_their_lengths() {
    let (g, path, h) = (Geometry::thesis(), swing(), 1e-4);
    for k in 1..58 {
        let t = 0.1 * f64::from(k) + 0.0123;
        let at = |t: f64| Vector6::from(g.leg_lengths(&path.state(t).pose()));
        let (before, now, after) = (at(t - h), at(t), at(t + h));
        let rate = (after - before) / (2.0 * h) - Vector6::from(g.leg_rates(&path.state(t)));
        let acceleration =
            (after - 2.0 * now + before) / (h * h) - Vector6::from(g.leg_accelerations(&path.state(t)));
        // Truncation h²/6 · l''' and h²/12 · l'''' with derivatives below 60 and 600; rounding 2e-16/h² ≈
        // 2e-8.
        assert!(rate.amax() < 1e-7, "{t}: {rate}");
        assert!(acceleration.amax() < 6e-7, "{t}: {acceleration}");
    }
}

#[test]
fn leg_forces_do_the_work_that_the_wrench_does_in_every_virtual_displacement() {
    // Σ f_i δl_i = w · (δx, δφ), with the δl_i from the vector loop alone.
    let g = Geometry::thesis();
    let mut random = Uniform::new(3);
    for pose in workspace(&g, &mut random, 50) {
        let (force, moment) = (random.vector(300.0), random.vector(60.0));
        let wrench = Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
        let forces = Vector6::from(g.legs(&pose).forces(&wrench).unwrap());
        let (shift, turn, h) = (random.vector(1.0), random.vector(1.0), 1e-5);
        let at = |s: f64| {
            let rotation = nalgebra::Rotation3::new(turn * s) * rotation_from_rpy(pose.rpy_rad);
            Vector6::from(g.legs_at(&(Vector3::from(pose.position_m) + shift * s), &rotation).lengths)
        };
        let work = forces.dot(&(at(h) - at(-h))) / (2.0 * h);
        let want = force.dot(&shift) + moment.dot(&turn);
        // h² · l''' /6 ≈ 1e-10 and rounding 1e-16/h = 1e-11 per leg, times forces up to 40 · 600 N.
        assert!((work - want).abs() < 1e-5, "{work} {want}");
    }
}

#[test]
fn power_of_the_legs_is_the_rate_of_change_of_the_bodys_energy() {
    let (g, path, load, b, h) = (Geometry::thesis(), swing(), Load::body(body()), body(), 1e-3);
    let energy = |t: f64| {
        let s = path.state(t);
        let arm = s.rotation * Vector3::from(b.com_m);
        let w = s.rotation * s.angular_rate;
        let v = s.velocity + w.cross(&arm);
        let spin = s.angular_rate.dot(&(b.inertia_com() * s.angular_rate));
        0.5 * (b.mass_kg * v.dot(&v) + spin) + b.mass_kg * 9.80665 * (s.position + arm).z
    };
    for k in 1..20 {
        // Never within h of a seam, where the motion's third derivative jumps.
        let t = 0.3 * f64::from(k) + 0.05;
        let s = path.state(t);
        let forces = g.leg_force_ranges(&s, t, &load).unwrap();
        let power: f64 = forces.iter().zip(g.leg_rates(&s)).map(|([f, _], rate)| f * rate).sum();
        let pair = |h: f64| (energy(t + h) - energy(t - h)) / (2.0 * h);
        let slope = (4.0 * pair(h) - pair(2.0 * h)) / 3.0;
        // Truncation h^4/30 · 4 · fifth derivative, with 30 W at 1.3 Hz 2e-8 W; rounding 150 J · 2e-16 / h =
        // 3e-11 W.
        assert!((power - slope).abs() < 1e-7, "{t}: {power} {slope}");
    }
}

#[test]
fn a_bounding_body_holds_the_forces_of_every_body_inside_it_and_one_of_them_comes_near() {
    let g = Geometry::thesis();
    let (centre, radius, mass) = (Vector3::new(0.02, -0.01, 0.2), 0.15, 20.0);
    let load =
        Load::new(Bodies::Within { known: Vec::new(), body: BodySet::bounded(mass, centre.into(), radius) });
    let mut random = Uniform::new(11);
    for k in 1..10 {
        let state = swing().state(0.6 * f64::from(k));
        let bounds = g.leg_force_ranges(&state, 0.0, &load).unwrap();
        let mut seen = [[0.0_f64; 2]; 6];
        for _ in 0..300 {
            // A point mass anywhere in the ball is the extreme case: any body there is a mixture of them.
            let mut at = random.vector(1.0);
            while at.norm() > 1.0 {
                at = random.vector(1.0);
            }
            let on_surface = at.normalize() * radius + centre;
            let point =
                BodyParameters { mass_kg: mass, com_m: on_surface.into(), inertia_com_kgm2: [0.0; 6] };
            let forces = g.leg_force_ranges(&state, 0.0, &Load::body(point)).unwrap();
            for (leg, [f, _]) in forces.into_iter().enumerate() {
                let [low, high] = bounds[leg];
                assert!(low - 1e-9 <= f && f <= high + 1e-9, "leg {}: {f} outside {low}..{high}", leg + 1);
                seen[leg] = [seen[leg][0].min(f), seen[leg][1].max(f)];
            }
        }
        for ([low, high], [least, most]) in bounds.into_iter().zip(seen) {
            // 300 directions leave some 7° unvisited, 1 % of the reach; slope and curvature need not point
            // alike, and the set also holds lighter bodies with the same spread.
            let (bound, extreme) = (high.max(-low), most.max(-least));
            assert!(extreme > 0.8 * bound, "{low}..{high} but seen {least}..{most}");
        }
    }
}

#[test]
fn sets_of_bodies_move_with_their_frame_and_have_the_forces_of_their_bodies() {
    let g = Geometry::thesis();
    let mut random = Uniform::new(5);
    let (offset, gravity) = (Vector3::new(0.03, -0.02, 0.11), Vector3::new(0.0, 0.0, -9.80665));
    let rotation = *nalgebra::Rotation3::from_euler_angles(0.4, -0.7, 1.9).matrix();
    for k in 1..10 {
        let (state, body) = (swing().state(0.6 * f64::from(k)), body());
        let moved = BodySet::known(&body).in_frame(&offset, &rotation);
        for (a, b) in moved.middle.iter().zip(body.in_frame(&offset, &rotation).parameters()) {
            assert!((a - b).abs() < 1e-12, "{moved:?}");
        }
        // Newton and Euler of the body itself, against the parameters' linear form.
        let (u, v) = (random.vector(1.0), random.vector(1.0));
        let wrench = body.wrench(&FrameMotion::of_plate(&state), &gravity);
        let direct =
            u.dot(&Vector3::from_row_slice(&wrench[..3])) + v.dot(&Vector3::from_row_slice(&wrench[3..]));
        let [low, high] =
            BodySet::known(&body).range(&crate::body_set::linear_form(&state, &gravity, &u, &v));
        assert!(low == high && (low - direct).abs() < 1e-10 * direct.abs().max(1.0), "{low} {direct}");
        let both = BodySet::bounded(1.2 * body.mass_kg, [0.0; 3], 0.5).and(BodySet::known(&body));
        let a = crate::body_set::linear_form(&state, &gravity, &u, &v);
        assert_eq!(both.range(&a), BodySet::known(&body).range(&a));
        // What a scale allows holds the body, and the forces that it takes.
        let phi = body.parameters();
        let radius = 0.35;
        let set = BodySet::weighed(
            body.mass_kg * 1.02,
            0.05 * body.mass_kg,
            [phi[1], phi[2], 0.0],
            0.01,
            [0.0, 0.0, 1.0],
            radius,
        );
        assert!(set.may_hold(&body));
        assert!(!set.may_hold(&BodyParameters { mass_kg: 1.1 * body.mass_kg, ..body }));
        let bounds =
            g.leg_force_ranges(&state, 0.0, &Load::new(Bodies::Within { known: Vec::new(), body: set }));
        let forces = g.leg_force_ranges(&state, 0.0, &Load::body(body)).unwrap();
        for ([low, high], [f, _]) in bounds.unwrap().into_iter().zip(forces) {
            assert!((low..=high).contains(&f), "{low}..{high} {f}");
        }
    }
}

#[test]
fn an_ellipsoid_of_bodies_has_the_extremes_of_its_boundary() {
    let root: Vec<[f64; 10]> = (0..10)
        .map(|k| {
            std::array::from_fn(|j| if j < k { 0.0 } else { 0.01 * (1.0 + ((3 * j + 7 * k) % 5) as f64) })
        })
        .collect();
    let middle = body().parameters();
    let set = BodySet::estimated(middle, &root, 2.5);
    let mut random = Uniform::new(3);
    let a: [f64; 10] = std::array::from_fn(|_| random.vector(1.0).x);
    let along: Vec<f64> = root.iter().map(|l| l.iter().zip(&a).map(|(l, a)| l * a).sum()).collect();
    let norm = along.iter().map(|v: &f64| v * v).sum::<f64>().sqrt();
    // The extreme lies where the shares are along the functional.
    let extreme: f64 = (0..10)
        .map(|j| {
            a[j] * (middle[j] + 2.5 * root.iter().zip(&along).map(|(l, s)| l[j] * s / norm).sum::<f64>())
        })
        .sum();
    assert!((set.range(&a)[1] - extreme).abs() < 1e-12);
}

#[test]
fn condition_numbers_are_the_published_ones_and_grow_beyond_every_bound_at_a_yaw_of_ninety_degrees() {
    let g = Geometry::thesis();
    let mut pose = g.home();
    let mut at_yaw = |deg: f64| {
        pose.rpy_rad[2] = deg.to_radians();
        (g.condition_number(&pose), pose)
    };
    assert!((at_yaw(0.0).0 - 7.1).abs() < 0.05);
    assert!((at_yaw(70.0).0 - 21.8).abs() < 0.05);
    assert!(at_yaw(90.0).0 > 1e12);
    // Fichter's singularity is an isolated zero: the number falls off as the inverse of the distance, on both
    // sides.
    for near in [0.1, 0.01] {
        let ratio = at_yaw(90.0 - near / 10.0).0 / at_yaw(90.0 - near).0;
        assert!((ratio - 10.0).abs() < 0.1, "{ratio}");
    }
    // And beyond it the number alone would let a pose pass that cannot be reached.
    let (condition, beyond) = at_yaw(110.0);
    assert!(condition < COND_MAX, "{condition}");
    let wide = Geometry { leg_length_m: [0.3, 1.2], ..g.clone() };
    let refused = wide.check_pose(&beyond).unwrap_err();
    assert_eq!(refused.limit, Limit::Conditioning);
    assert!(refused.to_string().contains("beyond a singular"), "{refused}");
}

#[test]
fn the_shortcut_of_the_guard_agrees_with_the_condition_number() {
    let g = Geometry { limits: Limits { cond_max: 12.0, ..Limits::default() }, ..Geometry::thesis() };
    let all = Geometry { limits: Limits { cond_max: 1e6, ..Limits::default() }, ..Geometry::thesis() };
    let mut kept = 0;
    for pose in workspace(&all, &mut Uniform::new(5), 500) {
        let legs = g.legs(&pose);
        assert_eq!(g.is_guarded(&legs), g.guarded_condition(&legs) <= 12.0);
        kept += usize::from(g.is_guarded(&legs));
    }
    assert!((50..450).contains(&kept), "{kept} of 500: the test sees one side only");
}

#[test]
fn quick_check_and_margins_agree_on_every_limit() {
    let mut g = Geometry::thesis();
    g.limits.leg_acceleration_mps2 = Some(4.0);
    g.limits.base_joints = Some(g.cones_about_home(0.35));
    g.limits.plate_joints = Some(g.cones_about_home(0.45));
    g.limits.bulk = Some(Bulk {
        leg_radius_m: 0.025,
        joint_length_m: 0.08,
        plate_radius_m: Some(0.02),
        base_radius_m: Some(0.02),
        clearance_m: 0.004,
    });
    let mut random = Uniform::new(9);
    let mut kept = 0;
    for pose in workspace(&Geometry::thesis(), &mut random, 2_000) {
        let [roll, pitch, yaw] = pose.rpy_rad;
        let state = PlateState {
            rpy: Vector3::from(pose.rpy_rad),
            position: Vector3::from(pose.position_m),
            velocity: random.vector(0.3),
            acceleration: random.vector(1.0),
            rotation: rotation_from_rpy([roll, pitch, yaw]),
            angular_rate: random.vector(0.5),
            angular_acceleration: random.vector(2.0),
        };
        let margins = g.margins(&state, None);
        assert_eq!(margins.check().is_ok(), margins.tightest().relative >= 0.0);
        assert_eq!(g.check_state(&state, 0.0).is_ok(), margins.check().is_ok(), "{:?}", margins.tightest());
        kept += usize::from(margins.check().is_ok());
    }
    assert!((100..1900).contains(&kept), "{kept}");
}

#[test]
fn joint_angles_are_zero_at_home_and_follow_the_plate() {
    let mut g = Geometry::thesis();
    g.limits.base_joints = Some(g.cones_about_home(0.2));
    g.limits.plate_joints = Some(g.cones_about_home(0.2));
    let home = Trajectory::resting(&g.home()).state(0.0);
    for angle in [g.margins(&home, None).base_joint_rad, g.margins(&home, None).plate_joint_rad] {
        assert!(angle.unwrap().iter().all(|a| *a < 1e-12));
    }
    // Straight up: no joint turns with the plate, so both angles are the change of each leg's direction.
    let mut up = g.home();
    up.position_m[2] += 0.05;
    let margins = g.margins(&Trajectory::resting(&up).state(0.0), None);
    let (before, after) = (g.legs(&g.home()), g.legs(&up));
    for i in 0..6 {
        let want = before.directions[i].dot(&after.directions[i]).acos();
        assert!((margins.base_joint_rad.unwrap()[i] - want).abs() < 1e-7);
        assert!((margins.plate_joint_rad.unwrap()[i] - want).abs() < 1e-7);
    }
    let mut tilted = g.home();
    tilted.rpy_rad[0] = 0.35;
    let refused = g.check_pose(&tilted).unwrap_err();
    assert_eq!(refused.limit, Limit::PlateJointAngle);
    assert!(refused.to_string().contains("° at its plate joint, which allows 11.5°"), "{refused}");
}

#[test]
fn a_load_that_is_too_heavy_names_the_leg_the_force_and_the_time() {
    let mut g = Geometry::thesis();
    g.limits.leg_force_n = Some(40.0);
    let error = g.check_loaded(&swing(), &Load::body(body())).unwrap_err().to_string();
    assert!(error.contains("leg ") && error.contains("its limit is 40.0 N at t = "), "{error}");
    g.limits.leg_force_n = Some(1e4);
    g.check_loaded(&swing(), &Load::body(body())).unwrap();
    // The peak is what the limit compares with; between samples 0.1 ms apart it is missed by 1e-8 of itself.
    let peak =
        g.peak_leg_forces(&swing(), 1e-4, &Load::body(body())).unwrap().into_iter().fold(0.0, f64::max);
    // What is a microsecond from a sample is known to some 1e-4 of it.
    g.limits.leg_force_n = Some(peak * 1.001);
    g.check_loaded(&swing(), &Load::body(body())).unwrap();
    g.limits.leg_force_n = Some(peak * 0.999_999);
    g.check_loaded(&swing(), &Load::body(body())).unwrap_err();
}

/// A body above the joints' middle stands on, or hangs from, six legs alike: each carries `m g / (6 n_z)`.
#[test]
fn pushing_pulling_and_buckling_legs_have_limits_of_their_own() {
    let g = Geometry::thesis();
    let legs = g.legs(&g.home());
    let body =
        BodyParameters { mass_kg: 20.0, com_m: [0.0; 3], inertia_com_kgm2: [0.1, 0.1, 0.1, 0.0, 0.0, 0.0] };
    let (standing, mut hanging) = (Load::body(body), Load::body(body));
    hanging.gravity_mps2[2] *= -1.0;
    let force = 20.0 * STANDARD_GRAVITY_MPS2 / (6.0 * legs.directions[0].z);
    let length = g.leg_lengths(&g.home())[0];
    let limited = |set: fn(&mut Limits, f64), value: f64| {
        let mut g = g.clone();
        set(&mut g.limits, value);
        g
    };
    let push = |limits: &mut Limits, value| limits.leg_push_n = Some(value);
    let pull = |limits: &mut Limits, value| limits.leg_pull_n = Some(value);
    let buckling = |limits: &mut Limits, value| limits.leg_buckling_nm2 = Some(value);
    let squared = force * length * length;
    for (set, most, binds, free, words) in [
        (push as fn(&mut Limits, f64), force, &standing, &hanging, "would push with 37.6"),
        (pull, force, &hanging, &standing, "would pull with 37.6"),
        (buckling, squared, &standing, &hanging, "buckling"),
    ] {
        let home = g.home();
        limited(set, 1.001 * most).check_pose_loaded(&home, binds).unwrap();
        limited(set, 0.1).check_pose_loaded(&home, free).unwrap();
        let refused = limited(set, 0.999 * most).check_pose_loaded(&home, binds).unwrap_err();
        assert!(refused.limit.is_of_force() && refused.to_string().contains(words), "{refused}");
        // Over a motion too.
        let hold = MotionProgram { start: home, segments: vec![Segment::Hold { duration_s: 1.0 }] };
        let hold = hold.trajectory().unwrap();
        limited(set, 1.001 * most).check_loaded(&hold, binds).unwrap();
        limited(set, 0.999 * most).check_loaded(&hold, binds).unwrap_err();
    }
}

/// The quintic's third derivative is `60 way / duration³` at its ends, and straight up all legs have it
/// alike.
#[test]
fn a_jerk_beyond_its_limit_is_refused_and_more_time_helps() {
    let mut g = Geometry::thesis();
    let mut up = g.home();
    up.position_m[2] += 0.05;
    let home = g.home();
    let rise = |duration_s: f64| {
        let segments = vec![Segment::Move { to: up, duration_s }];
        MotionProgram { start: home, segments }.trajectory().unwrap()
    };
    // Near rest l''' = n_z z'''.
    let least = 60.0 * 0.05 * g.legs(&g.home()).directions[0].z;
    g.limits.leg_jerk_mps3 = Some(0.99 * least);
    let refused = g.check(&rise(1.0)).unwrap_err();
    assert!(
        matches!(&refused, MotionError::Limit { violation, .. } if violation.limit == Limit::LegJerk),
        "{refused}"
    );
    assert!(
        refused.to_string().contains("jerk of leg") && refused.to_string().contains("more time"),
        "{refused}"
    );
    g.limits.leg_jerk_mps3 = Some(1.2 * least);
    g.check(&rise(1.1)).unwrap();
    assert!((g.jerk_share(&rise(2.0)) - g.jerk_share(&rise(1.0)) / 8.0).abs() < 0.2);
}

#[test]
fn a_limit_that_is_hardly_overstepped_is_reported_with_as_many_digits_as_show_it() {
    use super::{Limit, Violation};
    let said =
        |limit, value, allowed| Violation { limit, leg: Some(2), between: None, value, allowed }.to_string();
    for (got, words) in [
        (
            said(Limit::LegLength, 0.549_96, [0.55, 0.8548]),
            "would be 0.54996 m long, it reaches from 0.55000 m",
        ),
        (
            said(Limit::LegLength, 0.5, [0.55, 0.8548]),
            "would be 0.5000 m long, it reaches from 0.5500 m to 0.8548 m",
        ),
        (said(Limit::LegLength, 0.5, [0.55, 1e300]), "from 0.5500 m to 1.00e300 m"),
        (said(Limit::LegRate, -4e-5, [-3e-5, 3e-5]), "would move at 4.00e-5 m/s, its limit is 3.00e-5 m/s"),
        (
            said(Limit::LegRate, -0.020_04, [-0.02, 0.02]),
            "would move at 0.02004 m/s, its limit is 0.02000 m/s",
        ),
        (said(Limit::Conditioning, 40.000_02, [1.0, 40.0]), "would be 40.00002, its limit is 40.00000"),
    ] {
        assert!(got.contains(words), "{got}\n{words}");
    }
}

#[test]
fn a_stroke_is_centred_and_one_that_is_not_there_is_refused() {
    let g = Geometry::thesis().with_stroke(0.20).unwrap();
    assert!((g.leg_length_m[1] - g.leg_length_m[0] - 0.20).abs() < 1e-15);
    assert!((g.leg_length_m[0] + g.leg_length_m[1] - 2.0 * 0.7024).abs() < 1e-15);
    for stroke in [0.0, -0.1, 0.31, f64::NAN] {
        Geometry::thesis().with_stroke(stroke).unwrap_err();
    }
    let whole = Geometry::thesis().with_stroke(0.3048).unwrap();
    assert!(whole.check_pose(&whole.home()).is_ok());
}

#[test]
fn roll_pitch_and_yaw_read_back_from_a_rotation_are_those_that_made_it() {
    let mut random = Uniform::new(1);
    for _ in 0..1_000 {
        let rpy = [random.within(3.1), random.within(1.57), random.within(3.1)];
        let back = super::rotation::rpy_from_rotation(&rotation_from_rpy(rpy));
        // Roll and yaw are known to rounding over cos(pitch), which is 8e-4 at its least here.
        assert!(rpy.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-12), "{rpy:?} {back:?}");
    }
    let straight_down = rotation_from_rpy([0.4, std::f64::consts::FRAC_PI_2, 0.1]);
    let back = super::rotation::rpy_from_rotation(&straight_down);
    let gap: Matrix3<f64> = rotation_from_rpy(back) - straight_down;
    assert!(gap.amax() < 1e-12, "{back:?}");
}
