//! `rigident predict` and `rigident validate`: arms with friction, rest and encoder noise, by the commands.

use crate::program::python;
use std::path::{Path, PathBuf};
use std::process::Command;

use rigident::laboratory::arm::{ArmRun, csv};
use rigident::laboratory::trees::seven_axes;
use rigident::model::xml::Language;
use rigident::model::{Model, human::Person, write};
use serde_json::Value;

fn robot(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/urdf").join(file)
}

fn open(path: &Path) -> Model {
    rigident::rows::named_model::open(path.to_str().unwrap(), &Person::default()).unwrap().0
}

/// Runs the program in a folder; standard output.
fn rigident(folder: &Path, line: &[&str]) -> String {
    let output =
        Command::new(env!("CARGO_BIN_EXE_rigident")).current_dir(folder).args(line).output().unwrap();
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 1)), "{line:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Writes two recordings of different motions.
fn record(folder: &Path, model: &Model, run: &ArmRun) {
    let other = ArmRun { motion: run.motion + 1, seed: run.seed + 7, ..run.clone() };
    for (name, run) in [("first.csv", run.clone()), ("second.csv", other)] {
        std::fs::write(folder.join(name), csv(&run.recording(model))).unwrap();
        // No error of sensors is simulated.
        std::fs::write(folder.join(name.replace("csv", "rig.toml")), "[tree]\nclass = \"exact\"\n").unwrap();
    }
}

/// NRMSE by channel of a model.
fn nrmse(found: &Value, model: &str) -> Vec<f64> {
    let channels = found["channels"].as_array().unwrap().iter();
    let own = |channel: &Value| {
        let mut models = channel["models"].as_array().unwrap().iter();
        models.find(|own| own["model"] == model).and_then(|own| own["nrmse"].as_f64())
    };
    channels.map(|channel| own(channel).unwrap()).collect()
}

fn compare(file: &str, locked: &str, run: &ArmRun) -> (Value, tempfile::TempDir) {
    let folder_of = tempfile::tempdir().unwrap();
    let folder = folder_of.path();
    let path = robot(file);
    let mut model = open(&path);
    if !locked.is_empty() {
        let joints = locked.split(',').map(str::to_owned);
        for joint in joints {
            let at = model.joint(&joint).unwrap();
            model.links[at].link.joint = rigident_shared::tree::Joint::Fixed;
        }
    }
    record(folder, &model, run);
    let path = path.to_str().unwrap();
    let mut line = vec![
        "identify",
        "first.csv",
        "--model",
        path,
        "--friction",
        // Friction of these arms jumps.
        "viscous,coulomb:0,offset,rotor",
        "--out",
        "first",
    ];
    let mut other = vec![
        "validate",
        "first/result.json",
        "second.csv",
        "--model",
        path,
        "--train",
        "first.csv",
        "--json",
    ];
    if !locked.is_empty() {
        line.extend(["--lock", locked]);
        other.extend(["--lock", locked]);
    }
    rigident(folder, &line);
    // Without efforts the motion is enough to predict them.
    let text = std::fs::read_to_string(folder.join("second.csv")).unwrap();
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let kept: Vec<usize> = (0..header.len()).filter(|k| !header[*k].ends_with("_nm")).collect();
    let without: String = text
        .lines()
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            kept.iter().map(|k| cells[*k]).collect::<Vec<_>>().join(",") + "\n"
        })
        .collect();
    std::fs::write(folder.join("motion.csv"), without).unwrap();
    std::fs::write(folder.join("motion.rig.toml"), "[tree]\nclass = \"exact\"\n").unwrap();
    let locked: &[&str] = if locked.is_empty() { &[] } else { &["--lock", locked] };
    let predict = |recording, out| {
        let line = ["predict", "first/result.json", recording, "--model", path, "--out", out];
        rigident(folder, &[&line, locked].concat());
        let text = std::fs::read_to_string(folder.join(out).join("prediction.csv")).unwrap();
        assert!(folder.join(out).join("report.html").is_file());
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        let header = lines.next().unwrap();
        let at: Vec<usize> = (0..header.len()).filter(|k| header[*k].ends_with("_identified")).collect();
        lines.map(|cells| at.iter().map(|k| cells[*k].clone()).collect::<Vec<_>>()).collect::<Vec<_>>()
    };
    let (with, without) = (predict("second.csv", "with"), predict("motion.csv", "without"));
    assert!(with.len() > 1000 && with == without);
    let found = serde_json::from_str(&rigident(folder, &other)).unwrap();
    (found, folder_of)
}

const ARMS: [(&str, &str); 2] =
    [("ur5_robot.urdf", ""), ("panda.urdf", "panda_finger_joint1,panda_finger_joint2")];

fn noisy() -> ArmRun {
    ArmRun { position_noise: 1e-5, rate_noise: 2e-3, rotor: 0.2, ..ArmRun::default() }
}

/// Six and seven axes at rest, in motion and at rest again, by noisy encoders: what is identified predicts
/// another motion as well as plain least squares, in every joint.
#[test]
#[ignore = "needs ../shared/data"]
fn arms_of_shared_data_are_predicted_as_well_as_by_plain_least_squares() {
    for (file, locked) in ARMS {
        let (found, _) = compare(file, locked, &noisy());
        let (own, plain) = (nrmse(&found, "identified"), nrmse(&found, "least squares"));
        assert_eq!(own.len(), if locked.is_empty() { 6 } else { 7 });
        for (k, (own, plain)) in own.iter().zip(&plain).enumerate() {
            // What is left is the noise that both have; half a per cent of it is chance.
            assert!(*own < 1.005 * plain, "{file}, joint {}: {own} {plain}", k + 1);
        }
    }
}

/// An arm that never rests, and noise that central differences bear.
fn moving() -> ArmRun {
    ArmRun { rest_s: 0.0, position_noise: 1e-5, rate_noise: 1e-4, rotor: 0.2, ..ArmRun::default() }
}

/// Plain least squares are what they are called: Pinocchio's rows with accelerations and numpy's solution
/// leave as much.
#[test]
#[ignore = "needs ../shared/data and Pinocchio in Python"]
fn plain_least_squares_of_shared_data_leave_the_residuals_of_live_pinocchio_s() {
    for (file, locked) in ARMS {
        let (found, folder) = compare(file, locked, &moving());
        let script =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/pinocchio/least_squares.py");
        let python = python();
        let output = Command::new(python)
            .current_dir(folder.path())
            .arg(script)
            .arg(robot(file))
            .args([if locked.is_empty() { "-" } else { locked }, "first.csv", "second.csv"])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let theirs: Vec<f64> = serde_json::from_slice(&output.stdout).unwrap();
        let own = nrmse(&found, "least squares");
        assert_eq!(theirs.len(), own.len());
        for (own, theirs) in own.iter().zip(&theirs) {
            // The same window, central differences in place of its slope.
            assert!((own / theirs - 1.0).abs() < 0.02, "{file}: {own} {theirs}");
        }
    }
}

/// Every language holds what was identified, rotors included: read back, it predicts another motion as the
/// result does. Rotors of the first two joints, which no motion tells from their links, are in these where
/// readers pass rotors over.
#[test]
fn written_models_predict_as_their_result_does() {
    let folder_of = tempfile::tempdir().unwrap();
    let folder = folder_of.path();
    let model = seven_axes();
    let text = write::generated(&model, Language::Urdf).unwrap();
    std::fs::write(folder.join("nominal.urdf"), text).unwrap();
    let run = ArmRun { friction: [2.0, 4.0, 0.0], rotor: 0.3, rate_noise: 1e-4, ..ArmRun::default() };
    record(folder, &model, &run);
    let names = ["as_urdf.urdf", "as_xml.xml", "as_sdf.sdf"];
    for (k, name) in names.iter().enumerate() {
        let out = format!("first{k}");
        let list = "viscous,coulomb:0,rotor";
        let line = ["identify", "first.csv", "--model", "nominal.urdf", "--friction", list];
        let said = rigident(folder, &[&line[..], &["--out", &out, "--write-model", name]].concat());
        let has_table = folder.join(format!("{name}.joints.yaml")).exists();
        assert_eq!(has_table, k != 1, "{name}");
        assert_eq!(said.contains("are in <drake:rotor_inertia>"), k != 1, "{said}");
        assert_eq!(said.contains("rotors of l1_joint, l2_joint, which no motion tells"), k != 1, "{said}");
        let written = open(&folder.join(name));
        let rotor = |joint: &str| written.links[written.joint(joint).unwrap()].passive[0].armature;
        assert!((rotor("l5_joint") - 0.3).abs() < 0.03, "{}", rotor("l5_joint"));
        assert_eq!(rotor("l1_joint") == 0.0, k != 1);
    }
    let line = ["validate", "first0/result.json", names[0], names[1], names[2], "second.csv"];
    let found = rigident(folder, &[&line[..], &["--model", "nominal.urdf", "--json"]].concat());
    let found: Value = serde_json::from_str(&found).unwrap();
    let own = nrmse(&found, "first0");
    assert!(own.iter().all(|share| *share < 0.2), "{own:?}");
    for name in ["as_urdf", "as_xml", "as_sdf"] {
        for (own, read) in own.iter().zip(nrmse(&found, name)) {
            assert!((own - read).abs() < 1e-6, "{name}: {own} {read}");
        }
    }
}

/// Efforts by MuJoCo (`mj_inverse`), of files that state gravity, a total mass, a reference and a spring; of
/// an SDF before 1.5 by Pinocchio's of the same robot.
#[test]
#[ignore = "needs ../shared/cases"]
fn shared_cases_are_predicted_as_simulators_do() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/cases");
    for (model, recording) in [
        ("mjcf-predict-silent/gravity_opt.xml", "mjcf-predict-silent/gravity_opt.csv"),
        ("mjcf-predict-silent/settotalmass.xml", "mjcf-predict-silent/settotalmass.csv"),
        ("mjcf-predict-silent/ref.xml", "mjcf-predict-silent/ref.csv"),
        ("mjcf-predict-silent/stiff.xml", "mjcf-predict-silent/stiff.csv"),
        ("sdf14-axis/s_14_parentmodel.sdf", "sdf14-axis/s_14_parentmodel.csv"),
    ] {
        let line = [model, recording].map(|file| cases.join(file).display().to_string());
        let found: Value =
            serde_json::from_str(&rigident(&cases, &["validate", &line[0], &line[1], "--json"])).unwrap();
        for model in found["models"].as_array().unwrap() {
            let off = nrmse(&found, model.as_str().unwrap());
            assert!(off.iter().all(|share| *share < 2e-3), "{model}, {line:?}: {off:?}");
        }
    }
    for name in ["mjcf-gravcomp/i_gravcomp", "mjcf-predict-silent/gravcomp"] {
        let line = ["xml", "csv"].map(|ending| cases.join(format!("{name}.{ending}")).display().to_string());
        let said = rigident(&cases, &["predict", &line[0], &line[1]]);
        assert!(said.contains("gravcomp: MuJoCo carries that share of the weight of l2 (1)"), "{said}");
    }
}
