//! Recordings of robots on their feet, with what is true of them, and the program.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use nalgebra::{DVector, Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
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
pub(super) struct Robot {
    pub(super) name: &'static str,
    pub(super) truth: toml::Table,
    pub(super) header: Vec<String>,
    pub(super) rows: Vec<Vec<f64>>,
}

/// The quantities that feet measure in a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Feet {
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
    pub(super) fn read(name: &'static str) -> Self {
        let text = std::fs::read_to_string(here().join(format!("{name}.csv"))).unwrap();
        let mut lines = text.lines();
        let header = lines.next().unwrap().split(',').map(str::to_owned).collect();
        let rows = lines.map(|line| line.split(',').map(|v| v.parse().unwrap()).collect()).collect();
        let truth = std::fs::read_to_string(here().join(format!("{name}.toml"))).unwrap();
        Self { name, truth: truth.parse().unwrap(), header, rows }
    }

    pub(super) fn words(&self, key: &str) -> Vec<String> {
        let all = self.truth[key].as_array().unwrap();
        all.iter().map(|v| v.as_str().unwrap().to_owned()).collect()
    }

    pub(super) fn tables(&self, key: &str) -> Vec<&toml::Value> {
        self.truth[key].as_array().unwrap().iter().collect()
    }

    pub(super) fn model_file(&self) -> PathBuf {
        robots().join(self.truth["model"].as_str().unwrap())
    }

    /// The nominal model with fingers and the like locked.
    pub(super) fn nominal(&self) -> Model {
        let mut model = urdf::read(&self.model_file()).unwrap();
        model.lock(&self.words("locked")).unwrap();
        model.welded()
    }

    /// Ten parameters of every body, as they are.
    pub(super) fn parameters(&self, model: &Model) -> DVector<f64> {
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

    pub(super) fn rig(&self, feet: Feet) -> String {
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
    pub(super) fn write(&self, folder: &Path, feet: Feet, seed: Option<u64>) -> PathBuf {
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

    pub(super) fn source(&self, folder: &Path, feet: Feet) -> TreeSource {
        let path = self.write(folder, feet, None);
        let recording = Recording::load(&path, None).unwrap();
        let problem =
            Problem::from_recording(&recording, Some(&self.nominal()), &ProblemOptions::default()).unwrap();
        let input = problem.tree().unwrap().input().clone();
        TreeSource::new(input).unwrap()
    }

    /// The longest time on the ground, with a constant force on the base's origin, in its axes: the foot that
    /// bears most and its leg carry it, by virtual work.
    pub(super) fn pulled(&self, force: Vector3<f64>) -> Self {
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
    pub(super) fn phases(&self) -> Vec<(f64, f64, Vec<String>)> {
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

pub(super) fn rigident(folder: &Path, line: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rigident")).current_dir(folder).args(line).output().unwrap()
}

pub(super) fn object(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)))
}
