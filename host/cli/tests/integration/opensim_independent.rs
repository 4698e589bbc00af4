//! Files of OpenSim's against OpenSim itself (the wheel `opensim`), which shares no code with this project.
//! `RIGIDENT_PYTHON` names an interpreter that has it, as `cargo xtask setup` installs it.

use crate::program::python;
use std::path::{Path, PathBuf};
use std::process::Command;

use nalgebra::Vector3;
use rigident::motion_capture::opensim::model::OsimModel;
use rigident::motion_capture::opensim::storage::Storage;
use rigident::motion_capture::opensim::trc::Trc;
use serde_json::Value;

const MARKERS: &str = "
import sys, json, math, opensim
t = opensim.TimeSeriesTableVec3(sys.argv[1])
metre = {'m': 1.0, 'mm': 1e-3}[t.getTableMetaDataString('Units')]
seen = lambda v: None if math.isnan(v) else v * metre
rows = [t.getRowAtIndex(i) for i in range(t.getNumRows())]
print(json.dumps({
    'labels': list(t.getColumnLabels()),
    'times': list(t.getIndependentColumn()),
    'points': [[seen(row[k][j]) for j in range(3)] for row in rows for k in range(t.getNumColumns())],
}))
";

const TABLE: &str = "
import sys, json, opensim
t = opensim.TimeSeriesTable(sys.argv[1])
print(json.dumps({
    'columns': list(t.getColumnLabels()),
    'times': list(t.getIndependentColumn()),
    'values': [t.getRowAtIndex(i)[k] for i in range(t.getNumRows()) for k in range(t.getNumColumns())],
}))
";

const MODEL: &str = "
import sys, json, opensim
m = opensim.Model(sys.argv[1])
s = m.initSystem()
three = lambda v: [v.get(k) for k in range(3)]
turn = lambda t: [[t.R().get(i, j) for j in range(3)] for i in range(3)]
def tensor(b):
    i = b.getInertia()
    a, p = i.getMoments(), i.getProducts()
    return three(a) + three(p)
joints = {}
for j in m.getJointSet():
    child = j.getChildFrame()
    joints[child.findBaseFrame().getName()] = three(child.getPositionInGround(s))
print(json.dumps({
    'mass': m.getTotalMass(s),
    'bodies': [{
        'name': b.getName(), 'mass': b.getMass(), 'com': three(b.getMassCenter()), 'inertia': tensor(b),
        'place': three(b.getPositionInGround(s)), 'turn': turn(b.getTransformInGround(s)), 'joint': joints[b.getName()],
    } for b in m.getBodySet()],
}))
";

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(file)
}

fn opensim(script: &str, file: &Path) -> Value {
    let python = python();
    let quiet = format!("import opensim; opensim.Logger.setLevelString('Off')\n{script}");
    let out = Command::new(python).args(["-c", &quiet]).arg(file).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    // Its readers print what they read.
    let said = String::from_utf8(out.stdout).unwrap();
    serde_json::from_str(said.lines().find(|line| line.starts_with('{')).unwrap()).unwrap()
}

fn floats(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect()
}

fn text(file: &Path) -> String {
    std::fs::read_to_string(file).unwrap()
}

#[test]
#[ignore = "needs opensim in Python and the shared recordings"]
fn markers_and_tables_of_shared_data_are_read_as_independent_opensim_reads_them() {
    for name in [
        "human_gait2354_subject01_walk/subject01_walk1.trc",
        "human_gait2354_subject01_walk/subject01_static.trc",
        "human_rajagopal2016_walk/markers_walk.trc",
    ] {
        let (ours, theirs) = (Trc::parse(&text(&data(name))).unwrap(), opensim(MARKERS, &data(name)));
        let labels: Vec<&str> =
            theirs["labels"].as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect();
        assert_eq!(ours.labels, labels, "{name}");
        let points = theirs["points"].as_array().unwrap();
        assert_eq!(points.len(), ours.points_m.len(), "{name}");
        for (a, b) in points.iter().zip(&ours.points_m) {
            for (a, b) in floats(a).iter().zip(b) {
                assert!((a.is_nan() && b.is_nan()) || (a - f64::from(*b)).abs() < 1e-6, "{name}: {a} {b}");
            }
        }
        assert!((ours.first_s - theirs["times"][0].as_f64().unwrap()).abs() < 1e-9, "{name}");
    }
    for name in
        ["human_gait2354_subject01_walk/subject01_walk1_grf.mot", "human_rajagopal2016_walk/grf_walk.mot"]
    {
        let (ours, theirs) = (Storage::parse(&text(&data(name))).unwrap(), opensim(TABLE, &data(name)));
        let columns: Vec<&str> =
            theirs["columns"].as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect();
        assert_eq!(ours.columns, columns, "{name}");
        assert_eq!(
            (&ours.times_s, &ours.values),
            (&floats(&theirs["times"]), &floats(&theirs["values"])),
            "{name}"
        );
    }
}

#[test]
#[ignore = "needs opensim in Python and the shared recordings"]
fn models_of_shared_data_are_read_as_independent_opensim_reads_them() {
    for name in
        ["human_gait2354_subject01_walk/subject01.osim", "human_rajagopal2016_walk/subject_walk_scaled.osim"]
    {
        let (ours, theirs) = (OsimModel::parse(&text(&data(name))).unwrap(), opensim(MODEL, &data(name)));
        let bodies = theirs["bodies"].as_array().unwrap();
        assert_eq!(bodies.len(), ours.bodies.len());
        let places = ours.places();
        for body in bodies {
            let called = body["name"].as_str().unwrap();
            let k = ours.body(called).unwrap();
            let own = &ours.bodies[k];
            assert_eq!(body["mass"], own.mass_kg, "{called}");
            assert_eq!(floats(&body["com"]), own.com_m, "{called}");
            for (a, b) in floats(&body["inertia"]).iter().zip(own.inertia_com_kgm2) {
                // It keeps six digits of files of earlier versions.
                assert!((a - b).abs() <= 1e-5 * b.abs(), "{called}: {a} {b}");
            }
            let place = places[k].unwrap();
            let turn = place.rotation.to_rotation_matrix();
            for i in 0..3 {
                assert!(
                    (body["place"][i].as_f64().unwrap() - place.translation.vector[i]).abs() < 1e-4,
                    "{called}"
                );
                for j in 0..3 {
                    assert!((body["turn"][i][j].as_f64().unwrap() - turn[(i, j)]).abs() < 1e-3, "{called}");
                }
            }
            let joint = Vector3::from_vec(floats(&body["joint"]));
            assert!((joint - ours.joint_centre(called).unwrap()).norm() < 1e-4, "{called}");
        }
    }
}

/// Bodies as one, by OpenSim's numbers: mass, centre of mass about the first one's joint, radii of gyration,
/// in the ground's axes.
fn together(model: &Value, names: &[&str]) -> (f64, Vector3<f64>, Vector3<f64>) {
    let bodies = model["bodies"].as_array().unwrap();
    let of = |name: &&str| bodies.iter().find(|b| b["name"] == **name).unwrap();
    let own: Vec<&Value> = names.iter().map(of).collect();
    let vector = |v: &Value| Vector3::from_vec(floats(v));
    let turn = |b: &Value| nalgebra::Matrix3::from_fn(|i, j| b["turn"][i][j].as_f64().unwrap());
    let mass = |b: &Value| b["mass"].as_f64().unwrap();
    let centre = |b: &Value| vector(&b["place"]) + turn(b) * vector(&b["com"]);
    let whole: f64 = own.iter().map(|b| mass(b)).sum();
    let middle = own.iter().map(|b| centre(b) * mass(b)).sum::<Vector3<f64>>() / whole;
    let tensor = |b: &Value| {
        let [xx, yy, zz, xy, xz, yz] = floats(&b["inertia"])[..] else { panic!() };
        let own = nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let d = centre(b) - middle;
        let moved = nalgebra::Matrix3::identity() * d.norm_squared() - d * d.transpose();
        turn(b) * own * turn(b).transpose() + moved * mass(b)
    };
    let tensor: nalgebra::Matrix3<f64> = own.iter().map(|b| tensor(b)).sum();
    let radii = tensor.diagonal().map(|v| (v / whole).sqrt());
    (whole, middle - vector(&own[0]["joint"]), radii)
}

/// Identifies a person, writes her segments into a model, and returns the result with the model as OpenSim
/// reads it.
fn written(folder: &Path, template: &Path, trials: &[&str]) -> (Value, Value) {
    let path = folder.join("written.osim");
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
    command.current_dir(folder).args(["body", "identify", "--json", "--out", "out"]);
    for word in trials {
        if word.starts_with("--") {
            command.arg(word)
        } else {
            command.arg(data(word))
        };
    }
    let run = command.arg("--osim").arg(template).arg("--write-model").arg(&path).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    // Everything but inertias is as it was, byte by byte.
    let others = |text: &str| -> Vec<String> {
        let is_other =
            |line: &&str| !["<mass>", "<mass_center>", "<inertia"].iter().any(|tag| line.contains(tag));
        text.split_inclusive('\n').filter(is_other).map(str::to_owned).collect()
    };
    let (old, new) = (text(template), text(&path));
    assert_eq!(others(&old), others(&new));
    assert_eq!(old.lines().count(), new.lines().count());
    (serde_json::from_slice(&run.stdout).unwrap(), opensim(MODEL, &path))
}

/// Our segments without their side, each with the bodies that it is.
type Pairs<'a> = &'a [(&'a str, &'a [&'a str])];

/// Checks that segments are bodies as OpenSim has them, and that the whole mass is the same.
#[track_caller]
fn same(result: &Value, model: &Value, pairs: Pairs) {
    let segments = result["person"]["segments"].as_array().unwrap();
    let mass = |segment: &Value| segment["mass_kg"]["value"].as_f64().unwrap();
    let whole: f64 = segments.iter().map(mass).sum();
    assert!((model["mass"].as_f64().unwrap() - whole).abs() < 1e-9 * whole, "{whole} {}", model["mass"]);
    for (segment, bodies) in pairs {
        for side in ["r", "l"] {
            let names: Vec<String> = bodies.iter().map(|body| format!("{body}_{side}")).collect();
            let (kg, centre, radii) = together(model, &names.iter().map(String::as_str).collect::<Vec<_>>());
            let own = segments.iter().find(|s| s["name"] == format!("{side}_{segment}")).unwrap();
            assert!((kg - mass(own)).abs() < 1e-9 * kg, "{own}");
            let com: [f64; 3] = std::array::from_fn(|k| own["com_m"][k]["value"].as_f64().unwrap());
            let radius = floats(&own["radii_m"]);
            // x forward, y up, z to the right there; x forward, y to the left, z up here. Where joints of
            // theirs are at rest is known to 0.1 mm.
            assert!((centre - Vector3::new(com[0], com[2], -com[1])).norm() < 2e-4, "{centre:?} {own}");
            assert!((radii - Vector3::new(radius[0], radius[2], radius[1])).norm() < 2e-4, "{radii:?} {own}");
        }
    }
}

#[test]
#[ignore = "needs opensim in Python and the shared recordings"]
fn segments_written_into_models_of_shared_data_are_those_of_independent_opensim() {
    const FOOT: &[&str] = &["talus", "calcn", "toes"];
    let folder = tempfile::tempdir().unwrap();
    let gait = "human_gait2354_subject01_walk/subject01";
    let trials = [format!("{gait}_walk1.trc"), "--static".to_owned(), format!("{gait}_static.trc")];
    let (result, model) =
        written(folder.path(), &data(&format!("{gait}.osim")), &trials.each_ref().map(String::as_str));
    same(&result, &model, &[("thigh", &["femur"]), ("shank", &["tibia"]), ("foot", FOOT)]);
    let folder = tempfile::tempdir().unwrap();
    let walk = |file: &str| format!("human_rajagopal2016_walk/{file}");
    let trials = [walk("markers_walk.trc"), "--ground".to_owned(), walk("grf_walk.mot")];
    let template = data(&walk("subject_walk_scaled.osim"));
    let (result, model) = written(folder.path(), &template, &trials.each_ref().map(String::as_str));
    let arms: Pairs = &[("upper_arm", &["humerus"]), ("forearm", &["ulna", "radius"]), ("hand", &["hand"])];
    same(&result, &model, arms);
    same(&result, &model, &[("thigh", &["femur"]), ("shank", &["tibia", "patella"]), ("foot", FOOT)]);
}
