//! Robots on their feet, simulated in MuJoCo: the rows, the states of contact, `rigident identify` and
//! `rigident calibrate masses`.
//!
//! The recordings and what is true of them are in `mujoco/`, whose README says how they were made.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use nalgebra::{DVector, Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use rigident::fit::{Prediction, RowSource};
use rigident::model::{Model, urdf};
use rigident::problem::{Problem, ProblemOptions};
use rigident::recording::Recording;
use rigident::rows::tree::TreeSource;
use rigident_shared::tree::Joint;
use serde_json::Value;

fn here() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/mujoco")
}

fn robots() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/urdf")
}

/// A recording with what is true of it.
struct Robot {
    name: &'static str,
    truth: toml::Table,
    header: Vec<String>,
    rows: Vec<Vec<f64>>,
}

/// The quantities that feet measure in a test.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Feet {
    All,
    WithoutHorizontal,
    /// The contact states, and moments; no force.
    WithoutForces,
}

fn numbers(value: &toml::Value) -> Vec<f64> {
    let number = |v: &toml::Value| v.as_float().or_else(|| v.as_integer().map(|v| v as f64)).unwrap();
    value.as_array().unwrap().iter().map(number).collect()
}

impl Robot {
    fn read(name: &'static str) -> Self {
        let text = std::fs::read_to_string(here().join(format!("{name}.csv"))).unwrap();
        let mut lines = text.lines();
        let header = lines.next().unwrap().split(',').map(str::to_owned).collect();
        let rows = lines.map(|line| line.split(',').map(|v| v.parse().unwrap()).collect()).collect();
        let truth = std::fs::read_to_string(here().join(format!("{name}.toml"))).unwrap();
        Self { name, truth: truth.parse().unwrap(), header, rows }
    }

    fn words(&self, key: &str) -> Vec<String> {
        let all = self.truth[key].as_array().unwrap();
        all.iter().map(|v| v.as_str().unwrap().to_owned()).collect()
    }

    fn tables(&self, key: &str) -> Vec<&toml::Value> {
        self.truth[key].as_array().unwrap().iter().collect()
    }

    fn model_file(&self) -> PathBuf {
        robots().join(self.truth["model"].as_str().unwrap())
    }

    /// The nominal model with fingers and the like locked.
    fn nominal(&self) -> Model {
        let mut model = urdf::read(&self.model_file()).unwrap();
        model.lock(&self.words("locked")).unwrap();
        model.welded()
    }

    /// Ten parameters of every body, as they are.
    fn parameters(&self, model: &Model) -> DVector<f64> {
        let mut phi = DVector::zeros(10 * model.links.len());
        for body in self.tables("body") {
            let i = model.link(body["name"].as_str().unwrap()).unwrap();
            let mass = body["mass_kg"].as_float().unwrap();
            let centre = Vector3::from_vec(numbers(&body["com_m"]));
            let [xx, yy, zz, xy, xz, yz]: [f64; 6] = numbers(&body["tensor_kgm2"]).try_into().unwrap();
            let own = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
            let tensor =
                own + (Matrix3::identity() * centre.norm_squared() - centre * centre.transpose()) * mass;
            let moment = centre * mass;
            let tensor = [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)].map(|at| tensor[at]);
            let ten = [mass, moment.x, moment.y, moment.z].into_iter().chain(tensor);
            ten.enumerate().for_each(|(k, v)| phi[10 * i + k] = v);
        }
        phi
    }

    fn rig(&self, feet: Feet) -> String {
        let mut out = format!(
            "[recording]\nfrozen_after = 0\n[[imu]]\nposition_m = {}\nclass = \"exact\"\n[tree]\nclass \
             = \"exact\"\n[load_cell]\nclass = \"exact\"\n",
            self.truth["imu_position_m"]
        );
        for foot in self.tables("foot") {
            out += &format!(
                "[[foot]]\nname = {}\nlink = {}\nposition_m = {}\nrotation_wxyz = {}\n",
                foot["name"], foot["link"], foot["position_m"], foot["rotation_wxyz"]
            );
            out += match feet {
                Feet::All => "",
                Feet::WithoutHorizontal => "unavailable = [\"fx\", \"fy\"]\n",
                Feet::WithoutForces => "",
            };
        }
        out
    }

    /// Writes the recording and its rig file, with noise where there is a seed, and returns the recording's
    /// path.
    fn write(&self, folder: &Path, feet: Feet, seed: Option<u64>) -> PathBuf {
        let path = folder.join(format!("{}.csv", self.name));
        let mut header = self.header.clone();
        let is_force = |name: &str| name.contains("_foot_") && name.ends_with("_n");
        if feet == Feet::WithoutForces {
            let stems: Vec<String> =
                self.tables("foot").iter().map(|f| f["name"].as_str().unwrap().into()).collect();
            header = header
                .into_iter()
                .map(|name| match stems.iter().find(|stem| name == format!("{stem}_fz_n")) {
                    Some(stem) => format!("{stem}_contact"),
                    None if is_force(&name) => format!("unused_{name}"),
                    None => name,
                })
                .collect();
        }
        let mut state = seed.unwrap_or(0);
        let mut text = header.join(",") + "\n";
        for row in &self.rows {
            let cells = row.iter().zip(&self.header).enumerate().map(|(at, (value, name))| {
                if feet == Feet::WithoutForces && is_force(name) {
                    let stem = name.rsplit_once("_f").unwrap().0;
                    let force = |k: &str| {
                        let own = self.header.iter().position(|h| *h == format!("{stem}_f{k}_n")).unwrap();
                        row[own].powi(2)
                    };
                    let is_on = (force("x") + force("y") + force("z")).sqrt() > 0.5;
                    return format!("{}", u8::from(is_on));
                }
                let sigma = if seed.is_some() && at > 0 { noise_of(name) } else { 0.0 };
                format!("{}", value + sigma * normal(&mut state))
            });
            text += &(cells.collect::<Vec<_>>().join(",") + "\n");
        }
        std::fs::write(&path, text).unwrap();
        std::fs::write(folder.join(format!("{}.rig.toml", self.name)), self.rig(feet)).unwrap();
        path
    }

    fn source(&self, folder: &Path, feet: Feet) -> TreeSource {
        let path = self.write(folder, feet, None);
        let recording = Recording::load(&path, None).unwrap();
        let problem =
            Problem::from_recording(&recording, Some(&self.nominal()), &ProblemOptions::default()).unwrap();
        let input = problem.tree().unwrap().input().clone();
        TreeSource::new(input).unwrap()
    }

    /// The longest time on the ground, with a constant force on the base's origin, in its axes: the foot that
    /// bears most and its leg carry it, by virtual work.
    fn pulled(&self, force: Vector3<f64>) -> Self {
        let model = self.nominal();
        let at = |name: &str| self.header.iter().position(|own| own == name).unwrap();
        let own = |foot: &toml::Value, k: usize| {
            at(&format!(
                "{}_{}",
                foot["name"].as_str().unwrap(),
                ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"][k]
            ))
        };
        let weight: f64 = self.tables("body").iter().map(|b| 9.81 * b["mass_kg"].as_float().unwrap()).sum();
        let (mut runs, mut run) = (Vec::new(), Vec::new());
        for row in &self.rows {
            let bears = |foot: &toml::Value| (0..3).map(|k| row[own(foot, k)].powi(2)).sum::<f64>().sqrt();
            let feet = self.tables("foot");
            let foot = feet.into_iter().max_by(|a, b| bears(a).total_cmp(&bears(b))).unwrap();
            if bears(foot) < 0.2 * weight {
                runs.push(std::mem::take(&mut run));
                continue;
            }
            // Places of the joints of the leg, base's axes.
            let mut path = vec![model.link(foot["link"].as_str().unwrap()).unwrap()];
            while *path.last().unwrap() > 0 {
                path.push(model.links[*path.last().unwrap()].link.parent);
            }
            let (mut turn, mut place, mut joints) = (Matrix3::identity(), Vector3::zeros(), Vec::new());
            for i in path.into_iter().rev().skip(1) {
                let link = &model.links[i];
                place += turn * link.link.position;
                turn *= link.link.rotation;
                let Joint::Revolute(axis) = link.link.joint else { panic!("{}", link.name) };
                joints.push((at(&format!("{}_nm", link.joint_name)), turn * axis, place));
                turn *= Rotation3::new(axis * row[at(&format!("{}_rad", link.joint_name))]).into_inner();
            }
            let [w, x, y, z]: [f64; 4] = numbers(&foot["rotation_wxyz"]).try_into().unwrap();
            let sensor = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix();
            let origin = place + turn * Vector3::from_vec(numbers(&foot["position_m"]));
            // What the ground does more: against the pull, and against its moment about the foot.
            let (more, moment) = (-force, origin.cross(&force));
            let axes = (turn * sensor.into_inner()).transpose();
            let mut new = row.clone();
            for (k, v) in (axes * more).iter().chain((axes * moment).iter()).enumerate() {
                new[own(foot, k)] += v;
            }
            for (column, axis, place) in joints {
                new[column] -= axis.dot(&((origin - place).cross(&more) + moment));
            }
            run.push(new);
        }
        runs.push(run);
        let rows = runs.into_iter().max_by_key(Vec::len).unwrap();
        Self { name: self.name, truth: self.truth.clone(), header: self.header.clone(), rows }
    }

    /// The phases of at least 20 ms: start and end, s, and which feet stand.
    fn phases(&self) -> Vec<(f64, f64, Vec<String>)> {
        let of = |phase: &&toml::Value| {
            let time = |key: &str| phase[key].as_float().unwrap();
            let feet = phase["feet"].as_array().unwrap().iter().map(|f| f.as_str().unwrap().to_owned());
            (time("start_s"), time("end_s"), feet.collect())
        };
        self.tables("phase").iter().map(of).filter(|(start, end, _)| end - start >= 0.02).collect()
    }
}

fn noise_of(name: &str) -> f64 {
    match name {
        _ if name.contains("_foot_") => {
            if name.ends_with("_n") {
                0.1
            } else {
                2e-3
            }
        }
        _ if name.starts_with("imu_a") => 0.02,
        _ if name.starts_with("imu_g") => 2e-3,
        _ if name.ends_with("_nm") => 0.01,
        _ if name.ends_with("_rad") => 1e-4,
        _ => 0.01,
    }
}

/// Twelve uniform numbers less their mean.
fn normal(state: &mut u64) -> f64 {
    let mut sum = -6.0;
    for _ in 0..12 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        sum += (*state >> 11) as f64 / (1_u64 << 53) as f64;
    }
    sum
}

fn rigident(folder: &Path, line: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rigident")).current_dir(folder).args(line).output().unwrap()
}

fn object(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)))
}

/// Returns by channels the median of what the truth leaves, over the standard deviation of what is measured;
/// landings, where forces change within a sample, are few.
fn left_of_truth(robot: &Robot, feet: Feet) -> Vec<(String, f64)> {
    let folder = tempfile::tempdir().unwrap();
    let source = robot.source(folder.path(), feet);
    let phi = source.base().map() * robot.parameters(&source.input().model);
    let found = Prediction::of(&source, phi.as_slice(), &[]).unwrap();
    let of = |(c, channel): (usize, &rigident::fit::Channel)| {
        let determined = found.blocks.iter().filter(|block| block.determined.get(c) != Some(&false));
        let mut left: Vec<f64> =
            determined.map(|block| (block.measured[c] - block.predicted[c]).abs()).collect();
        left.sort_by(f64::total_cmp);
        let median = left.get(left.len() / 2).copied()?;
        (left.len() > 50).then(|| (channel.name.clone(), median / found.measured_sd[c]))
    };
    source.channels().iter().enumerate().filter_map(of).collect()
}

#[test]
#[ignore = "needs ../shared/data"]
fn rows_hold_for_measurements_by_an_independent_engine_of_shared_data_robots() {
    for (name, feet, limit, least) in [
        ("solo12", Feet::All, 1e-4, 18),
        ("solo12", Feet::WithoutHorizontal, 1e-4, 10),
        ("solo12", Feet::WithoutForces, 1e-4, 6),
        ("g1", Feet::All, 1e-3, 35),
        ("g1", Feet::WithoutHorizontal, 1e-3, 31),
        ("jvrc1", Feet::All, 5e-3, 38),
        ("jvrc1", Feet::WithoutHorizontal, 5e-3, 34),
    ] {
        let left = left_of_truth(&Robot::read(name), feet);
        assert!(left.len() >= least, "{name}: {} channels", left.len());
        let worst = left.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!(worst.1 < limit, "{name}, {feet:?}: {worst:?} of {left:?}");
    }
}

#[test]
#[ignore = "needs ../shared/data"]
fn flight_single_and_double_support_of_shared_data_robots_are_distinguished() {
    for name in ["solo12", "g1", "jvrc1"] {
        let (robot, folder) = (Robot::read(name), tempfile::tempdir().unwrap());
        let source = robot.source(folder.path(), Feet::All);
        let input = source.input();
        let contact = input.contact.as_ref().unwrap();
        let (mut agreed, mut frames) = (0, 0);
        let mut kinds = std::collections::BTreeSet::new();
        for frame in &input.frames {
            let t = frame.time_ns as f64 * 1e-9;
            // Where a foot comes or goes it bears less than what counts as standing.
            let inside = |(start, end, _): &&(f64, f64, Vec<String>)| t > start + 0.05 && t < end - 0.05;
            let phases = robot.phases();
            let Some((_, _, feet)) = phases.iter().find(inside) else { continue };
            let standing = contact.feet.iter().zip(&contact.states[frame.ground.state].touching);
            frames += 1;
            let mut standing: Vec<&String> = standing.filter(|(_, on)| **on).map(|(f, _)| &f.name).collect();
            let mut feet: Vec<&String> = feet.iter().collect();
            standing.sort();
            feet.sort();
            agreed += u32::from(standing == feet);
            // A foot that bears next to nothing does not stand.
            assert!(
                standing.iter().all(|foot| feet.contains(foot)),
                "{name} at {t} s: {standing:?}, {feet:?}"
            );
            kinds.insert(standing.len());
        }
        assert!(frames > 500 && 10 * agreed > 9 * frames, "{name}: {agreed} of {frames}");
        let wanted = if name == "solo12" { vec![0, 3, 4] } else { vec![0, 1, 2] };
        assert_eq!(kinds.into_iter().collect::<Vec<_>>(), wanted, "{name}");
    }
}

#[test]
#[ignore = "needs ../shared/data"]
fn intervals_hold_the_truth_of_a_shared_data_quadruped_with_noise() {
    let robot = Robot::read("solo12");
    let (mut inside, mut all) = (0, 0);
    for seed in 1..=3 {
        let folder = tempfile::tempdir().unwrap();
        robot.write(folder.path(), Feet::All, Some(seed));
        let model = robot.model_file();
        let output = rigident(
            folder.path(),
            &["identify", "solo12.csv", "--model", model.to_str().unwrap(), "--json", "--out", "out"],
        );
        let answer = object(&output);
        let nominal = robot.nominal();
        let base = robot.source(folder.path(), Feet::All).base().clone();
        let truth = base.map() * robot.parameters(&nominal);
        for (own, truth) in base.parameters.iter().zip(truth.iter()) {
            let found =
                answer["parameters"].as_array().unwrap().iter().find(|p| p["name"] == own.name.as_str());
            let found = found.unwrap_or_else(|| panic!("{}", own.name));
            let (Some(value), Some(u95)) = (found["value"].as_f64(), found["u95"].as_f64()) else { continue };
            all += 1;
            inside += u32::from((value - truth).abs() <= u95);
            if own.name == "base_link.M" {
                assert!((value - truth).abs() < 2.0 * u95 && u95 < 2e-3, "{value} {u95} for {truth}");
            }
        }
    }
    println!("{inside} of {all}");
    // 95 % of some 190, of which those of a seed have their noise in common.
    assert!(all > 140 && f64::from(inside) > 0.9 * f64::from(all), "{inside} of {all}");
}

#[test]
#[ignore = "needs ../shared/data"]
fn masses_of_a_shared_data_quadruped_predict_unseen_motions() {
    let (robot, folder) = (Robot::read("solo12"), tempfile::tempdir().unwrap());
    robot.write(folder.path(), Feet::WithoutHorizontal, Some(7));
    let text = std::fs::read_to_string(folder.path().join("solo12.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    for (name, lines) in [("first", &lines[1..800]), ("last", &lines[800..])] {
        std::fs::write(
            folder.path().join(format!("{name}.csv")),
            format!("{}\n{}\n", lines_of(&text), lines.join("\n")),
        )
        .unwrap();
    }
    let (model, rig) = (robot.model_file(), "solo12.rig.toml");
    let model = model.to_str().unwrap();
    let output = rigident(
        folder.path(),
        &["calibrate", "masses", model, "first.csv", "--rig", rig, "--json", "--write-model", "new.urdf"],
    );
    let found = object(&output);
    assert_eq!(output.status.code(), Some(0), "{found:#}");
    let ways = found["ways"].as_array().unwrap();
    let nominal = found["nominal_cost"].as_f64().unwrap();
    for way in ways {
        assert!(way["cost"].as_f64().unwrap() < 0.1 * nominal, "{way}");
    }
    assert_eq!(found["chosen"], "consistent");
    let mass = found["whole_mass_kg"].as_f64().unwrap();
    assert!((mass - 2.483_042).abs() < 2e-3, "{mass}");
    let output = rigident(
        folder.path(),
        &["validate", "new.urdf", "last.csv", "--model", model, "--rig", rig, "--json"],
    );
    let found = object(&output);
    let channels = found["channels"].as_array().unwrap();
    let (mut better, mut count) = (0, 0);
    let judged = channels.iter().filter(|channel| channel["models"].is_array());
    for channel in judged {
        let of = |name: &str| {
            let all = channel["models"].as_array().unwrap();
            all.iter().find(|e| e["model"] == name).and_then(|e| e["rms"].as_f64()).unwrap()
        };
        // Rows by which forces were eliminated throughout predict nothing.
        if of("nominal") == 0.0 {
            continue;
        }
        count += 1;
        better += u32::from(of("new") < of("nominal"));
    }
    assert!(count >= 10 && better == count, "{better} of {count}: {found:#}");
}

/// Root mean square of what links' masses are off by, relative.
fn off(robot: &Robot, found: &Value, key: &str) -> f64 {
    let links = robot.tables("link");
    let of = |own: &Value| {
        let truth = links.iter().find(|link| link["name"].as_str() == own["link"].as_str())?;
        let mass = truth["mass_kg"].as_float().filter(|mass| *mass > 0.02)?;
        Some((own[key].as_f64().unwrap() / mass - 1.0).powi(2))
    };
    let squares: Vec<f64> = found["links"].as_array().unwrap().iter().filter_map(of).collect();
    assert!(squares.len() > 10);
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// A twentieth of the weight pulls at the base of a quadruped: it is found and eliminated, and masses are as
/// good as where nothing pulls, which they are not if it is taken for none; nothing is found where nothing
/// pulls, and the whole mass is in its interval.
#[test]
#[ignore = "needs ../shared/data"]
fn a_pull_at_the_base_of_a_shared_data_quadruped_is_found_and_takes_no_part_in_masses() {
    let robot = Robot::read("solo12");
    let masses = |robot: &Robot, more: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        robot.write(folder.path(), Feet::All, Some(5));
        let model = robot.model_file();
        let line = ["calibrate", "masses", model.to_str().unwrap(), "solo12.csv", "--json"];
        object(&rigident(folder.path(), &[&line[..], more].concat()))
    };
    let truth = 2.483_042;
    let force = Vector3::new(1.0, -0.75, 0.0);
    let own = [Vector3::zeros(), force].map(|pull| {
        let found = masses(&robot.pulled(pull), &[]);
        let [mass, u95] = ["identified_whole_mass_kg", "identified_whole_mass_u95_kg"]
            .map(|key| found[key].as_f64().unwrap());
        assert!((mass - truth).abs() < 1.5 * u95, "{mass} ± {u95}");
        let said = found["warnings"].to_string();
        assert_eq!(
            said.contains("something beside the ground pulls at base_link"),
            pull.norm() > 0.0,
            "{said}"
        );
        if let Some(own) = found["external_force_n"].as_array() {
            let own = Vector3::from_iterator(own.iter().map(|v| v.as_f64().unwrap()));
            assert!((own - pull).xy().norm() < 0.1, "{own}");
        }
        off(&robot, &found, "mass_kg")
    });
    let without = masses(&robot.pulled(force), &["--external-wrench", "none"]);
    let worse = off(&robot, &without, "mass_kg");
    println!("{own:?}, {worse}");
    assert!(own[1] < 1.3 * own[0] && worse > 1.5 * own[1], "{own:?}, {worse}");
}

/// Torques of other gains and a foot without a sensor are taken for masses by least squares, which predict
/// the better for it. Both are found and named, and the masses are as good as those without a fault.
#[test]
#[ignore = "needs ../shared/data"]
fn faults_that_no_left_out_motion_of_a_shared_data_quadruped_shows_do_not_become_masses() {
    let robot = Robot::read("solo12");
    let mut gains = robot.rows.clone();
    for (k, joint) in robot.words("joints").iter().enumerate() {
        let at = robot.header.iter().position(|own| *own == format!("{joint}_nm")).unwrap();
        gains.iter_mut().for_each(|row| row[at] *= 0.75 + 0.04 * k as f64);
    }
    let gains =
        Robot { name: robot.name, rows: gains, header: robot.header.clone(), truth: robot.truth.clone() };
    let masses = |robot: &Robot, kind: &str, is_foot_gone: bool| {
        let folder = tempfile::tempdir().unwrap();
        robot.write(folder.path(), Feet::All, Some(5));
        if is_foot_gone {
            let rig = robot.rig(Feet::All);
            let last = rig.rfind("[[foot]]").unwrap();
            std::fs::write(folder.path().join("solo12.rig.toml"), &rig[..last]).unwrap();
        }
        let model = robot.model_file();
        let line = ["calibrate", "masses", model.to_str().unwrap(), "solo12.csv", "--json"];
        let found = object(&rigident(folder.path(), &line));
        let named = found["eliminated"].as_array().unwrap().iter();
        (named.filter(|own| own["kind"] == kind).count(), off(robot, &found, "mass_kg"))
    };
    let (none, clean) = masses(&robot, "effort_scale", false);
    let (scales, of_gains) = masses(&gains, "effort_scale", false);
    let (feet, without_foot) = masses(&robot, "unmeasured_wrench", true);
    println!("{clean} {of_gains} {without_foot}");
    assert!(none == 0 && scales >= 8 && feet == 1, "{none} {scales} {feet}");
    assert!(of_gains < 1.3 * clean && without_foot < 1.3 * clean, "{clean} {of_gains} {without_foot}");
}

fn lines_of(text: &str) -> &str {
    text.lines().next().unwrap()
}

/// Each case has an error, the change of the recording or rig file, and a word that names it.
#[test]
#[ignore = "needs ../shared/data"]
fn bad_input_of_feet_and_torques_of_shared_data_robots_is_named() {
    let (robot, folder) = (Robot::read("solo12"), tempfile::tempdir().unwrap());
    let path = robot.write(folder.path(), Feet::All, Some(3));
    let model = robot.model_file();
    let model = model.to_str().unwrap();
    let (text, rig) = (std::fs::read_to_string(&path).unwrap(), robot.rig(Feet::All));
    let column = robot.header.iter().position(|name| name == "FL_HFE_nm").unwrap();
    let force = robot.header.iter().position(|name| name == "HR_foot_fz_n").unwrap();
    let changed = |at: usize, change: &dyn Fn(f64) -> f64| {
        let line = |(row, line): (usize, &str)| {
            if row == 0 {
                return line.to_owned();
            }
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            cells[at] = change(cells[at].parse().unwrap()).to_string();
            cells.join(",")
        };
        text.lines().enumerate().map(line).collect::<Vec<_>>().join("\n") + "\n"
    };
    let masses = |text: &str, rig: &str| {
        std::fs::write(&path, text).unwrap();
        std::fs::write(folder.path().join("solo12.rig.toml"), rig).unwrap();
        let output = rigident(
            folder.path(),
            &[
                "calibrate",
                "masses",
                model,
                "solo12.csv",
                "--method",
                "ridge",
                "--weight",
                "1",
                "--parts",
                "1",
            ],
        );
        let said = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
        (output.status.code(), said)
    };
    let zero = rig.replacen("[[foot]]", "[[foot]]\nname = \"x\"\nlink = \"nowhere\"\n[[foot]]", 1);
    let no_imu = text.replacen("imu_ax_mps2", "old_ax", 1).replacen("imu_ay_mps2", "old_ay", 1).replacen(
        "imu_az_mps2",
        "old_az",
        1,
    );
    let cases = [
        (changed(column, &|v| -v), rig.clone(), Some(1), "FL_HFE has the opposite sign"),
        (changed(column, &|v| 1e3 * v), rig.clone(), Some(1), "N mm"),
        (changed(column, &|v| 1e-9 * v), rig.clone(), Some(1), "FL_HFE hardly changes"),
        (changed(force, &|v| v + 0.4), rig.clone(), None, "foot HR_foot reads fz"),
        (text.clone(), zero, Some(2), "nowhere"),
        (text.clone(), rig.replace("name = \"HL_foot\"", "name = \"HX_foot\""), Some(2), "HX_foot"),
        (no_imu, rig.clone(), Some(2), "imu_ax_mps2"),
        (text.clone(), rig.replacen("[[foot]]", "[[foot]]\nunavailable = [\"f\"]", 1), Some(2), "component"),
    ];
    for (text, rig, status, word) in cases {
        let (code, said) = masses(&text, &rig);
        assert!(said.contains(word), "{word}: {said}");
        if let Some(status) = status {
            assert_eq!(code, Some(status), "{word}: {said}");
        }
    }
}

/// The command with a robot of another program's: nothing changes and nothing is reported, and what it lacks
/// is named.
#[test]
fn a_robot_is_watched_from_the_command_line_and_missing_inputs_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let robot = Robot::read("solo12");
    let path = robot.write(folder.path(), Feet::All, Some(11));
    let model = robot.model_file();
    let model = model.to_str().unwrap();
    let link = "FR_LOWER_LEG";
    let watch = |more: &[&str]| {
        let output = rigident(folder.path(), &[&["watch", "solo12.csv"], more].concat());
        let words =
            |bytes: &[u8]| String::from_utf8_lossy(bytes).split_whitespace().collect::<Vec<_>>().join(" ");
        (output.status.code(), words(&output.stdout), words(&output.stderr))
    };
    let (code, said, _) = watch(&["--model", model, "--link", link, "--settle-s", "2"]);
    assert!(code == Some(0) && said.starts_with("FR_LOWER_LEG: 0 changes"), "{code:?} {said}");
    let (code, said, _) = watch(&["--model", model, "--link", link]);
    assert!(code == Some(1) && said.contains("--settle-s"), "{code:?} {said}");
    let (text, rig) = (std::fs::read_to_string(&path).unwrap(), robot.rig(Feet::All));
    let no_imu = ["x", "y", "z"].iter().fold(text.clone(), |text, axis| {
        text.replacen(&format!("imu_a{axis}_mps2"), &format!("old_a{axis}"), 1)
    });
    let cases = [
        (&text, rig.clone(), vec!["--model", model, "--link", "tail"], "no link tail; its links are"),
        (&text, rig.clone(), vec!["--link", link], "--model"),
        (&no_imu, rig.clone(), vec!["--model", model, "--link", link], "imu_ax_mps2"),
        (&text, robot.rig(Feet::WithoutHorizontal), vec!["--model", model, "--link", link], "fx of foot"),
        (&text, rig.clone(), vec!["--model", model, "--link", link, "--settle-s", "0"], "--settle-s 0"),
    ];
    for (text, rig, line, word) in cases {
        std::fs::write(&path, text).unwrap();
        std::fs::write(folder.path().join("solo12.rig.toml"), rig).unwrap();
        let (code, _, said) = watch(&line);
        assert!(code == Some(2) && said.contains(word), "{word}: {code:?} {said}");
    }
}
