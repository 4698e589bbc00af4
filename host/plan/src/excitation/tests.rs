use std::sync::atomic::AtomicBool;

use super::boxes::{BodyBox, BoxFile, boxes};
use super::collisions::{Apart, Collisions};
use super::family::{Family, Motion, Series};
use super::files::{FileJoint, csv, joint_trajectory, joints};
use super::information::{Measured, Tree, volume};
use super::limits::{GivenLimits, Shares};
use super::predict::predict;
use super::problem::Problem;
use super::resampled::resampled;
use super::*;
use crate::descent::Descent;
use rigident_fit::{Fit, FitOptions, Silent};
use rigident_identify::problem::{Problem as Recorded, ProblemOptions};
use rigident_io::recording::Recording;
use rigident_laboratory::arm::ArmRun;
use rigident_laboratory::trees::{seven_axes, truth};
use rigident_model::base::Rows;
use rigident_model::dynamics::inverse_dynamics;
use rigident_model::{Model, urdf};
use rigident_rows::tree::drive::Friction;

fn friction(words: &str) -> Friction {
    Friction::parse(&[words]).unwrap()
}

/// Returns a task with noise of efforts as [`ArmRun`] has it.
fn task(model: &Model, given: &GivenLimits) -> Task {
    let model = movable(model).unwrap();
    let limits = given.of(&model, Shares::default()).unwrap();
    let rounded = boxes(&model, &Default::default(), &BoxFile::default(), None);
    Task {
        start: limits.iter().map(super::limits::JointLimits::start).collect(),
        is_start_given: false,
        duration_s: 8.0,
        bandwidth_hz: 0.75,
        measured: Measured {
            rows: Rows::Joint,
            effort_noise: (0..limits.len()).map(|k| 0.3 * 0.9_f64.powi(k as i32)).collect(),
            wrench_noise: [1.0, 1.0, 1.0, 0.1, 0.1, 0.1],
            rate_hz: 200.0,
            friction: Friction::default(),
        },
        boxes: rounded.all,
        skipped: Vec::new(),
        apart: Apart { clearance_m: 0.01, floor_m: None },
        seed: 1,
        restarts: 1,
        limits,
        model,
    }
}

fn seven() -> Task {
    let words = |text: &str| vec![text.to_owned()];
    task(
        &seven_axes(),
        &GivenLimits {
            range: words("-2,2"),
            speed: words("2.5"),
            effort: words("90"),
            ..GivenLimits::default()
        },
    )
}

fn planned(task: &Task) -> Excitation {
    plan(task, &AtomicBool::new(false), |_| ()).unwrap()
}

/// Calls a function with everything that the search checks, for a task.
fn with_problem<T>(task: &Task, job: impl FnOnce(&Problem) -> T) -> T {
    let tree = Tree::new(&task.model, &task.measured).unwrap();
    let mut moving = tree.moving();
    let at = Motion { positions: task.start.clone(), ..Motion::zeros(task.start.len()) };
    tree.efforts(&mut moving, &at).unwrap();
    let free = [moving.states().to_vec()];
    let collisions =
        Collisions::new(&task.model, tree.paths(), (task.boxes.clone(), &task.skipped), task.apart, &free);
    let rates = vec![2.0; task.start.len()];
    job(&Problem {
        tree: &tree,
        family: Family::new(&task.start, task.duration_s, 6, &rates),
        limits: &task.limits,
        collisions: &collisions,
        rate_hz: 200.0,
    })
}

/// Central differences of fourth order; both parts of the cost by themselves. Of seven axes with everything
/// that has a slope, and of a tree with two arms, one of which slides.
#[test]
fn the_gradient_is_that_of_finite_differences() {
    let mut all = seven();
    all.measured.rows = Rows::Both;
    all.measured.friction = friction("viscous,stribeck:0.5,load,offset,rotor");
    all.apart.floor_m = Some(-0.5);
    let mut branched = seven_axes();
    branched.links[4].link.parent = 2;
    branched.links[6].link.joint =
        rigident_shared::tree::Joint::Prismatic(nalgebra::Vector3::new(0.0, 0.6, 0.8));
    branched.links[6].passive[0].damping = 3.0;
    branched.links[3].passive[0].armature = 0.2;
    let words = |text: &str| vec![text.to_owned()];
    let given = GivenLimits {
        range: words("-1,1"),
        speed: words("2.5"),
        effort: words("200"),
        ..GivenLimits::default()
    };
    for task in [all, task(&branched, &given)] {
        with_problem(&task, |problem| {
            let z: Vec<f64> = problem.begin(3).unwrap().iter().map(|v| 0.9 * v).collect();
            for weight in [0.0, 10.0] {
                let (_, gradient, log) = problem.cost(&z, weight).unwrap();
                assert!(log.is_finite());
                let largest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
                for k in (0..z.len()).step_by(7) {
                    let at = |by: f64| {
                        let mut z = z.clone();
                        z[k] += by;
                        problem.cost(&z, weight).unwrap().0
                    };
                    let h = 3e-5;
                    let slope = (8.0 * (at(h) - at(-h)) - at(2.0 * h) + at(-2.0 * h)) / (12.0 * h);
                    // Forward differences are good to their steps, 1e-6; signs of rates may change in
                    // between.
                    assert!(
                        (slope - gradient[k]).abs() < 1e-4 * largest,
                        "{weight} {k}: {slope} {} of {largest}",
                        gradient[k]
                    );
                }
            }
        });
    }
}

/// Between two trajectories the volume changes as that of the pipeline's factor; its filter takes less than 5
/// % off a row up to twice the bandwidth.
#[test]
fn the_volume_is_that_of_the_factor() {
    let mut task = seven();
    task.measured.friction = friction("viscous");
    with_problem(&task, |problem| {
        let both = [1, 2].map(|seed| {
            let z = problem.begin(seed).unwrap();
            let factor = predict(problem.tree, &problem.family.series(&z), 200.0).unwrap();
            (problem.cost(&z, 0.0).unwrap().2, factor)
        });
        let [(a, first), (b, second)] = both;
        let count = first.parameters.len() as f64;
        let (own, factor) = (a - b, first.log_determinant - second.log_determinant);
        assert!(own.abs() > 1.0 && (own - factor).abs() < 0.1 * count.sqrt() * 2.0, "{own} {factor}");
    });
}

#[test]
fn blocks_of_parameters_are_the_branches_of_the_tree() {
    let information = [nalgebra::DMatrix::identity(2, 2) * 4.0, nalgebra::DMatrix::identity(1, 1) * 9.0];
    let (log, inverse) = volume(&information).unwrap();
    assert!((log - 144.0_f64.ln()).abs() < 1e-9);
    assert!((inverse[0][(1, 1)] - 0.25).abs() < 1e-9 && (inverse[1][(0, 0)] - 1.0 / 9.0).abs() < 1e-9);
}

#[test]
fn a_series_begins_and_ends_at_rest_and_is_the_sum_of_its_derivatives() {
    let family = Family::new(&[0.3, -0.2], 6.0, 5, &[1.0, 2.0]);
    let z: Vec<f64> = (0..family.len()).map(|k| (k as f64 * 1.7).sin()).collect();
    let series = family.series(&z);
    for t in [1e-9, 6.0 - 1e-9] {
        let motion = series.at(t);
        assert!((motion.positions[0] - 0.3).abs() < 1e-7 && (motion.positions[1] + 0.2).abs() < 1e-7);
        assert!(motion.rates.iter().chain(&motion.accelerations).all(|v| v.abs() < 1e-6));
    }
    for t in [0.7, 3.1, 5.2] {
        let (h, motion) = (1e-5, series.at(t));
        let (before, after) = (series.at(t - h), series.at(t + h));
        for j in 0..2 {
            assert!(((after.positions[j] - before.positions[j]) / (2.0 * h) - motion.rates[j]).abs() < 1e-6);
            assert!(((after.rates[j] - before.rates[j]) / (2.0 * h) - motion.accelerations[j]).abs() < 1e-5);
            assert!(motion.rates[j].abs() <= series.most(j, 1));
        }
    }
    for k in 0..family.instants() {
        let (grid, exact) = (family.motion(&z, k), series.at(k as f64 * family.step_s()));
        assert!((0..2).all(|j| (grid.accelerations[j] - exact.accelerations[j]).abs() < 1e-9));
    }
}

/// Reads the CSV of a plan as a recording.
fn read_again(text: &str) -> Recording {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plan.csv");
    std::fs::write(&path, text).unwrap();
    Recording::load(&path, None).unwrap()
}

/// Asserts every limit by another way: efforts by Newton and Euler, link by link, positions and rates as they
/// are in the CSV.
fn assert_kept(task: &Task, plan: &Excitation) {
    let names: Vec<String> = task.limits.iter().map(|limits| limits.name.clone()).collect();
    let text = csv(&plan.series, &joints(&task.model, &names, &[], &[]), 1000.0);
    let lines: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    let base = rigident_shared::tree::BaseMotion::still([0.0, 0.0, -9.80665]);
    for rows in lines.windows(3) {
        let (positions, rates): (Vec<f64>, Vec<f64>) =
            rows[1][1..].chunks(2).map(|own| (own[0], own[1])).unzip();
        let step = rows[2][0] - rows[0][0];
        let change = |j: usize| (rows[2][2 + 2 * j] - rows[0][2 + 2 * j]) / step;
        let changes: Vec<f64> = (0..names.len()).map(change).collect();
        let efforts = inverse_dynamics(&task.model, &base, &positions, &rates, &changes).unwrap();
        for (j, limits) in task.limits.iter().enumerate() {
            let [low, high] = limits.range;
            assert!(low < positions[j] && positions[j] < high, "{}", limits.name);
            assert!(rates[j].abs() <= limits.shares.speed * limits.speed + 1e-6, "{}", limits.name);
            let link = &task.model.links[j + 1];
            let own =
                efforts[6 + j] + link.passive[0].damping * rates[j] + link.passive[0].armature * changes[j];
            // Between the instants that were examined efforts are not bounded: a thousandth.
            assert!(
                own.abs() + limits.dry <= 1.001 * limits.shares.effort * limits.effort,
                "{}",
                limits.name
            );
        }
    }
    assert!(plan.used.is_kept);
}

/// Plans, runs and identifies. Returns shares of intervals that hold the truth, and the largest promise over
/// the outcome.
fn end_to_end(model: &Model, task: &Task, seeds: std::ops::Range<u64>) -> (f64, Vec<f64>, Excitation) {
    let plan = planned(task);
    assert_kept(task, &plan);
    let names: Vec<String> = task.limits.iter().map(|limits| limits.name.clone()).collect();
    let recorded = read_again(&csv(&plan.series, &joints(model, &names, &[], &[]), 200.0));
    let options = ProblemOptions { friction: task.measured.friction.clone(), ..ProblemOptions::default() };
    let (mut held, mut all, mut ratios) = (0.0, 0.0, Vec::new());
    for seed in seeds {
        let friction = if task.measured.friction.is_empty() { [0.0; 3] } else { [0.5, 0.4, 0.1] };
        let run = ArmRun { effort_noise: 0.3, friction, seed, ..ArmRun::default() };
        let recording = run.following(&task.model, &recorded).unwrap();
        let problem = Recorded::from_recording(&recording, Some(&task.model), &options).unwrap();
        let fit: Fit = problem.fit(&FitOptions::default(), &Silent).unwrap();
        let wanted = truth(&task.model, problem.tree().unwrap().base());
        for (j, promised) in plan.after.parameters.iter().enumerate() {
            assert_eq!(promised.name, fit.parameters[j].name);
            let (Some(promised), Some(found)) = (promised.u95, fit.estimate.measured(j)) else { continue };
            ratios.push(found.u95 / promised);
            let Some(wanted) = wanted.get(j) else { continue };
            all += 1.0;
            held += f64::from(u8::from((found.value - wanted).abs() <= found.u95));
        }
    }
    (held / all, ratios, plan)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn seven_axes_tell_as_promised_and_far_more_than_at_random() {
    let mut task = seven();
    task.measured.friction = friction("viscous,coulomb,offset");
    let (held, ratios, plan) = end_to_end(&seven_axes(), &task, 1..9);
    // 8 runs of 43 parameters: 95 % within three standard deviations, those of a run taken for half
    // dependent.
    assert!((0.91..=0.99).contains(&held), "{held}");
    assert!((0.93..1.07).contains(&mean(&ratios)), "{}", mean(&ratios));
    let gain = plan.after.over(&plan.before).unwrap();
    assert!(gain < 0.7, "{gain}");
    assert!(plan.after.open().len() <= plan.before.open().len());
}

#[test]
fn the_same_seed_gives_the_same_trajectory_and_stopping_the_best_so_far() {
    let task = Task { duration_s: 4.0, ..seven() };
    assert_eq!(planned(&task).series, planned(&task).series);
    let stopped = plan(&task, &AtomicBool::new(true), |_| ()).unwrap();
    assert!(stopped.used.is_kept);
}

/// Reads one point of a message: the text in the brackets is JSON, too.
fn list(line: &str, key: &str) -> Vec<f64> {
    serde_json::from_str(line.trim_start_matches(['-', ' ']).strip_prefix(key).unwrap()).unwrap()
}

#[test]
fn a_message_has_a_point_for_every_time_and_a_number_for_every_joint() {
    let series = Series { start: vec![0.1], duration_s: 2.0, terms: vec![vec![[0.2, 0.1], [-0.1, -0.025]]] };
    let mut model = seven_axes();
    model.links.truncate(3);
    let names = vec!["l2_joint".to_owned()];
    let joints = joints(&model, &names, &[("l1_joint".to_owned(), 0.7)], &["l1_joint".to_owned()]);
    let text = joint_trajectory(&series, &joints, 4.0);
    let lines: Vec<&str> = text.lines().collect();
    let head = ["header:", "  stamp: {sec: 0, nanosec: 0}", "  frame_id: \"\"", "joint_names:"];
    assert_eq!(lines[..4], head);
    assert_eq!(lines[4..7], ["- \"l1_joint\"", "- \"l2_joint\"", "points:"]);
    let points: Vec<&[&str]> = lines[7..].chunks(5).collect();
    assert_eq!(points.len(), 9);
    for (k, point) in points.iter().enumerate() {
        let motion = series.at(0.25 * k as f64);
        for (line, key, held, own) in [
            (point[0], "positions: ", 0.7, motion.positions[0]),
            (point[1], "velocities: ", 0.0, motion.rates[0]),
            (point[2], "accelerations: ", 0.0, motion.accelerations[0]),
        ] {
            let values = list(line, key);
            assert!((values[0] - held).abs() < 1e-9 && (values[1] - own).abs() < 1e-6, "{line}");
        }
        let nanoseconds = 250_000_000 * k;
        let time =
            format!("{{sec: {}, nanosec: {}}}", nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
        assert_eq!(point[4].trim(), format!("time_from_start: {time}"));
    }
    assert!(points.iter().all(|point| point[0].starts_with("- positions") && point[1].starts_with("  vel")));
    let table = csv(&series, &joints, 4.0);
    assert!(table.starts_with("t_s,l1_joint_rad,l1_joint_radps,l2_joint_rad,l2_joint_radps\n"));
    assert_eq!(table.lines().count(), 10);
}

#[test]
fn impossible_plans_are_reported() {
    let error = |task: &Task| plan(task, &AtomicBool::new(false), |_| ()).err().unwrap();
    let short = error(&Task { duration_s: 2.0, ..seven() });
    assert!(matches!(short, ExcitationError::TooShort { harmonics: 1, .. }), "{short}");
    let mut outside = seven();
    outside.start[2] = 1.95;
    assert!(matches!(error(&outside), ExcitationError::Start { ref name, .. } if name == "l3_joint"));
    let mut weak = seven();
    weak.start[1] = 1.2;
    weak.limits[1].effort = 5.0;
    assert!(matches!(error(&weak), ExcitationError::Weak { ref name, .. } if name == "l2_joint"));
    let mut low = seven();
    low.apart.floor_m = Some(0.9);
    let touches = error(&low);
    assert!(
        matches!(&touches, ExcitationError::Touches { between, .. } if between.between[1] == "floor"),
        "{touches}"
    );
    // A table where the arm starts; upright it stands free.
    let mut table = Task { is_start_given: true, ..seven() };
    table.start[1] = 1.5;
    table.boxes.push(BodyBox {
        body: 0,
        link: "table".to_owned(),
        rotation: nalgebra::Matrix3::identity(),
        centre: nalgebra::Vector3::new(0.7, 0.0, 0.4),
        half: nalgebra::Vector3::repeat(0.1),
    });
    let touches = plan(&table, &AtomicBool::new(false), |_| ()).err();
    let Some(ExcitationError::Touches { between, .. }) = &touches else { panic!("{touches:?}") };
    assert!(between.between.contains(&"table".to_owned()), "{touches:?}");
    assert!(matches!(error(&Task { bandwidth_hz: 50.0, ..seven() }), ExcitationError::Number(_)));
    assert!(matches!(error(&Task { restarts: 0, ..seven() }), ExcitationError::Number(_)));
    let mut still = seven_axes();
    still.links.truncate(1);
    assert!(matches!(movable(&still), Err(ExcitationError::Still(_))));
    let mut ball = seven_axes();
    ball.links[3].link.joint = rigident_shared::tree::Joint::Spherical;
    assert!(matches!(movable(&ball), Err(ExcitationError::Joint { ref name, .. }) if name == "l3_joint"));
    let missing = GivenLimits { speed: vec!["1".to_owned()], ..GivenLimits::default() };
    let missing = missing.of(&seven_axes(), Shares::default()).unwrap_err();
    assert!(missing.contains("`range` l1_joint=") && missing.contains("`effort` l7_joint="), "{missing}");
    let unknown = GivenLimits { speed: vec!["elbow=1".to_owned()], ..GivenLimits::default() };
    assert!(unknown.of(&seven_axes(), Shares::default()).unwrap_err().contains("no joint elbow"));
}

fn shared(file: &str, locked: &[&str]) -> Model {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/urdf").join(file);
    let mut model = urdf::read(&path).unwrap();
    model.lock(&locked.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>()).unwrap();
    model
}

#[test]
#[ignore = "needs ../shared/data"]
fn robots_of_shared_data_tell_as_promised() {
    let fingers = ["panda_finger_joint1", "panda_finger_joint2"];
    for (file, locked) in [("ur5_robot.urdf", &[][..]), ("panda.urdf", &fingers)] {
        let model = shared(file, locked);
        let task = task(&model, &GivenLimits::default());
        let (held, ratios, plan) = end_to_end(&model, &task, 1..9);
        let gain = plan.after.over(&plan.before).unwrap();
        println!("{file}: coverage {held:.3}, U95 over promise {:.3}, over random {gain:.2}", mean(&ratios));
        assert!((0.91..=0.99).contains(&held), "{file}: {held}");
        assert!((0.93..1.07).contains(&mean(&ratios)), "{file}: {}", mean(&ratios));
        assert!(gain < 0.7, "{file}: {gain}");
    }
}

/// A humanoid that hangs at its pelvis: all of its 29 joints at once.
#[test]
#[ignore = "needs ../shared/data"]
fn a_humanoid_of_shared_data_keeps_every_limit() {
    let model = shared("g1_29dof_rev_1_0.urdf", &[]);
    let given = GivenLimits { speed: vec!["6".to_owned()], ..GivenLimits::default() };
    let task = Task { duration_s: 4.0, ..task(&model, &given) };
    let plan = planned(&task);
    assert_kept(&task, &plan);
    let tree = Tree::new(&task.model, &task.measured).unwrap();
    let free = [vec![rigident_shared::tree::LinkState::zero(); task.model.links.len()]];
    let none = Collisions::new(&task.model, tree.paths(), (Vec::new(), &[]), task.apart, &free);
    assert!(resampled(&tree, &task.limits, &none, &plan.series, 30).unwrap().is_kept);
}

/// Names of joints are a stranger's: a spreadsheet opens the table, and `ros2 topic pub` the message.
#[test]
fn names_of_joints_are_neither_formulas_nor_columns_nor_keys() {
    let family = Family::new(&[0.3], 1.0, 3, &[1.0]);
    let series = family.series(&vec![0.1; family.len()]);
    let names = ["=cmd|x!A1", "q,\"a\nr: [x]", "shoulder"];
    let joint = |name: &&str| FileJoint {
        name: (*name).to_owned(),
        units: ["rad", "radps"],
        moves: None,
        held: 0.0,
        is_commanded: true,
    };
    let joints: Vec<FileJoint> = names.iter().map(joint).collect();
    let text = csv(&series, &joints, 10.0);
    let header = text.lines().next().unwrap();
    assert!(header.starts_with("t_s,\"'=cmd|x!A1_rad\",\"'=cmd|x!A1_radps\","), "{header}");
    assert!(header.ends_with(",shoulder_rad,shoulder_radps"), "{header}");
    assert!(text.lines().skip(1).all(|line| line.split(',').count() == 1 + 2 * names.len()), "{text}");
    let message = joint_trajectory(&series, &joints, 10.0);
    let listed: Vec<&str> = message.lines().filter(|line| line.starts_with("- \"")).collect();
    assert_eq!(listed.len(), names.len(), "{message}");
    assert!(!message.contains("\nr: [x]"));
}
