//! Energy, momentum and rest.

use nalgebra::{Matrix3, Vector3};

use super::super::*;
use super::{GRAVITY, chain, drift, moving, rests};

const SECOND: Run = Run { duration_s: 1.0, rate_hz: 120.0, step_s: None };

#[test]
fn energy_does_not_drift_in_the_paper_s_experiment() {
    let tilt = paper::RELEASE_RAD * std::f64::consts::FRAC_1_SQRT_2;
    for joint in [paper::JOINT_M, paper::JOINT_ELSEWHERE_M] {
        for locked_z in [false, true] {
            let mut made_of = paper::suspension(joint);
            made_of.locked[2] = locked_z;
            let rig = made_of.at_rest(&[paper::hanging_wxyz()]).unwrap();
            let run = Run { duration_s: 10.0, ..SECOND };
            let (slope, exchanged) = drift(&rig.simulate(&paper::released([tilt, tilt, 0.0]), &run).unwrap());
            println!("drift {:e} /s of {exchanged} J", slope / exchanged);
            assert!((slope / exchanged).abs() < 1e-12, "{slope} J/s of {exchanged} J");
        }
    }
}

#[test]
fn energy_does_not_drift_in_a_tree_on_hard_springs_on_a_support() {
    let mut made_of = chain();
    made_of.support =
        Some(Support { mass_kg: 200.0, stiffness_npm: [2e6, 1e6, 5e6], damping_nspm: [0.0; 3] });
    for spring in &mut made_of.springs {
        (spring.axial_nspm, spring.lateral_nspm, spring.cubic_npm3) = (0.0, 0.0, 1e5);
    }
    for link in &mut made_of.links {
        link.damping_nmspr = 0.0;
    }
    let rig = made_of.at_rest(&rests()).unwrap();
    let (slope, exchanged) = drift(&rig.simulate(&moving(), &SECOND).unwrap());
    assert!((slope / exchanged).abs() < 1e-9, "{slope} J/s of {exchanged} J");
}

#[test]
fn springs_locks_and_gravity_are_the_rate_of_change_of_momentum() {
    // Linear, and angular about A's origin, by sixth-order differences of the motion.
    for locked in
        [[false; 6], [false, false, true, false, false, false], [true, false, true, true, true, false]]
    {
        let mut made_of = chain();
        made_of.locked = locked;
        let rig = made_of.at_rest(&rests()).unwrap();
        let mut start = moving();
        for k in 0..3 {
            start.velocity_mps[k] *= if locked[k] { 0.0 } else { 1.0 };
            start.rate_radps[k] *= if locked[3 + k] { 0.0 } else { 1.0 };
        }
        let rate_hz = 1000.0;
        let motion = rig.simulate(&start, &Run { duration_s: 0.3, rate_hz, step_s: None }).unwrap();
        let momenta: Vec<_> = motion.instants.iter().map(|i| momentum(&rig, i)).collect();
        for n in (3..motion.instants.len() - 3).step_by(40) {
            let slope = [(1, 0.75), (2, -0.15), (3, 1.0 / 60.0)]
                .map(|(k, w)| (momenta[n + k] - momenta[n - k]) * (w * rate_hz))
                .iter()
                .sum::<nalgebra::Vector6<f64>>();
            let outer = outer(&rig, &motion.instants[n]);
            assert!((slope - outer).amax() < 1e-7 * outer.amax(), "{slope} {outer}");
        }
    }
}

/// Returns momentum, and moment of momentum about A's origin, of all bodies.
fn momentum(rig: &Suspended, now: &Instant) -> nalgebra::Vector6<f64> {
    let mut sum = nalgebra::Vector6::zeros();
    for (body, motion) in rig.bodies().zip([&now.platform].into_iter().chain(&now.links)) {
        let com = motion.fixed_frame(&Vector3::from(body.com_m), &Matrix3::identity());
        let p = body.mass_kg * com.velocity;
        let inertia = motion.rotation * body.inertia_com() * motion.rotation.transpose();
        let l = com.position.cross(&p) + inertia * motion.angular_rate;
        sum += nalgebra::Vector6::from_iterator(p.iter().chain(l.iter()).copied());
    }
    sum
}

/// Returns force, and moment about A's origin, of springs, locks and gravity.
fn outer(rig: &Suspended, now: &Instant) -> nalgebra::Vector6<f64> {
    let on_p = |w: &[f64; 6]| {
        let force = Vector3::new(w[0], w[1], w[2]);
        [force, Vector3::new(w[3], w[4], w[5]) + now.platform.position.cross(&force)]
    };
    let mut sum = [Vector3::zeros(); 2];
    for wrench in [&now.springs, &now.damping, &now.reaction] {
        let [f, m] = on_p(wrench);
        sum[0] += f;
        sum[1] += m;
    }
    for (body, motion) in rig.bodies().zip([&now.platform].into_iter().chain(&now.links)) {
        let weight = body.mass_kg * GRAVITY;
        sum[0] += weight;
        sum[1] += (motion.position + motion.rotation * Vector3::from(body.com_m)).cross(&weight);
    }
    nalgebra::Vector6::from_iterator(sum[0].iter().chain(sum[1].iter()).copied())
}

#[test]
fn rates_and_accelerations_are_the_derivatives_of_places_and_attitudes() {
    let rig = chain().at_rest(&rests()).unwrap();
    let rate_hz = 2000.0;
    let motion = rig.simulate(&moving(), &Run { duration_s: 0.02, rate_hz, step_s: None }).unwrap();
    let frames: Vec<Vec<_>> = motion
        .instants
        .iter()
        .map(|i| [&i.platform].into_iter().chain(&i.links).copied().collect())
        .collect();
    for (k, now) in frames[20].iter().enumerate() {
        let slope = |f: &dyn Fn(&hexapod::FrameMotion) -> Vector3<f64>| -> Vector3<f64> {
            [(1, 0.75), (2, -0.15), (3, 1.0 / 60.0)]
                .map(|(n, w)| (f(&frames[20 + n][k]) - f(&frames[20 - n][k])) * (w * rate_hz))
                .iter()
                .sum()
        };
        assert!((slope(&|f| f.position) - now.velocity).amax() < 1e-8);
        assert!((slope(&|f| f.velocity) - now.acceleration).amax() < 1e-7);
        assert!((slope(&|f| f.angular_rate) - now.angular_acceleration).amax() < 1e-6);
        for axis in 0..3 {
            let column = |f: &hexapod::FrameMotion| -> Vector3<f64> { f.rotation.column(axis).into() };
            assert!((slope(&column) - now.angular_rate.cross(&column(now))).amax() < 1e-8);
        }
    }
}

#[test]
fn in_its_posture_the_tree_rests_and_preloads_carry_the_weight() {
    let mut made_of = chain();
    for link in &mut made_of.links {
        link.locked = true;
    }
    let rig = made_of.at_rest(&rests()).unwrap();
    let now = rig.at(&Start::resting(&rests())).unwrap();
    let weight: f64 = rig.bodies().map(|b| b.mass_kg).sum::<f64>() * 9.80665;
    assert!((rig.preload_n().iter().sum::<f64>() - weight).abs() < 1e-10);
    assert!(now.platform.acceleration.norm() < 1e-12 && now.platform.angular_acceleration.norm() < 1e-11);
    // A spring that gave way: another rest, and that one is a rest too.
    let mut preload = rig.preload_n().to_vec();
    preload[0] -= 40.0;
    let settled = rig.with_preload_n(&preload).unwrap();
    let start = settled.resting(&rests()).unwrap();
    assert!(start.position_m[2] < -1e-4, "{start:?}");
    let now = settled.at(&start).unwrap();
    assert!(now.platform.acceleration.norm() < 1e-10 && now.platform.angular_acceleration.norm() < 1e-9);
}

#[test]
fn a_damped_chain_loses_the_power_of_its_damping() {
    let rig = chain().at_rest(&rests()).unwrap();
    let motion = rig.simulate(&moving(), &Run { duration_s: 0.3, rate_hz: 2000.0, step_s: None }).unwrap();
    let power = |i: &Instant| {
        let (p, w) = (&i.platform, &i.damping);
        let springs = Vector3::new(w[0], w[1], w[2]).dot(&p.velocity)
            + Vector3::new(w[3], w[4], w[5]).dot(&p.angular_rate);
        let joints: f64 = rig
            .suspension()
            .links
            .iter()
            .zip(&i.links[1..])
            .map(|(l, m)| l.damping_nmspr * (m.angular_rate - i.links[l.parent].angular_rate).norm_squared())
            .sum();
        springs - joints
    };
    // Simpson's rule over pairs of intervals.
    let lost: f64 = motion
        .instants
        .windows(3)
        .step_by(2)
        .map(|w| (power(&w[0]) + 4.0 * power(&w[1]) + power(&w[2])) / 6000.0)
        .sum();
    let ends = [0, motion.instants.len() - 1].map(|n| motion.instants[n].energy.total_j());
    assert!(lost < -0.01 && (ends[1] - ends[0] - lost).abs() < 1e-7 * lost.abs(), "{lost} {ends:?}");
}
