//! The simulator's readings at three odd rates with known skews.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use hexapod::experiment::thesis_program;
use hexapod::{MotionProgram, Pose, Segment};
use nalgebra::{Matrix3, Rotation3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigident::answer::result::{Measured, ParameterState};
use rigident::fit::{FitOptions, Silent};
use rigident::problem::clocks::StreamSet;
use rigident::problem::{Problem, ProblemOptions};
use rigident::rig::RigFile;
use rigident_sim::rig::{Readings, RigConfig};
use rigident_sim::sensors::SensorModels;

use crate::fitting::states;

/// Rates of wrench, accelerometer and attitude, 1/s.
const RATES_HZ: [f64; 3] = [698.0, 254.2, 99.1];
/// The delay of the stamps of accelerometer and attitude, s.
const LATE_S: [f64; 2] = [0.0065, -0.0031];
const SEEDS: u64 = 10;
const SLOW: u64 = 10;

const RIG: &str = r#"
[recording]
gravity_mps2 = 9.80665
[[stream]]
file = "wrench.csv"
[[stream]]
file = "accelerometer.csv"
[[stream]]
file = "attitude.csv"
rotation_matrix = { frame = "S in A", columns = ["a","b","c","d","e","f","g","h","i"] }
[[imu]]
position_m = POSITION
rotation_wxyz = ROTATION
"#;

pub struct Simulated {
    config: RigConfig,
    program: MotionProgram,
    wrench: Readings,
    imu: Readings,
}

impl Simulated {
    fn new(config: RigConfig, program: MotionProgram) -> Self {
        let readings = |rate_hz| Readings::new(&config, &program, rate_hz).unwrap();
        Self { wrench: readings(RATES_HZ[0]), imu: readings(RATES_HZ[1]), config, program }
    }

    fn set(&self, seed: u64, attitude_noise_rad: f64) -> StreamSet {
        let (rig, files) = self.files(seed, attitude_noise_rad);
        StreamSet::from_bytes("simulated", &RigFile::parse(&rig).unwrap(), &files).unwrap()
    }

    /// The rig file and the three files of an experiment; attitudes with this noise, rad.
    pub fn files(&self, seed: u64, attitude_noise_rad: f64) -> (String, [Vec<u8>; 3]) {
        let text = |header: &str, rows: &mut dyn Iterator<Item = (f64, Vec<f64>)>| {
            let mut text = format!("t_s,{header}\n");
            for (t, values) in rows {
                let _ = write!(text, "{:.7}", t + 100.0);
                for v in values {
                    let _ = write!(text, ",{v:?}");
                }
                text.push('\n');
            }
            text.into_bytes()
        };
        let seconds = |ns: u64| ns as f64 * 1e-9;
        let mut wrench = self.wrench.measured(seed).map(|r| (seconds(r.time_ns), r.wrench.to_vec()));
        let mut imu =
            self.imu.measured(seed).map(|r| (seconds(r.time_ns) + LATE_S[0], r.specific_force.to_vec()));
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
        let trajectory = self.program.trajectory().unwrap();
        let on_plate: Matrix3<f64> = self.config.load_cell.rotation().unwrap();
        let count = (trajectory.duration_s() * RATES_HZ[2]) as usize;
        let mut attitude = (0..count).map(|k| {
            let t = k as f64 / RATES_HZ[2];
            let noise = Vector3::from_fn(|_, _| {
                let n: f64 = StandardNormal.sample(&mut rng);
                attitude_noise_rad * n
            });
            let r = trajectory.state(t).rotation * on_plate * Rotation3::new(noise).into_inner();
            (t + LATE_S[1], r.transpose().as_slice().to_vec())
        });
        let files = [
            text("fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm", &mut wrench),
            text("imu_ax_mps2,imu_ay_mps2,imu_az_mps2", &mut imu),
            text("a,b,c,d,e,f,g,h,i", &mut attitude),
        ];
        let rig = RIG
            .replace("POSITION", &format!("{:?}", self.config.imu.position_m))
            .replace("ROTATION", &format!("{:?}", unit(self.config.imu.rotation_wxyz)));
        (rig, files)
    }
}

/// The thesis' experiment in a new folder, the rig file called `run.rig.toml`.
pub fn write_thesis(folder: &Path, seed: u64) {
    let (rig, files) = thesis().files(seed, 5e-5);
    fs::create_dir(folder).unwrap();
    fs::write(folder.join("run.rig.toml"), rig).unwrap();
    for (name, bytes) in ["wrench.csv", "accelerometer.csv", "attitude.csv"].iter().zip(files) {
        fs::write(folder.join(name), bytes).unwrap();
    }
}

fn unit(q: [f64; 4]) -> [f64; 4] {
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.map(|v| v / norm)
}

/// Skews and parameters of an experiment.
struct Outcome {
    skews: Vec<Option<Measured>>,
    parameters: Vec<Option<Measured>>,
}

fn outcome(set: &StreamSet) -> Outcome {
    let problem = Problem::from_streams(set.clone(), None, &ProblemOptions::default()).unwrap();
    let found = problem.fit(&FitOptions::default(), &Silent).unwrap();
    let skews = problem.time_base().unwrap().streams.iter().skip(1);
    Outcome {
        skews: skews.map(|s| s.skew_s.and_then(|skew: ParameterState| skew.measured())).collect(),
        parameters: states(&found).iter().map(ParameterState::measured).collect(),
    }
}

pub fn thesis() -> &'static Simulated {
    static ONCE: OnceLock<Simulated> = OnceLock::new();
    ONCE.get_or_init(|| {
        let config = RigConfig::thesis_horizontal();
        let program = thesis_program(&config.geometry, 20.0);
        Simulated::new(config, program)
    })
}

#[test]
fn skews_are_recovered_within_their_uncertainty_and_so_is_the_body() {
    let simulated = thesis();
    let truth = simulated.wrench.truth(1).body.parameters();
    let half = |seeds: std::ops::Range<u64>| -> Vec<Outcome> {
        seeds.map(|seed| outcome(&simulated.set(seed, 5e-5))).collect()
    };
    let outcomes: Vec<Outcome> = std::thread::scope(|scope| {
        let other = scope.spawn(|| half(1..1 + SEEDS / 2));
        let mine = half(1 + SEEDS / 2..1 + SEEDS);
        other.join().unwrap().into_iter().chain(mine).collect()
    });
    let within = |m: &Option<Measured>, truth: f64| m.is_some_and(|m| (m.value - truth).abs() <= m.u95);
    for (k, late) in LATE_S.iter().enumerate() {
        let held = outcomes.iter().filter(|o| within(&o.skews[k], *late)).count();
        let all: Vec<_> = outcomes.iter().map(|o| o.skews[k].map(|m| (m.value * 1e3, m.u95 * 1e3))).collect();
        assert!(held >= 9, "skew {k}: {held} of {SEEDS}: {all:?}");
    }
    let mut held = 0;
    for (j, truth) in truth.iter().enumerate() {
        let mine = outcomes.iter().filter(|o| within(&o.parameters[j], *truth)).count();
        held += mine;
    }
    // 95 of 100 are expected; of 100 independent intervals fewer than 88 have a chance of 1 in 700.
    assert!(held >= 88, "{held}");
}

/// A turn of one second and a half between two rests: nothing of it shows in the wrench but gravity.
pub fn slow_turn() -> &'static Simulated {
    static ONCE: OnceLock<Simulated> = OnceLock::new();
    ONCE.get_or_init(|| {
        let config = RigConfig::thesis_horizontal();
        let home = config.geometry.home();
        let tilted = Pose { rpy_rad: [0.45, 0.0, 0.0], ..home };
        let back = Pose { rpy_rad: [-0.45, 0.0, 0.0], ..home };
        let segments = vec![
            Segment::Hold { duration_s: 1.0 },
            Segment::Move { to: tilted, duration_s: 1.5 },
            Segment::Hold { duration_s: 1.0 },
            Segment::Move { to: back, duration_s: 2.5 },
            Segment::Hold { duration_s: 1.0 },
        ];
        Simulated::new(config, MotionProgram { start: home, segments })
    })
}

#[test]
fn attitudes_of_a_slow_turn_are_set_by_the_gravity_that_the_accelerometer_feels() {
    let simulated = slow_turn();
    let skews: Vec<_> = (1..=SLOW).map(|seed| outcome(&simulated.set(seed, 5e-5)).skews).collect();
    for (k, late) in LATE_S.iter().enumerate() {
        let found: Vec<Measured> = skews.iter().filter_map(|s| s[k]).collect();
        let held = found.iter().filter(|m| (m.value - late).abs() <= m.u95).count();
        assert!(found.len() >= 8 && held * 10 >= found.len() * 9, "{skews:?}");
    }
}

/// Without noise what is left is the kernel's: 9e-5 of the fastest motion, and the skews to some
/// microseconds.
#[test]
fn perfect_sensors_give_skews_and_body() {
    let config = RigConfig::thesis_horizontal().with_sensors(SensorModels::ideal());
    let program = thesis_program(&config.geometry, 20.0);
    let simulated = Simulated::new(config, program);
    let truth = simulated.wrench.truth(1).body.parameters();
    let found = outcome(&simulated.set(1, 0.0));
    for (skew, late) in found.skews.iter().zip(LATE_S) {
        assert!((skew.unwrap().value - late).abs() < 2e-5, "{skew:?}");
    }
    for (j, (p, truth)) in found.parameters.iter().zip(truth).enumerate() {
        let scale = if j == 0 {
            20.0
        } else if j < 4 {
            1.06
        } else {
            0.44
        };
        assert!((p.unwrap().value - truth).abs() < 5e-4 * scale, "{j}: {p:?} {truth}");
    }
}
