//! The suspended platform against an independent multibody engine: `../vectors/suspension.py` says which, and
//! makes `../vectors/suspension.json` anew.

use hexapod::{BodyParameters, FrameMotion, Mounting};
use nalgebra::Vector3;
use rigident_sim::suspension::{Instant, Joint, JointedLink, Run, Spring, Start, Suspended, Suspension};
use serde::Deserialize;

#[derive(Deserialize)]
struct Recorded {
    gravity_mps2: f64,
    platform: BodyParameters,
    base: BodyParameters,
    mount: Placed,
    links: Vec<Link>,
    springs: Vec<SpringFigures>,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Placed {
    position_m: [f64; 3],
    rotation_wxyz: [f64; 4],
}

#[derive(Deserialize)]
struct Link {
    parent: usize,
    joint_m: [f64; 3],
    axis: Option<[f64; 3]>,
    damping_nmspr: f64,
    body: BodyParameters,
}

#[derive(Deserialize)]
struct SpringFigures {
    at_m: [f64; 3],
    axis: [f64; 3],
    axial_npm: f64,
    lateral_npm: f64,
    axial_nspm: f64,
    lateral_nspm: f64,
    cubic_npm3: f64,
    factor: f64,
}

#[derive(Deserialize)]
struct Case {
    z_locked: bool,
    rest_wxyz: Vec<[f64; 4]>,
    preload_n: Vec<f64>,
    states: Vec<State>,
    path: Vec<State>,
}

#[derive(Deserialize)]
struct State {
    #[serde(default)]
    time_s: f64,
    joint_wxyz: Vec<[f64; 4]>,
    joint_rate_radps: Vec<[f64; 3]>,
    frames: Vec<Frame>,
    springs: [f64; 6],
    damping: [f64; 6],
}

#[derive(Deserialize)]
struct Frame {
    position_m: [f64; 3],
    rotation_wxyz: [f64; 4],
    velocity_mps: [f64; 3],
    rate_radps: [f64; 3],
    acceleration_mps2: [f64; 3],
    angular_acceleration_radps2: [f64; 3],
}

/// Ours and theirs of one kind.
type Pair = dyn Fn(&FrameMotion, &Frame) -> (Vector3<f64>, Vector3<f64>);

impl Recorded {
    fn rig(&self, case: &Case) -> Suspended {
        let spring = |s: &SpringFigures| Spring {
            axis: s.axis,
            axial_nspm: s.axial_nspm,
            lateral_nspm: s.lateral_nspm,
            cubic_npm3: s.cubic_npm3,
            factor: s.factor,
            ..Spring::upright(s.at_m, s.axial_npm, s.lateral_npm)
        };
        let link = |l: &Link| JointedLink {
            parent: l.parent,
            joint_m: l.joint_m,
            joint: l.axis.map_or(Joint::Spherical, |axis| Joint::Revolute { axis }),
            locked: false,
            damping_nmspr: l.damping_nmspr,
            body: l.body,
        };
        let mount = Mounting { position_m: self.mount.position_m, rotation_wxyz: self.mount.rotation_wxyz };
        let springs = self.springs.iter().map(spring).collect();
        Suspension {
            locked: [false, false, case.z_locked, false, false, false],
            links: self.links.iter().map(link).collect(),
            gravity_mps2: self.gravity_mps2,
            ..Suspension::of_body(self.platform, springs, mount, self.base)
        }
        .at_rest(&case.rest_wxyz)
        .expect("a rig")
    }
}

impl State {
    fn start(&self, z_locked: bool) -> Start {
        let platform = &self.frames[0];
        let [x, y, z] = platform.velocity_mps;
        // A locked velocity is zero but for rounding.
        assert!(!z_locked || z.abs() < 1e-12);
        Start {
            position_m: platform.position_m,
            rotation_wxyz: platform.rotation_wxyz,
            velocity_mps: [x, y, if z_locked { 0.0 } else { z }],
            rate_radps: platform.rate_radps,
            joint_rate_radps: self.joint_rate_radps.clone(),
            ..Start::resting(&self.joint_wxyz)
        }
    }

    /// Returns the largest gaps of places, attitudes, rates, accelerations and wrenches, relative to the
    /// largest of their kind.
    fn gaps(&self, now: &Instant) -> [f64; 7] {
        let ours: Vec<&FrameMotion> = [&now.platform].into_iter().chain(&now.links).collect();
        let gap = |kind: &Pair| {
            let pairs: Vec<_> = ours.iter().zip(&self.frames).map(|(a, b)| kind(a, b)).collect();
            let largest = pairs.iter().map(|(_, b)| b.amax()).fold(0.0, f64::max);
            pairs.iter().map(|(a, b)| (a - b).amax()).fold(0.0, f64::max) / largest
        };
        let wrench = |a: &[f64; 6], b: &[f64; 6]| {
            let largest = b.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest
        };
        let turned = |a: &FrameMotion, b: &Frame| {
            let theirs = Mounting { position_m: [0.0; 3], rotation_wxyz: b.rotation_wxyz };
            let probe = Vector3::new(0.3, -0.5, 0.8);
            (a.rotation * probe, theirs.rotation().expect("a rotation") * probe)
        };
        [
            gap(&|a, b| (a.position, b.position_m.into())),
            gap(&turned),
            gap(&|a, b| (a.velocity, b.velocity_mps.into())),
            gap(&|a, b| (a.angular_rate, b.rate_radps.into())),
            gap(&|a, b| (a.acceleration, b.acceleration_mps2.into())),
            gap(&|a, b| (a.angular_acceleration, b.angular_acceleration_radps2.into())),
            wrench(&now.springs, &self.springs).max(wrench(&now.damping, &self.damping)),
        ]
    }
}

#[test]
fn the_suspension_moves_as_a_multibody_engine_says() {
    let recorded: Recorded =
        serde_json::from_str(include_str!("../vectors/suspension.json")).expect("recorded vectors");
    assert_eq!(recorded.cases.iter().map(|c| c.z_locked).collect::<Vec<_>>(), [false, true]);
    let (mut still, mut moved) = ([0.0_f64; 7], [0.0_f64; 7]);
    for case in &recorded.cases {
        let rig = recorded.rig(case);
        for (ours, theirs) in rig.preload_n().iter().zip(&case.preload_n) {
            assert!((ours / theirs - 1.0).abs() < 1e-11, "{ours} {theirs}");
        }
        for state in &case.states {
            let now = rig.at(&state.start(case.z_locked)).expect("an instant");
            still.iter_mut().zip(state.gaps(&now)).for_each(|(worst, gap)| *worst = worst.max(gap));
        }
        let run = Run { duration_s: 0.25, rate_hz: 200.0, step_s: None };
        let motion = rig.simulate(&case.states[0].start(case.z_locked), &run).expect("a motion");
        for state in &case.path {
            let now = &motion.instants[(state.time_s * run.rate_hz).round() as usize];
            moved.iter_mut().zip(state.gaps(now)).for_each(|(worst, gap)| *worst = worst.max(gap));
        }
    }
    println!("places, attitudes, velocities, rates, accelerations, angular accelerations, wrenches");
    println!("single states: {still:?}\nafter up to 0.25 s: {moved:?}");
    // Closed forms in double precision; the path has what the engine's steps leave, h⁴, besides.
    assert!(still.iter().all(|gap| *gap < 1e-12), "{still:?}");
    assert!(moved.iter().all(|gap| *gap < 1e-9), "{moved:?}");
}
