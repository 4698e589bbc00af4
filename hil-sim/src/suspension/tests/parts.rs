//! Modes, markers and bad input.

use nalgebra::{Matrix3, Matrix3xX, Vector3};

use super::super::*;
use super::{GRAVITY, chain, moving, rests};

#[test]
fn stiffness_is_the_slope_of_the_springs_forces() {
    // Without gravity nothing but the springs acts, so the finite differences behind the modes see them
    // alone.
    let rig = Suspension { gravity_mps2: 0.0, ..chain() }.at_rest(&rests()).unwrap();
    let state = rig.state(&Start::resting(&rests())).unwrap();
    let (ours, slope) = (rig.spring_stiffness(), rig.rigid_stiffness(&state));
    assert!((&slope - ours).amax() < 1e-7 * ours.amax(), "{slope} {ours}");
    assert!((ours - ours.transpose()).amax() < 1e-12 * ours.amax());
    // With gravity, preloads and weights add theirs, and the whole is symmetric about a rest.
    let heavy = chain().at_rest(&rests()).unwrap();
    assert_eq!(ours, heavy.spring_stiffness());
    let mut whole = ours + heavy.preload_stiffness();
    for (body, frame) in heavy.bodies().zip(heavy.frames(&state)) {
        let com = frame.motion.position + frame.motion.rotation * Vector3::from(body.com_m);
        let mut turns = whole.fixed_view_mut::<3, 3>(3, 3);
        turns -= cross(&(body.mass_kg * GRAVITY)) * cross(&com);
    }
    let slope = heavy.rigid_stiffness(&state);
    assert!((&slope - whole).amax() < 1e-7 * ours.amax(), "{slope} {whole}");
    assert!((whole - whole.transpose()).amax() < 1e-12 * ours.amax());
}

/// Returns a platform that carries almost nothing, on springs that pass through its centre of mass.
fn plain() -> Suspension {
    let body = |mass_kg: f64, i: f64| BodyParameters {
        mass_kg,
        com_m: [0.0; 3],
        inertia_com_kgm2: [i, 1.2 * i, 1.4 * i, 0.0, 0.0, 0.0],
    };
    let corners = [[0.4, 0.3, 0.0], [-0.4, 0.3, 0.0], [-0.4, -0.3, 0.0], [0.4, -0.3, 0.0]];
    let springs =
        corners.map(|at| Spring { axial_nspm: 4.0, lateral_nspm: 2.0, ..Spring::upright(at, 1000.0, 200.0) });
    Suspension::of_body(body(10.0, 0.5), springs.to_vec(), Mounting::IDENTITY, body(10.0, 0.5))
}

#[test]
fn modes_of_a_plain_platform_are_those_of_six_oscillators() {
    let modes = plain().at_rest(&[]).unwrap().modes(&[]).unwrap();
    // 20 kg; 1, 1.2, 1.4 kg m²; k y², k x², k_lateral (x² + y²); no arm of the weight, for the centre of mass
    // is O.
    let omega2: [f64; 6] =
        [800.0 / 20.0, 800.0 / 20.0, 4000.0 / 20.0, 4000.0 * 0.09, 4000.0 * 0.16 / 1.2, 800.0 * 0.25 / 1.4];
    let loss = [8.0 / 20.0, 8.0 / 20.0, 16.0 / 20.0, 16.0 * 0.09, 16.0 * 0.16 / 1.2, 8.0 * 0.25 / 1.4];
    let mut want: Vec<(f64, f64)> = omega2
        .iter()
        .zip(loss)
        .map(|(w2, c)| (w2.sqrt() / std::f64::consts::TAU, c / (2.0 * w2.sqrt())))
        .collect();
    want.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (mode, (frequency, ratio)) in modes.iter().zip(want) {
        assert!((mode.frequency_hz / frequency - 1.0).abs() < 1e-8, "{mode:?} {frequency}");
        assert!((mode.damping_ratio / ratio - 1.0).abs() < 1e-8, "{mode:?} {ratio}");
    }
    let locked = Suspension { locked: [false, false, true, false, false, false], ..plain() };
    assert_eq!(locked.at_rest(&[]).unwrap().modes(&[]).unwrap().len(), 5);
}

#[test]
fn a_small_free_vibration_in_one_mode_keeps_its_shape_and_frequency() {
    let posture = [paper::posture_wxyz(&paper::POSTURES[0])];
    let mut made_of = paper::suspension(paper::JOINT_ELSEWHERE_M);
    made_of.links[0].locked = true;
    let rig = made_of.at_rest(&posture).unwrap();
    for mode in rig.modes(&posture).unwrap() {
        let much = 1e-5;
        let part = |k: usize| std::array::from_fn(|i| mode.shape[k + i] * much);
        let start = Start { velocity_mps: part(0), rate_radps: part(3), ..Start::resting(&posture) };
        let quarter = 0.25 / mode.frequency_hz;
        let run = Run { duration_s: quarter, rate_hz: 4.0 / quarter, step_s: None };
        let last = rig.simulate(&start, &run).unwrap().instants.pop().unwrap();
        // q = φ much sin(ω t) / ω, at its peak.
        let p = &last.platform;
        let peak = much / (std::f64::consts::TAU * mode.frequency_hz);
        let r = p.rotation;
        let turn = 0.5 * Vector3::new(r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12);
        let q: Vec<f64> = p.position.iter().chain(turn.iter()).copied().collect();
        for (got, shape) in q.iter().zip(mode.shape) {
            assert!((got / peak - shape).abs() < 2e-5, "{got} {shape}");
        }
        assert!(p.velocity.norm() < 2e-5 * much && p.angular_rate.norm() < 2e-5 * much);
    }
}

#[test]
fn a_stiff_support_changes_frequencies_a_little_downward() {
    let stiff = Support { mass_kg: 500.0, stiffness_npm: [1e6, 1e6, 4e6], damping_nspm: [0.0; 3] };
    let free = plain().at_rest(&[]).unwrap().modes(&[]).unwrap();
    let held = Suspension { support: Some(stiff), ..plain() }.at_rest(&[]).unwrap().modes(&[]).unwrap();
    assert_eq!(held.len(), 9);
    // In series: k' = k K / (k + K), to first order in m ω² / K.
    let ratio = (held[0].frequency_hz / free[0].frequency_hz).powi(2);
    assert!((ratio - 1.0 / (1.0 + 800.0 / 1e6)).abs() < 2e-5, "{ratio}");
}

/// Returns the least-squares pose of markers by SVD: `seen = R at + p`.
fn registered(at: &[Vector3<f64>], seen: &[Vector3<f64>]) -> (Matrix3<f64>, Vector3<f64>) {
    let mean = |v: &[Vector3<f64>]| v.iter().sum::<Vector3<f64>>() / v.len() as f64;
    let (a, b) = (mean(at), mean(seen));
    let about = |v: &[Vector3<f64>], m: &Vector3<f64>| {
        Matrix3xX::from_columns(&v.iter().map(|x| x - m).collect::<Vec<_>>())
    };
    let svd = (about(seen, &b) * about(at, &a).transpose()).svd(true, true);
    let r = svd.u.unwrap() * svd.v_t.unwrap();
    (r, b - r * a)
}

#[test]
fn markers_without_noise_give_the_pose_back() {
    let rig = chain().at_rest(&rests()).unwrap();
    let motion = rig.simulate(&moving(), &Run { duration_s: 0.1, rate_hz: 240.0, step_s: None }).unwrap();
    let cluster = MotionCapture::cluster(Carrier::Link(2), 0.1);
    let at: Vec<Vector3<f64>> = cluster.iter().map(|m| Vector3::from(m.at_m)).collect();
    let cameras = Mounting { position_m: [1.0, -2.0, 0.5], rotation_wxyz: [0.6, 0.0, 0.8, 0.0] };
    let capture = MotionCapture { noise_m: 0.0, cameras, ..MotionCapture::of(cluster) };
    let film = capture.film(&motion).unwrap();
    assert_eq!((film.rate_hz, film.seen_m.len()), (120.0, 13));
    let turn = cameras.rotation().unwrap();
    for (frame, now) in film.seen_m.iter().zip(motion.instants.iter().step_by(2)) {
        let seen: Vec<Vector3<f64>> = frame.iter().map(|s| Vector3::from(s.unwrap())).collect();
        let (r, p) = registered(&at, &seen);
        assert!((r - turn * now.links[2].rotation).amax() < 1e-13);
        assert!((p - turn * now.links[2].position - Vector3::from(cameras.position_m)).amax() < 1e-13);
    }
}

#[test]
fn noise_and_gaps_are_as_ordered_and_come_from_the_seed() {
    let rig = plain().at_rest(&[]).unwrap();
    let run = Run { duration_s: 30.0, rate_hz: 120.0, step_s: None };
    let motion = rig.simulate(&Start::resting(&[]), &run).unwrap();
    let hidden = vec![Hidden { marker: 1, from_s: 2.0, to_s: 3.0 }];
    let capture = MotionCapture {
        noise_m: 2e-4,
        dropout: 0.1,
        hidden,
        ..MotionCapture::of(MotionCapture::cluster(Carrier::Platform, 0.3))
    };
    let film = capture.film(&motion).unwrap();
    assert_eq!(film, capture.film(&motion).unwrap());
    assert_ne!(film, MotionCapture { seed: 1, ..capture.clone() }.film(&motion).unwrap());
    assert!(film.seen_m[240..360].iter().all(|f| f[1].is_none()));
    let mut errors = Vec::new();
    let mut lost = 0;
    for frame in &film.seen_m {
        for (seen, marker) in frame.iter().zip(&capture.markers) {
            match seen {
                Some(at) => errors.extend(at.iter().zip(marker.at_m).map(|(a, b)| a - b)),
                None => lost += 1,
            }
        }
    }
    let all = film.seen_m.len() * 5;
    // Of n draws a share is known to √(p q / n), a deviation to 1 / √(2 n); four of those.
    let share = (lost as f64 - 120.0 * 0.9) / all as f64;
    assert!((share - 0.1).abs() < 4.0 * (0.09 / all as f64).sqrt(), "{share}");
    let sigma = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    assert!((sigma / 2e-4 - 1.0).abs() < 4.0 / (2.0 * errors.len() as f64).sqrt(), "{sigma}");
}

#[test]
fn the_paper_s_whole_is_that_of_its_table_2() {
    // Forward from Table 1, s misses Table 2 by less than the paper's 1 mm.
    let want = [[0.0002, -0.2562, -0.1265], [-0.0001, -0.2382, -0.1244], [0.0332, -0.2468, -0.0942]];
    for (printed, want) in paper::POSTURES.iter().zip(want) {
        let r = Mounting { position_m: [0.0; 3], rotation_wxyz: paper::posture_wxyz(printed) }
            .rotation()
            .unwrap();
        let (a, b) = (paper::link_0(), paper::link_1().in_frame(&Vector3::zeros(), &r));
        let s = (a.mass_kg * Vector3::from(a.com_m) + b.mass_kg * Vector3::from(b.com_m)) / 80.817;
        assert!((s - Vector3::from(want)).amax() < 1.05e-3, "{s} {want:?}");
    }
}

#[test]
fn impossible_suspensions_are_named() {
    let refused = |change: &dyn Fn(&mut Suspension)| {
        let mut made_of = chain();
        change(&mut made_of);
        made_of.at_rest(&rests()).unwrap_err()
    };
    use SuspensionError as E;
    assert!(matches!(refused(&|s| s.links[0].parent = 1), E::Parent { link: 1, parent: 1 }));
    assert!(matches!(refused(&|s| s.springs[1].axial_npm = f64::NAN), E::Figure { .. }));
    assert!(matches!(refused(&|s| s.springs[1].axis = [0.0; 3]), E::Figure { .. }));
    assert!(matches!(refused(&|s| s.base.mass_kg = -1.0), E::Body { .. }));
    assert!(matches!(refused(&|s| s.locked[4] = true), E::SingleTurnLocked));
    assert!(matches!(refused(&|s| s.springs.clear()), E::NoPreload { .. }));
    assert!(matches!(refused(&|s| s.springs.truncate(1)), E::NoPreload { .. }));
    assert!(matches!(chain().at_rest(&rests()[..2]), Err(E::Joints { given: 2, links: 3 })));
    let rig = chain().at_rest(&rests()).unwrap();
    let run = Run { duration_s: 0.1, rate_hz: 120.0, step_s: None };
    let mut start = moving();
    start.joint_rate_radps[1] = [0.0, 0.0, 1.0];
    assert!(matches!(rig.simulate(&start, &run), Err(E::OffAxis { link: 2 })));
    assert!(matches!(rig.simulate(&moving(), &Run { rate_hz: 0.0, ..run }), Err(E::Figure { .. })));
    let long = Run { rate_hz: 2.0, duration_s: 5.0, step_s: Some(0.5) };
    assert!(matches!(rig.simulate(&moving(), &long), Err(E::Step { .. })));
    let locked = Suspension { locked: [false, false, true, false, false, false], ..chain() };
    let locked = locked.at_rest(&rests()).unwrap();
    assert!(matches!(locked.simulate(&moving(), &run), Err(E::LockedMoves { .. })));
    let motion = rig.simulate(&moving(), &run).unwrap();
    let odd = MotionCapture { rate_hz: 70.0, ..MotionCapture::of(Vec::new()) };
    assert!(matches!(odd.film(&motion), Err(E::CameraRate { .. })));
    let nowhere = MotionCapture::of(MotionCapture::cluster(Carrier::Link(9), 0.1));
    assert!(matches!(nowhere.film(&motion), Err(E::Figure { .. })));
}

#[test]
fn tall_loads_on_weak_springs_fall_over() {
    let mut made_of = plain();
    made_of.mount.position_m[2] = 5.0;
    let rig = made_of.at_rest(&[]).unwrap();
    assert!(matches!(rig.modes(&[]), Err(SuspensionError::Unstable)));
}
