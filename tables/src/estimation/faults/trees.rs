//! An arm of six axes with friction and encoder noise, of bodies that differ from the nominal ones.

use rigident::diagnosis::Case;
use rigident::fit::{Kind, Owner, parallel};
use rigident::laboratory::trees::truth;
use rigident::model::Model;
use rigident::model::dynamics::inverse_dynamics;
use rigident::problem::{Problem, ProblemOptions};
use rigident::recording::Recording;
use rigident::rig::RigFile;
use rigident::rows::tree::drive::Term;
use rigident_shared::tree::BaseMotion;

use super::super::problem::Normal;
use super::{Planted, Verdict, table_of, verdict};

/// Arms of each fault.
const SEEDS: u64 = 1;
/// Honest recordings.
const HONEST: u64 = 100;
const DESCRIPTION: &str = "../../shared/data/urdf/ur5_robot.urdf";
const GRAVITY: f64 = 9.80665;
const FREQUENCIES_HZ: [f64; 5] = [0.1, 0.23, 0.37, 0.51, 0.7];
const RATE_HZ: f64 = 200.0;
const DURATION_S: f64 = 20.0;
/// Noise of positions, rates and efforts.
const NOISE: [f64; 3] = [2e-5, 1e-3, 0.3];
const JOINTS: [&str; 6] = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
];

/// The nominal arm, every seed's own motion and friction, and what the sensors of an arm of somewhat other
/// bodies read.
struct Arm {
    nominal: Model,
    actual: Model,
    viscous: Vec<f64>,
    coulomb: Vec<f64>,
    /// Amplitude, rad, frequency, Hz, and phase of the swings of each joint, about an angle.
    swings: Vec<(f64, Vec<[f64; 3]>)>,
}

impl Arm {
    fn new(seed: u64) -> Self {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(DESCRIPTION);
        let nominal = rigident::model::urdf::read(&path).expect("the arm's description");
        let mut normal = Normal::new(3_000_000 + seed);
        let mut actual = nominal.clone();
        for inertial in actual.links.iter_mut().filter_map(|link| link.nominal.as_mut()) {
            // Of one body with another density and size: it stays a body that can be.
            let (density, size) = (1.0 + 0.1 * normal.draw(), 1.0 + 0.05 * normal.draw());
            for (k, value) in inertial.iter_mut().enumerate() {
                *value *= density
                    * size.powi(if k == 0 {
                        0
                    } else if k < 4 {
                        1
                    } else {
                        2
                    });
            }
        }
        let mut around = |mean: f64, spread: f64| mean + spread * normal.draw();
        let swings = (0..JOINTS.len()).map(|joint| {
            let middle = if joint == 1 { -0.8 } else { 0.0 } + around(0.0, 0.3);
            let each =
                FREQUENCIES_HZ.map(|f| [0.5 / (1.0 + 3.0 * f) * around(1.0, 0.2), f, around(0.0, 3.0)]);
            (middle, each.to_vec())
        });
        let swings = swings.collect();
        let viscous = JOINTS.iter().map(|_| around(1.75, 0.4)).collect();
        let coulomb = JOINTS.iter().map(|_| around(2.2, 0.5)).collect();
        Self { nominal, actual, viscous, coulomb, swings }
    }

    /// Records the arm on a base that is turned by this much about x, rad.
    fn record(&self, seed: u64, tilt: f64) -> Case {
        let mut normal = Normal::new(4_000_000 + seed);
        let mut columns: Vec<Vec<String>> = vec![Vec::new(); 3 * JOINTS.len()];
        let mut recording =
            Recording { name: "arm".to_owned(), rate_hz: Some(RATE_HZ), ..Recording::default() };
        for row in 0..(DURATION_S * RATE_HZ) as usize {
            let t = row as f64 / RATE_HZ;
            let swing = |derivative: i32| -> Vec<f64> {
                let of = |(middle, swings): &(f64, Vec<[f64; 3]>)| {
                    let each = swings.iter().map(|[a, f, phase]| {
                        let w = std::f64::consts::TAU * f;
                        let quarter = std::f64::consts::FRAC_PI_2 * f64::from(derivative);
                        a * w.powi(derivative) * (w * t + phase + quarter).sin()
                    });
                    each.sum::<f64>() + if derivative == 0 { *middle } else { 0.0 }
                };
                self.swings.iter().map(of).collect()
            };
            let (q, v, a) = (swing(0), swing(1), swing(2));
            let base = BaseMotion::still([0.0, GRAVITY * tilt.sin(), -GRAVITY * tilt.cos()]);
            let torques = inverse_dynamics(&self.actual, &base, &q, &v, &a).expect("hinges").split_off(6);
            for k in 0..JOINTS.len() {
                let friction = self.viscous[k] * v[k] + self.coulomb[k] * v[k].signum();
                let numbers = [q[k], v[k], torques[k] + friction];
                for (quantity, (value, sigma)) in numbers.into_iter().zip(NOISE).enumerate() {
                    columns[quantity * JOINTS.len() + k].push(format!("{:e}", value + sigma * normal.draw()));
                }
            }
            recording.time_ns.push((t * 1e9).round() as u64);
        }
        let names =
            ["rad", "radps", "nm"].into_iter().flat_map(|unit| JOINTS.map(|joint| format!("{joint}_{unit}")));
        recording.extra = names.zip(columns).collect();
        recording.rig = RigFile::default();
        let options = ProblemOptions {
            friction: vec![Term::Viscous, Term::Coulomb(None)].into(),
            ..ProblemOptions::default()
        };
        Case { recording, model: Some(self.nominal.clone()), options }
    }

    /// Returns the true parameters of a problem in the order of its columns.
    fn truth(&self, problem: &Problem) -> Vec<Option<f64>> {
        let source = problem.tree().expect("a tree");
        let mut base = truth(&self.actual.welded(), source.base()).into_iter();
        let drive = |owner: &Owner, of: &[f64]| match owner {
            Owner::Drive(name) => JOINTS.iter().position(|joint| joint == name).map(|k| of[k]),
            _ => None,
        };
        let of = |p: &rigident::fit::Parameter| match p.kind {
            Kind::Viscous => drive(&p.owner, &self.viscous),
            Kind::Coulomb => drive(&p.owner, &self.coulomb),
            _ => base.next(),
        };
        problem.source().parameters().iter().map(of).collect()
    }
}

/// Changes the numbers of columns that end so, by row and joint.
fn each(case: &mut Case, ending: &str, change: impl Fn(usize, usize, f64) -> f64) {
    for (joint, name) in JOINTS.iter().enumerate() {
        let column = case.recording.extra.iter_mut().find(|(own, _)| *own == format!("{name}_{ending}"));
        let (_, cells) = column.expect("a column");
        for (row, cell) in cells.iter_mut().enumerate() {
            *cell = format!("{:e}", change(row, joint, cell.parse().expect("a number")));
        }
    }
}

fn scale(case: &mut Case, endings: &[&str], joint: Option<usize>, by: f64) {
    for ending in endings {
        each(case, ending, |_, k, v| if joint.is_none_or(|joint| joint == k) { by * v } else { v });
    }
}

/// Gives each joint the columns of another one.
fn reorder(case: &mut Case, endings: &[&str], order: [usize; 6]) {
    for ending in endings {
        let column = |k: usize| format!("{}_{ending}", JOINTS[k]);
        let was: Vec<Vec<String>> = (0..6)
            .map(|k| case.recording.extra.iter().find(|(n, _)| *n == column(k)).expect("a column").1.clone())
            .collect();
        for (k, from) in order.into_iter().enumerate() {
            let to = case.recording.extra.iter_mut().find(|(n, _)| *n == column(k)).expect("a column");
            to.1.clone_from(&was[from]);
        }
    }
}

fn late(case: &mut Case, endings: &[&str], rows: usize) {
    for (_, cells) in case.recording.extra.iter_mut().filter(|(n, _)| endings.iter().any(|e| n.ends_with(e)))
    {
        let was = cells.clone();
        cells.iter_mut().enumerate().for_each(|(k, to)| to.clone_from(&was[k.saturating_sub(rows)]));
    }
}

fn zero(case: &mut Case, joint: usize, degrees: f64) {
    each(case, "rad", |_, k, v| if k == joint { v + degrees.to_radians() } else { v });
}

const MOTION: [&str; 2] = ["rad", "radps"];
const ALL: [&str; 3] = ["rad", "radps", "nm"];
const DEGREES: f64 = 180.0 / std::f64::consts::PI;

#[rustfmt::skip]
const FAULTS: [Planted; 38] = [
    Planted { name: "angles and rates in degrees", named: "positions and rates of the joints are in \
        degrees", plant: |c| scale(c, &MOTION, None, DEGREES) },
    Planted { name: "angles in degrees, rates in rad/s", named: "deg", plant: |c| scale(c, &["rad"], None, DEGREES) },
    Planted { name: "rates in deg/s", named: "deg", plant: |c| scale(c, &["radps"], None, DEGREES) },
    Planted { name: "rates in rpm", named: "0.1047 times", plant: |c| scale(c, &["radps"], None, 30.0 / std::f64::consts::PI) },
    Planted { name: "rates reversed", named: "has the opposite sign", plant: |c| scale(c, &["radps"], None, -1.0) },
    Planted { name: "joints 2 and 3 swapped", named: "shoulder_lift_joint and elbow_joint are swapped", plant: |c| reorder(c, &ALL, [0, 2, 1, 3, 4, 5]) },
    Planted { name: "joints 1 and 2 swapped", named: "shoulder_pan_joint and shoulder_lift_joint are \
        swapped", plant: |c| reorder(c, &ALL, [1, 0, 2, 3, 4, 5]) },
    Planted { name: "joints 5 and 6 swapped", named: "wrist_2_joint and wrist_3_joint are swapped", plant: |c| reorder(c, &ALL, [0, 1, 2, 3, 5, 4]) },
    Planted { name: "efforts of 2 and 3 swapped", named: "the efforts of shoulder_lift_joint and \
        elbow_joint", plant: |c| reorder(c, &["nm"], [0, 2, 1, 3, 4, 5]) },
    Planted { name: "efforts of 5 and 6 swapped", named: "the efforts of wrist_2_joint and wrist_3_joint", plant: |c| reorder(c, &["nm"], [0, 1, 2, 3, 5, 4]) },
    Planted { name: "all columns off by one joint", named: "all columns of each joint are those", plant: |c| reorder(c, &ALL, [5, 0, 1, 2, 3, 4]) },
    Planted { name: "efforts off by one joint", named: "the efforts of each joint are those", plant: |c| reorder(c, &["nm"], [1, 2, 3, 4, 5, 0]) },
    Planted { name: "joint 2 counts backwards", named: "position and rate of shoulder_lift_joint are \
        reversed", plant: |c| scale(c, &MOTION, Some(1), -1.0) },
    Planted { name: "joint 4 counts backwards", named: "position and rate of wrist_1_joint are reversed", plant: |c| scale(c, &MOTION, Some(3), -1.0) },
    Planted { name: "joint 6 counts backwards", named: "wrist_3_joint", plant: |c| scale(c, &MOTION, Some(5), -1.0) },
    Planted { name: "joint 2 turns the other way", named: "shoulder_lift_joint turns the other way", plant: |c| scale(c, &ALL, Some(1), -1.0) },
    Planted { name: "joint 3 turns the other way", named: "elbow_joint turns the other way", plant: |c| scale(c, &ALL, Some(2), -1.0) },
    Planted { name: "effort of joint 3 reversed", named: "the effort of elbow_joint is reversed", plant: |c| scale(c, &["nm"], Some(2), -1.0) },
    Planted { name: "effort of joint 6 reversed", named: "wrist_3_joint", plant: |c| scale(c, &["nm"], Some(5), -1.0) },
    Planted { name: "all efforts reversed", named: "all efforts are reversed", plant: |c| scale(c, &["nm"], None, -1.0) },
    Planted { name: "zero of joint 2 off by 90°", named: "the zero of shoulder_lift_joint is off by 90°", plant: |c| zero(c, 1, 90.0) },
    Planted { name: "zero of joint 3 off by 90°", named: "the zero of elbow_joint is off by 90°", plant: |c| zero(c, 2, 90.0) },
    Planted { name: "zero of joint 4 off by −90°", named: "the zero of wrist_1_joint is off by -90°", plant: |c| zero(c, 3, -90.0) },
    Planted { name: "zero of joint 3 off by 180°", named: "the zero of elbow_joint is off by 180°", plant: |c| zero(c, 2, 180.0) },
    Planted { name: "zero of joint 2 off by 5°", named: "joint_zero_shoulder_lift_joint", plant: |c| zero(c, 1, 5.0) },
    Planted { name: "efforts 20 ms late", named: "late by 20 ms", plant: |c| late(c, &["nm"], 4) },
    Planted { name: "efforts 50 ms late", named: "late by 50 ms", plant: |c| late(c, &["nm"], 10) },
    Planted { name: "positions and rates 20 ms late", named: "early by 20 ms", plant: |c| late(c, &MOTION, 4) },
    Planted { name: "efforts in N mm", named: "the efforts are in N mm", plant: |c| scale(c, &["nm"], None, 1e3) },
    Planted { name: "efforts in N cm", named: "the efforts are in N cm", plant: |c| scale(c, &["nm"], None, 1e2) },
    Planted { name: "efforts in kgf m", named: "the efforts are in kgf m", plant: |c| scale(c, &["nm"], None, 1.0 / 9.80665) },
    Planted { name: "effort of joint 3 in N cm", named: "the effort of elbow_joint is in N cm", plant: |c| scale(c, &["nm"], Some(2), 1e2) },
    Planted { name: "effort of joint 2 30 % too large", named: "gain_shoulder_lift_joint", plant: |c| scale(c, &["nm"], Some(1), 1.3) },
    Planted { name: "effort of joint 4 zero throughout", named: "wrist_1_joint_nm", plant: |c| scale(c, &["nm"], Some(3), 0.0) },
    Planted { name: "position of joint 4 constant", named: "wrist_1_joint_rad", plant: |c| scale(c, &["rad"], Some(3), 0.0) },
    Planted { name: "rate spike of joint 3", named: "elbow_joint_radps", plant: |c| each(c, "radps", |row, k, v| if row == 1234 && k == 2 { v + 50.0 } else { v }) },
    Planted { name: "effort spike of joint 3", named: "elbow_joint", plant: |c| each(c, "nm", |row, k, v| if row == 1234 && k == 2 { v + 2000.0 } else { v }) },
    Planted { name: "friction left out", named: "friction of the joints is left out", plant: |c| c.options.friction = Vec::new().into() },
];
/// Tilts of the table that the arm is on, degrees, and what must be said.
const TILTS: [(&str, &str, f64); 4] = [
    ("table tilted by 5°", "base_tilt", 5.0),
    ("base on a wall", "the base stands on a wall, y down", 90.0),
    ("base on a wall, the other way", "the base stands on a wall, y up", -90.0),
    ("base on the ceiling", "the base stands upside down", 180.0),
];

/// Returns the table of faults.
pub fn table() -> String {
    let tilts = TILTS.map(|(name, named, _)| Planted { name, named, plant: |_| {} });
    let all: Vec<Planted> = FAULTS.into_iter().chain(tilts).collect();
    table_of(&all, SEEDS, |fault, seed| {
        let arm = Arm::new(seed);
        let tilt =
            TILTS.iter().find(|(name, ..)| *name == fault.name).map_or(0.0, |(_, _, degrees)| *degrees);
        let mut case = arm.record(seed, tilt.to_radians());
        (fault.plant)(&mut case);
        verdict(&mut case, &|problem| arm.truth(problem))
    })
}

/// Returns honest recordings by kinds.
pub fn honest() -> Vec<(String, Vec<Verdict>)> {
    let all = parallel::map(parallel::threads(), HONEST as usize, |k| {
        let arm = Arm::new(1000 + k as u64);
        verdict(&mut arm.record(1000 + k as u64, 0.0), &|problem| arm.truth(problem))
    });
    vec![("an arm of six axes with friction".to_owned(), all)]
}
