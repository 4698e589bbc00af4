use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::super::*;
use super::*;
use crate::body::BodyParameters;

fn bulk() -> Bulk {
    Bulk {
        leg_radius_m: 0.025,
        joint_length_m: 0.08,
        plate_radius_m: Some(0.02),
        base_radius_m: Some(0.02),
        clearance_m: 0.002,
    }
}

fn machine() -> Geometry {
    let mut g = Geometry::thesis();
    g.limits.leg_acceleration_mps2 = Some(8.0);
    g.limits.leg_jerk_mps3 = Some(900.0);
    g.limits.leg_force_n = Some(400.0);
    g.limits.leg_push_n = Some(390.0);
    g.limits.leg_pull_n = Some(200.0);
    g.limits.leg_buckling_nm2 = Some(300.0);
    g.limits.base_joints = Some(g.cones_about_home(0.9));
    g.limits.plate_joints = Some(g.cones_about_home(1.1));
    g.limits.bulk = Some(bulk());
    g
}

/// Returns a random program of a move, a multisine, a sphere and a path that stays well away from singular
/// poses.
fn program(g: &Geometry, seed: u64) -> MotionProgram {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut unit = move || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let home = g.home();
    let mut to = home;
    for k in 0..3 {
        to.position_m[k] += 0.06 * (unit() - 0.5);
        to.rpy_rad[k] += 0.4 * (unit() - 0.5);
    }
    let axes = [Axis::X, Axis::Y, Axis::Z, Axis::Roll, Axis::Pitch, Axis::Yaw];
    let terms = (0..12).map(|k| {
        let frequency_hz = 0.2 + 1.6 * unit();
        let scale = if k % 6 < 3 { 0.012 } else { 0.08 };
        let amplitude = scale * unit() / frequency_hz.max(0.5);
        SineTerm { axis: axes[k % 6], amplitude, frequency_hz, phase_rad: 6.3 * unit() }
    });
    let terms = terms.collect();
    let sphere = Sphere {
        duration_s: 1.5,
        ramp_s: 0.5,
        amplitude_rad: 0.1 + 0.2 * unit(),
        frequency_hz: 0.4 + unit(),
        turns: 2.0 * unit(),
        still_point_m: [0.05 * unit(), 0.0, 0.25 * unit()],
    };
    let (mut over, mut under) = (home, home);
    for k in 0..3 {
        over.position_m[k] += 0.05 * (unit() - 0.5);
        over.rpy_rad[k] += 0.3 * (unit() - 0.5);
        under.rpy_rad[k] += 0.3 * (unit() - 0.5);
    }
    MotionProgram {
        start: home,
        segments: vec![
            Segment::Move { to, duration_s: 1.0 },
            Segment::Multisine { duration_s: 2.5, ramp_s: 0.7, terms },
            Segment::Sphere(sphere),
            Segment::Path { via: vec![over, home], to: under, duration_s: 1.3 },
        ],
    }
}

/// Quantities of a machine with legs.
const OF_LEGS: usize = 13;
/// Jerk, push, pull and buckling, of whole segments or of intervals that suit the largest force.
const LOOSE: [usize; 4] = [3, 5, 6, 7];

/// Returns the largest values at `rate` Hz, by [`Geometry::margins`]: in the order of the guarantee.
fn sampled(g: &Geometry, trajectory: &Trajectory, load: &Load, rate: f64) -> [f64; OF_LEGS] {
    let mut most = [0.0_f64; OF_LEGS];
    let [lo, hi] = g.leg_length_m;
    for k in 0..=(trajectory.duration_s() * rate) as usize {
        let state = trajectory.state(k as f64 / rate);
        let m = g.margins(&state, Some(load));
        let forces = m.leg_force_n.unwrap().map(|[a, b]| b.max(-a));
        let [push, pull] = [[0.0, 1.0], [-1.0, 0.0]]
            .map(|by| m.leg_force_n.unwrap().map(|[a, b]| (by[0] * a).max(by[1] * b).max(0.0)));
        // Third differences of the lengths.
        let h = 1e-3;
        let lengths = [-1.5, -0.5, 0.5, 1.5]
            .map(|by| g.leg_lengths(&trajectory.state(k as f64 / rate + by * h).pose()));
        let seams = trajectory.seams_s();
        let inside = seams.iter().all(|seam| (seam - k as f64 / rate).abs() > 2.0 * h);
        let jerk = |i: usize| {
            let [a, b, c, d] = lengths.map(|l| l[i]);
            if inside { (d - 3.0 * c + 3.0 * b - a) / h.powi(3) } else { 0.0 }
        };
        let six = [
            m.leg_length_m.map(|l| l - 0.5 * (lo + hi)),
            m.leg_rate_mps,
            m.leg_acceleration_mps2,
            std::array::from_fn(jerk),
            forces,
            push,
            pull,
            std::array::from_fn(|i| push[i] * m.leg_length_m[i].powi(2)),
            m.base_joint_rad.unwrap(),
            m.plate_joint_rad.unwrap(),
        ];
        for (most, values) in most.iter_mut().zip(six) {
            *most = values.iter().fold(*most, |m, v| m.max(v.abs()));
        }
        most[10] = most[10].max(m.condition_number);
        let lacking = 0.05 - (m.nearest.unwrap().distance_m - 0.002);
        most[11] = most[11].max(lacking);
        most[12] = most[12].max(state.angular_rate.norm());
    }
    most
}

/// Against the motion examined every 0.5 ms, the bound is never below, and but for the loose ones at most 2 %
/// above.
#[test]
fn bounds_hold_at_every_instant_and_are_not_far_above() {
    let g = machine();
    let ball =
        Load::new(Bodies::Within { known: Vec::new(), body: BodySet::bounded(20.0, [0.0, 0.0, 0.15], 0.2) });
    for (seed, load) in [
        (1, Load::body(BodyParameters::thesis_horizontal())),
        (2, Load::body(BodyParameters::thesis_vertical())),
        (3, ball),
        (4, Load::body(BodyParameters::thesis_vertical())),
    ] {
        let trajectory = program(&g, seed).trajectory().unwrap();
        let guarantee = g.guarantee(&trajectory, Some(&load), 1.2);
        let most = sampled(&g, &trajectory, &load, 2000.0);
        assert_eq!(guarantee.peaks.len(), OF_LEGS);
        for (k, (peak, most)) in guarantee.peaks.iter().zip(most).enumerate() {
            assert!(peak.bound >= most && peak.seen <= peak.bound, "{seed}: {peak:?} {most}");
            if !LOOSE.contains(&k) {
                assert!(peak.bound <= 1.02 * most, "{seed}: {peak:?} {most}");
            }
        }
    }
}

/// At 100 kHz around the largest leg rate.
#[test]
fn nothing_hides_between_samples() {
    let g = machine();
    let trajectory = program(&g, 5).trajectory().unwrap();
    let guarantee = g.guarantee(&trajectory, None, 1.2);
    for peak in guarantee.peaks.iter().filter(|p| p.limit == Some(Limit::LegRate)) {
        let most = (-5000..5000)
            .flat_map(|k| g.leg_rates(&trajectory.state(peak.time_s + f64::from(k) * 1e-5)))
            .fold(0.0_f64, |m, v| m.max(v.abs()));
        assert!(peak.bound >= most && peak.bound < 1.011 * most, "{peak:?} {most}");
    }
}

#[test]
fn an_overstepped_limit_is_named_with_leg_and_time() {
    let mut g = machine();
    g.leg_rate_mps = 0.01;
    let trajectory = program(&g, 1).trajectory().unwrap();
    let guarantee = g.guarantee(&trajectory, None, 9.0);
    let (violation, _) = guarantee.violation(&g).unwrap();
    assert_eq!(violation.limit, Limit::LegRate);
    assert!(violation.leg.is_some() && !guarantee.is_kept());
    assert_eq!(guarantee.tightest().unwrap().limit, Some(Limit::LegRate));
}

/// Limits a little above the bounds are shown to be met, any a little below what was seen is not.
#[test]
fn proofs_agree_with_the_bounds() {
    let mut g = machine();
    let load =
        Load::new(Bodies::Within { known: Vec::new(), body: BodySet::bounded(20.0, [0.0, 0.0, 0.15], 0.2) });
    let trajectory = program(&g, 7).trajectory().unwrap();
    let bounds = g.guarantee(&trajectory, Some(&load), 9.0);
    let peak = |limit: Option<Limit>| *bounds.peaks.iter().find(|p| p.limit == limit).unwrap();
    let (rate, force, turning) = (peak(Some(Limit::LegRate)), peak(Some(Limit::LegForce)), peak(None));
    g.leg_rate_mps = 1.001 * rate.bound;
    g.limits.leg_force_n = Some(1.001 * force.bound);
    let proven = |g: &Geometry, turning: f64| g.proves(&trajectory, Some(&load), turning, 100_000);
    assert!(proven(&g, 1.001 * turning.bound));
    assert!(!proven(&g, 0.999 * turning.seen));
    assert!(!g.proves(&trajectory, Some(&load), 1.001 * turning.bound, 3));
    let slower = Geometry { leg_rate_mps: 0.999 * rate.seen, ..g.clone() };
    assert!(!proven(&slower, 9.0));
    g.limits.leg_force_n = Some(0.999 * force.seen);
    assert!(!proven(&g, 9.0));
}

fn of_travel(together: bool) -> Geometry {
    Geometry::of_travel(Travel {
        shift_m: [0.1, 0.08, 0.05],
        turn_rad: [0.5, 0.4, 0.7],
        together,
        speed_mps: Some(0.3),
        rate_radps: Some(2.0),
    })
}

#[test]
fn shares_of_a_travel_add_up_unless_all_of_it_may_be_used_at_once() {
    let pose = Pose { position_m: [0.05, 0.0, -0.01], rpy_rad: [-0.1, 0.2, 0.07] };
    let [apart, together] = [false, true].map(|together| of_travel(together).travel.unwrap());
    assert!((apart.share(&pose.coordinates()) - (0.5 + 0.2 + 0.2 + 0.5 + 0.1)).abs() < 1e-12);
    assert!((together.share(&pose.coordinates()) - 0.5).abs() < 1e-12);
    of_travel(true).check_pose(&pose).unwrap();
    let error = of_travel(false).check_pose(&pose).unwrap_err();
    assert_eq!((error.limit, error.leg), (Limit::Travel, None));
    assert!(error.to_string().contains("150.0 % of its travel"), "{error}");
    assert_eq!(of_travel(false).home(), Pose::default());
    for together in [false, true] {
        let nowhere = Pose { position_m: [f64::NAN, 0.0, 0.0], ..pose };
        of_travel(together).check_pose(&nowhere).unwrap_err();
    }
}

/// Bounds of a travel, examined every 0.5 ms: none is below the true value, and none more than 2 % above.
#[test]
fn bounds_of_a_travel_hold_at_every_instant_and_are_not_far_above() {
    for (seed, together) in [(1, false), (2, true), (3, false), (4, true)] {
        let g = of_travel(together);
        let trajectory = program(&g, seed).trajectory().unwrap();
        let guarantee = g.guarantee(&trajectory, None, 1.2);
        let limits: Vec<_> = guarantee.peaks.iter().map(|p| p.limit).collect();
        assert_eq!(limits, [Some(Limit::Travel), Some(Limit::PlateSpeed), Some(Limit::PlateRate), None]);
        let mut most = [0.0_f64; 4];
        for k in 0..=(trajectory.duration_s() * 2000.0) as usize {
            let state = trajectory.state(k as f64 / 2000.0);
            let share = |(k, range): (usize, f64)| state.pose().coordinates()[k].abs() / range;
            let shares = [0.1, 0.08, 0.05, 0.5, 0.4, 0.7].into_iter().enumerate().map(share);
            let share = if together { shares.fold(0.0, f64::max) } else { shares.sum() };
            let rate = state.angular_rate.norm();
            for (most, value) in most.iter_mut().zip([share, state.velocity.norm(), rate, rate]) {
                *most = most.max(value);
            }
        }
        for (peak, most) in guarantee.peaks.iter().zip(most) {
            assert!(peak.bound >= most && peak.bound <= 1.02 * most, "{seed}: {peak:?} {most}");
        }
    }
}

/// Each limit a little below what was seen refuses the motion by its name, and a little above its bound lets
/// it pass.
#[test]
fn each_limit_of_a_travel_is_checked_at_every_instant() {
    let g = of_travel(false);
    let trajectory = program(&g, 2).trajectory().unwrap();
    let peaks = g.guarantee(&trajectory, None, 9.0).peaks;
    let scaled = |by: [f64; 3]| {
        let mut g = g.clone();
        let reaching = g.travel.as_ref().unwrap().reaching(by[0]);
        g.travel = Some(Travel { speed_mps: Some(by[1]), rate_radps: Some(by[2]), ..reaching });
        g
    };
    let above = [0, 1, 2].map(|k: usize| 1.001 * peaks[k].bound);
    assert!(
        scaled(above).check(&trajectory).is_ok() && scaled(above).proves(&trajectory, None, 9.0, 100_000)
    );
    for (k, limit) in [Limit::Travel, Limit::PlateSpeed, Limit::PlateRate].into_iter().enumerate() {
        let mut below = above;
        below[k] = 0.999 * peaks[k].seen;
        let g = scaled(below);
        let error = g.check(&trajectory).unwrap_err();
        assert!(matches!(error, MotionError::Limit { violation, .. } if violation.limit == limit), "{error}");
        assert!(!g.proves(&trajectory, None, 9.0, 100_000));
        let (violation, _) = g.guarantee(&trajectory, None, 9.0).violation(&g).unwrap();
        assert_eq!(violation.limit, limit);
    }
}
