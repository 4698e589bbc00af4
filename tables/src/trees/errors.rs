//! Errors of sensors, joints and mounting of trees that do not average out, as they are in what the sensors
//! read; through the program as a user would run it with a rig file.

use std::collections::BTreeMap;

use nalgebra::{DVector, Matrix3, Rotation3, UnitQuaternion, Vector3};
use rigident::answer::{Answer, Context, Status};
use rigident::fit::{Fit, FitOptions, Nuisance, Silent, parallel};
use rigident::laboratory::trees::{
    TreeInstant, TreeNoise, seven_axes, truth, two_links, with_noise_and_offset,
};
use rigident::model::Model;
use rigident::model::dynamics::inverse_dynamics;
use rigident::problem::{Problem, ProblemOptions};
use rigident::recording::{ImuColumns, Recording};
use rigident::rig::classes::rectangular;
use rigident::rig::{
    ImuClass, ImuTable, JointTable, LoadCellClass, LoadCellTable, OffsetTable, OffsetWord, RigFile,
    TreeClass, TreeTable,
};
use rigident::rows::body::CHANNELS;

use crate::estimation::Normal;

/// Runs of an error alone, of one that is large, and of all together.
const ALONE: u64 = 60;
const LARGE: u64 = 30;
const TOGETHER: u64 = 200;
const RATE_HZ: f64 = 100.0;
const DURATION_S: f64 = 20.0;
/// An error that is to be reported is this many of its standard deviations.
const FAR: f64 = 5.0;
const FULL_SCALE: [f64; 6] = [200.0, 200.0, 200.0, 20.0, 20.0, 20.0];
const LEVER_ARM: [f64; 3] = [0.04, -0.03, 0.02];
/// Noise of wrench and torques.
const QUIET: TreeNoise = TreeNoise {
    wrench: [0.05, 0.05, 0.05, 0.002, 0.002, 0.002],
    torque: 0.05,
    accel: 0.0,
    gyro: 0.0,
    attitude: 0.0,
    position: 0.0,
    rate: 0.0,
};
/// The noise with that of the signals.
const NOISY: TreeNoise = TreeNoise { accel: 0.01, gyro: 5e-4, attitude: 1e-4, rate: 1e-4, ..QUIET };
const AXES: [&str; 3] = ["x", "y", "z"];

/// Errors by the names that nuisance parameters have.
type Errors = BTreeMap<String, f64>;

/// A tree on its rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rig {
    TwoLinks,
    SevenAxes,
}

fn attitude(turn: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(0.2 + turn, -0.4, 1.1 - turn)
}

/// Groups of errors with what switches one of them on in a rig file in which everything else is exact.
type Group = (&'static str, fn(&mut RigFile));

impl Rig {
    fn name(self) -> &'static str {
        match self {
            Self::TwoLinks => "two links",
            Self::SevenAxes => "seven axes",
        }
    }

    fn model(self) -> Model {
        match self {
            Self::TwoLinks => two_links(),
            Self::SevenAxes => seven_axes(),
        }
    }

    fn groups(self) -> Vec<Group> {
        const IMU: rigident::rig::classes::ImuLimits = rigident::rig::classes::ImuLimits {
            position_m: 3e-3,
            rotation_rad: 8.727e-3,
            skew_s: 2e-3,
            accel_bias_mps2: 0.05,
            accel_gain: 5e-3,
            accel_misalignment_rad: 5e-3,
            gyro_bias_radps: 0.01,
            gyro_gain: 5e-3,
            gyro_rotation_rad: 5e-3,
        };
        fn imus(rig: &mut RigFile, set: impl Fn(&mut ImuTable)) {
            rig.imu.iter_mut().for_each(set);
        }
        match self {
            Self::TwoLinks => vec![
                ("lever arm", |r| imus(r, |i| i.position_std_m = Some(rectangular(IMU.position_m)))),
                ("IMU rotation", |r| imus(r, |i| i.rotation_std_rad = Some(rectangular(IMU.rotation_rad)))),
                ("time skew", |r| imus(r, |i| i.skew_std_s = Some(rectangular(IMU.skew_s)))),
                ("gyro bias", |r| {
                    imus(r, |i| i.gyro_bias_std_radps = Some(rectangular(IMU.gyro_bias_radps)));
                }),
                ("gyro scale", |r| imus(r, |i| i.gyro_gain_std = Some(rectangular(IMU.gyro_gain)))),
                ("gyro rotation", |r| {
                    imus(r, |i| i.gyro_rotation_std_rad = Some(rectangular(IMU.gyro_rotation_rad)));
                }),
                ("accelerometer bias", |r| {
                    imus(r, |i| i.accel_bias_std_mps2 = Some(rectangular(IMU.accel_bias_mps2)));
                }),
                ("accelerometer scale", |r| {
                    imus(r, |i| i.accel_gain_std = Some(rectangular(IMU.accel_gain)))
                }),
                ("accelerometer misalignment", |r| {
                    imus(r, |i| {
                        i.accel_misalignment_std_rad = Some(rectangular(IMU.accel_misalignment_rad));
                    });
                }),
                ("load-cell gain", |r| r.load_cell.gain_uncertainty = Some([rectangular(2e-3); 6])),
                ("cross-talk", |r| r.load_cell.crosstalk_std = Some(rectangular(2e-3))),
                ("load-cell drift", |r| {
                    r.load_cell.drift_std_n_nm = Some(FULL_SCALE.map(|f| rectangular(2e-3 * f)));
                }),
            ],
            Self::SevenAxes => {
                vec![
                    ("joint zero", |r| {
                        let limits = TreeClass::DEFAULT.limits();
                        r.tree.joint_zero_std_rad = Some(rectangular(limits.joint_zero_rad));
                    }),
                    ("base tilt", |r| {
                        let limits = TreeClass::DEFAULT.limits();
                        r.tree.base_tilt_std_rad = Some(rectangular(limits.base_tilt_rad));
                    }),
                    ("time skew", |r| {
                        r.tree.skew_std_s = Some(rectangular(TreeClass::DEFAULT.limits().skew_s));
                    }),
                    ("effort gain", |r| {
                        r.tree.effort_gain_std = Some(rectangular(TreeClass::DEFAULT.limits().effort));
                    }),
                    ("effort offset, effort drift", |r| {
                        r.tree.effort_drift_std = Some(rectangular(TreeClass::DEFAULT.limits().effort));
                    }),
                ]
            }
        }
    }

    /// Returns the rig file of somebody who knows these groups, and that nothing else errs.
    fn rig_file(self, groups: &[Group], noise: &TreeNoise) -> RigFile {
        let stated = |sigma: f64| Some(sigma).filter(|sigma| *sigma > 0.0);
        let links = if self == Self::TwoLinks { 2 } else { 0 };
        let imu = |link: usize| ImuTable {
            link,
            class: Some(ImuClass::Exact),
            position_m: if link == 0 { LEVER_ARM } else { [0.0; 3] },
            rotation_wxyz: {
                let q = attitude(link as f64);
                [q.w, q.i, q.j, q.k]
            },
            accel_noise_mps2: stated(noise.accel),
            gyro_noise_radps: stated(noise.gyro),
            attitude_noise_rad: stated(noise.attitude),
            ..ImuTable::default()
        };
        let joint = |k: usize| JointTable {
            name: format!("l{k}_joint"),
            position: None,
            rate: None,
            effort: None,
            position_noise: None,
            rate_noise: stated(noise.rate),
            effort_noise: Some(noise.torque),
            zero_std: None,
            effort_gain_std: None,
            effort_lowpass_hz: None,
        };
        let mut rig = RigFile {
            imu: (0..links).map(imu).collect(),
            joint: if links == 0 { (1..=7).map(joint).collect() } else { Vec::new() },
            load_cell: LoadCellTable {
                class: Some(LoadCellClass::Exact),
                noise_n_nm: Some(noise.wrench),
                range_n_nm: Some(FULL_SCALE),
                offset_n_nm: OffsetTable::Word(OffsetWord::Estimate),
                ..LoadCellTable::default()
            },
            tree: TreeTable { class: Some(TreeClass::Exact), ..TreeTable::default() },
            ..RigFile::default()
        };
        groups.iter().for_each(|(_, set)| set(&mut rig));
        rig
    }

    /// Returns what the sensors read of a rig with these errors.
    fn record(
        self,
        model: &Model,
        (file, noise): (&RigFile, &TreeNoise),
        errors: &Errors,
        seed: u64,
    ) -> Recording {
        let exact = match self {
            Self::TwoLinks => two_links_with(model, errors),
            Self::SevenAxes => seven_axes_with(model, errors),
        };
        let (mut recording, _) = with_noise_and_offset(&exact, noise, [0.0; 6], seed);
        recording.rig = file.clone();
        recording
    }
}

fn of(errors: &Errors, name: &str) -> f64 {
    errors.get(name).copied().unwrap_or(0.0)
}

fn three(errors: &Errors, stem: &str) -> Vector3<f64> {
    Vector3::from_fn(|k, _| of(errors, &format!("{stem}_{}", AXES[k])))
}

fn times() -> impl Iterator<Item = f64> {
    (0..(DURATION_S * RATE_HZ) as usize).map(|k| k as f64 / RATE_HZ)
}

/// Returns a line and a curve over the recording.
fn drift(errors: &Errors, channel: &str, t: f64) -> f64 {
    let at = 2.0 * t / DURATION_S - 1.0;
    of(errors, &format!("drift_line_{channel}")) * at
        + of(errors, &format!("drift_curve_{channel}")) * 0.5 * (3.0 * at * at - 1.0)
}

fn two_links_with(model: &Model, errors: &Errors) -> Recording {
    let mut recording = Recording { name: "two".to_owned(), rate_hz: Some(RATE_HZ), ..Recording::default() };
    let mounted = |link: f64, turn: Vector3<f64>| {
        Rotation3::new(turn).into_inner() * attitude(link).to_rotation_matrix().into_inner()
    };
    let turns = [three(errors, "imu_rotation"), three(errors, "imu_rotation_arm")];
    let mountings = [mounted(0.0, turns[0]), mounted(1.0, turns[1])];
    let place = Vector3::from(LEVER_ARM) + three(errors, "lever_arm");
    let [yx, zx, zy] = [0, 1, 2].map(|k| three(errors, "accelerometer_misalignment")[k]);
    let scale = Matrix3::from_diagonal(&(three(errors, "accelerometer_scale").add_scalar(1.0)));
    let misaligned = Matrix3::new(0.0, 0.0, 0.0, yx, 0.0, 0.0, zx, zy, 0.0);
    let gyro = |link: usize, rate: &Vector3<f64>| -> [f64; 3] {
        let end = ["", "_arm"][link];
        let turned = Rotation3::new(three(errors, &format!("gyro_rotation{end}"))).into_inner();
        let read = turned.tr_mul(&mountings[link].tr_mul(rate));
        let scale = three(errors, &format!("gyro_scale{end}"));
        (read + read.component_mul(&scale) + three(errors, &format!("gyro_bias{end}"))).into()
    };
    let (mut accel, mut gyros, mut wrench, mut turned) =
        (Vec::new(), [Vec::new(), Vec::new()], Vec::new(), Vec::new());
    for t in times() {
        let loads = TreeInstant::new(model, true, t).wrench(model).expect("a ball");
        wrench.push(std::array::from_fn(|to| {
            let leaked: f64 = (0..6)
                .filter(|from| *from != to)
                .map(|from| {
                    of(errors, &format!("crosstalk_{}_{}", CHANNELS[to], CHANNELS[from])) * loads[from]
                })
                .sum();
            let gain = of(errors, &format!("gain_{}", CHANNELS[to]));
            loads[to] * (1.0 + gain) + leaked + drift(errors, CHANNELS[to], t)
        }));
        // Late stamps: what is read now was earlier.
        let seen = TreeInstant::new(model, true, t - of(errors, "time_skew"));
        let (w, dw) = (seen.base.rate, seen.base.angular_acceleration);
        let felt = seen.base.specific_force + dw.cross(&place) + w.cross(&w.cross(&place));
        let read = mountings[0].tr_mul(&felt);
        accel.push((scale * read + misaligned * read + three(errors, "accelerometer_bias")).into());
        gyros[0].push(gyro(0, &w));
        gyros[1].push(gyro(1, &seen.links[1].1));
        // Attitudes are those of the IMUs, brought to the links by the mountings that are believed.
        let between = Rotation3::new(turns[0]).into_inner().transpose()
            * seen.links[1].0
            * Rotation3::new(turns[1]).into_inner();
        let q = UnitQuaternion::from_matrix(&between);
        turned.push([q.w, q.i, q.j, q.k]);
        recording.time_ns.push((t * 1e9).round() as u64);
    }
    let [base, arm] = gyros;
    recording.imus = vec![
        ImuColumns { accel: Some(accel), gyro: Some(base) },
        ImuColumns { accel: None, gyro: Some(arm) },
    ];
    recording.attitudes = vec![(1, turned)];
    recording.wrench = Some(wrench);
    recording
}

fn seven_axes_with(model: &Model, errors: &Errors) -> Recording {
    let mut recording =
        Recording { name: "seven".to_owned(), rate_hz: Some(RATE_HZ), ..Recording::default() };
    let joints: Vec<String> = model.links.iter().skip(1).map(|link| link.joint_name.clone()).collect();
    let tilt = Vector3::new(of(errors, "base_tilt_x"), of(errors, "base_tilt_y"), 0.0);
    let mut columns: Vec<Vec<String>> = vec![Vec::new(); 3 * joints.len()];
    for t in times() {
        let now = TreeInstant::new(model, false, t);
        let mut base = now.base;
        base.specific_force = Rotation3::new(tilt) * base.specific_force;
        let all = inverse_dynamics(model, &base, &now.positions, &now.rates, &now.accelerations);
        let torques = all.expect("hinges").split_off(6);
        let seen = TreeInstant::new(model, false, t - of(errors, "time_skew"));
        for (k, name) in joints.iter().enumerate() {
            let own = |stem: &str| of(errors, &format!("{stem}_{name}"));
            let torque = torques[k] * (1.0 + own("gain")) + own("effort_offset") + drift(errors, name, t);
            columns[k].push(format!("{:e}", seen.positions[k] + own("joint_zero")));
            columns[joints.len() + k].push(format!("{:e}", seen.rates[k]));
            columns[2 * joints.len() + k].push(format!("{torque:e}"));
        }
        recording.time_ns.push((t * 1e9).round() as u64);
    }
    let names = ["rad", "radps", "nm"].into_iter().flat_map(|unit| joints.iter().map(move |n| (n, unit)));
    recording.extra = names.zip(columns).map(|((n, unit), cells)| (format!("{n}_{unit}"), cells)).collect();
    recording
}

/// The result of one run.
struct Run {
    inside: Vec<bool>,
    status: Status,
    /// The group of the nuisance parameter that is the furthest from what is stated.
    furthest: String,
    values: Errors,
}

/// Returns the nuisance parameters that a rig file makes.
fn nuisances(rig: Rig, model: &Model, file: &RigFile) -> Vec<Nuisance> {
    let recording = rig.record(model, (file, &QUIET), &Errors::new(), 0);
    let problem = Problem::from_recording(&recording, Some(model), &ProblemOptions::default());
    problem.expect("frames").source().nuisances()
}

fn run(rig: Rig, model: &Model, file: (&RigFile, &TreeNoise), errors: &Errors, seed: u64) -> Run {
    let recording = rig.record(model, file, errors, seed);
    let problem =
        Problem::from_recording(&recording, Some(model), &ProblemOptions::default()).expect("frames");
    let fit: Fit =
        problem.fit(&FitOptions { convergence_points: 0, ..FitOptions::default() }, &Silent).expect("a fit");
    let context = Context { rate_sigma: problem.source().rate_sigma(), ..Context::default() };
    let answer = Answer::new(&fit, context).expect("an answer");
    let wanted = DVector::from_vec(truth(model, problem.tree().expect("a tree").base()));
    let inside = wanted
        .iter()
        .enumerate()
        .map(|(j, wanted)| fit.estimate.measured(j).is_some_and(|m| (m.value - wanted).abs() <= m.u95));
    let most = fit.nuisances.iter().max_by(|a, b| a.pull().abs().total_cmp(&b.pull().abs()));
    Run {
        inside: inside.collect(),
        status: answer.status,
        furthest: most.map(|k| k.nuisance.group.clone()).unwrap_or_default(),
        values: fit.nuisances.iter().map(|k| (k.nuisance.name.clone(), k.value)).collect(),
    }
}

fn runs(what: &str, count: u64, job: impl Fn(u64) -> Run + Sync) -> Vec<Run> {
    let begun = std::time::Instant::now();
    let done = parallel::map(parallel::threads(), count as usize, |k| job(k as u64));
    eprintln!("  {what}: {count} runs, {:.1} s, {}", begun.elapsed().as_secs_f64(), coverage(&done));
    done
}

/// Writes least, mean and largest coverage over the parameters.
fn coverage(runs: &[Run]) -> String {
    let count = runs.first().map_or(0, |run| run.inside.len());
    let of = |j: usize| 100.0 * share(runs, |run| run.inside.get(j) == Some(&true));
    let all: Vec<f64> = (0..count).map(of).collect();
    let mean = all.iter().sum::<f64>() / all.len().max(1) as f64;
    let (least, most) = all.iter().fold((f64::INFINITY, 0.0_f64), |(l, m), v| (l.min(*v), m.max(*v)));
    format!("{mean:.1} % | {least:.0}–{most:.0} %")
}

fn share(runs: &[Run], holds: impl Fn(&Run) -> bool) -> f64 {
    runs.iter().filter(|run| holds(run)).count() as f64 / runs.len().max(1) as f64
}

fn draw(known: &[Nuisance], wide: f64, seed: u64) -> Errors {
    let mut normal = Normal::new(1_000_000 + seed);
    known.iter().map(|k| (k.name.clone(), wide * k.sigma * normal.draw())).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Returns the table.
pub fn table() -> String {
    let mut text = "| tree | error | coverage, mean | least–largest | not identified at 5 σ | named first | \
                    found, median |\n\
                    |---|---|---|---|---|---|---|\n"
        .to_owned();
    for rig in [Rig::TwoLinks, Rig::SevenAxes] {
        let (model, groups) = (rig.model(), rig.groups());
        let everything = rig.rig_file(&groups, &QUIET);
        let noisy = rig.rig_file(&groups, &NOISY);
        let all = nuisances(rig, &model, &everything);
        for group in &groups {
            let file = rig.rig_file(std::slice::from_ref(group), &QUIET);
            let known = nuisances(rig, &model, &file);
            let what = format!("{}, {}", rig.name(), group.0);
            let alone =
                runs(&what, ALONE, |seed| run(rig, &model, (&file, &QUIET), &draw(&known, 1.0, seed), seed));
            let one = |seed: u64| {
                let own = &known[seed as usize % known.len()];
                let sign = if (seed / known.len() as u64).is_multiple_of(2) { FAR } else { -FAR };
                (own.name.clone(), sign * own.sigma)
            };
            let far = runs(&format!("{what}, 5 σ"), LARGE, |seed| {
                run(rig, &model, (&everything, &QUIET), &Errors::from([one(seed)]), seed)
            });
            let found = far.iter().enumerate().map(|(seed, run)| {
                let (name, size) = one(seed as u64);
                of(&run.values, &name) / size
            });
            text += &format!(
                "| {} | {} | {} | {:.0} % | {:.0} % | {:.0} % |\n",
                rig.name(),
                group.0,
                coverage(&alone),
                100.0 * share(&far, |run| run.status != Status::Identified),
                100.0
                    * share(&far, |run| group.0.contains(&run.furthest) && run.status == Status::Implausible),
                100.0 * median(found.collect()),
            );
        }
        for (what, wide, count, file, noise) in [
            ("all at once", 1.0, TOGETHER, &everything, &QUIET),
            ("all at once, with noise of the signals", 1.0, ALONE, &noisy, &NOISY),
            ("all, twice as large as stated", 2.0, ALONE, &everything, &QUIET),
        ] {
            let together = runs(&format!("{}, {what}", rig.name()), count, |seed| {
                run(rig, &model, (file, noise), &draw(&all, wide, seed), seed)
            });
            text += &format!(
                "| {} | {what} | {} | {:.0} % |  |  |\n",
                rig.name(),
                coverage(&together),
                100.0 * share(&together, |run| run.status != Status::Identified)
            );
        }
    }
    text
}
