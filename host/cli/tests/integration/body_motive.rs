//! `rigident body identify` of a take that OptiTrack's Motive exported.

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use super::simulated_people::{Carried, Somebody, upright};

const BODY: Somebody = Somebody { height_m: 1.72, mass_kg: 68.0, skin_m: 0.01, plate_n: 1.0, held: None };

/// Returns the same markers as a CSV of Motive: labelled ones, a fragment, and a solved body beside them.
fn motive(trc: &str) -> String {
    let lines: Vec<Vec<&str>> = trc.lines().map(|line| line.split('\t').collect()).collect();
    let labels: Vec<&str> = lines[3][2..].iter().copied().filter(|label| !label.is_empty()).collect();
    let three = |of: &dyn Fn(&str) -> String| -> String {
        labels.iter().map(|label| format!(",{0},{0},{0}", of(label))).collect()
    };
    let mut csv = "Format Version,1.23,Take Name,squat,Capture Frame Rate,100.000000,Export Frame \
                   Rate,100.000000,Rotation Type,Quaternion,Length Units,Millimeters,Coordinate \
                   Space,Global\n\n"
        .to_owned();
    let _ = writeln!(csv, ",Type,Bone,Marker,Marker,Marker{}", three(&|_| "Marker".to_owned()));
    let names = three(&|label| format!("\"Somebody:{label}\""));
    let _ = writeln!(csv, ",Name,Hip,Unlabeled 3,Unlabeled 3,Unlabeled 3{names}");
    let _ = writeln!(csv, ",ID,9,1,1,1{}", three(&|label| format!("id {label}")));
    let _ = writeln!(csv, ",,Rotation,Position,Position,Position{}", three(&|_| "Position".to_owned()));
    let axes: String = labels.iter().map(|_| ",X,Y,Z").collect();
    let _ = writeln!(csv, "Frame,Time (Seconds),W,X,Y,Z{axes}");
    for cells in lines[5..].iter().filter(|cells| cells.len() > 2) {
        let frame: usize = cells[0].parse().unwrap();
        let _ = writeln!(csv, "{},{},1,7,,7,{}", frame - 1, cells[1], cells[2..].join(","));
    }
    csv
}

fn identified(folder: &Path, ending: &str) -> (Value, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
    let [motion, standing] = ["motion", "standing"].map(|name| format!("{name}.{ending}"));
    command.current_dir(folder).args(["body", "identify", &motion, "--static", &standing]);
    let output = command.args(["--height-m", "1.72", "--json", "--out", ending]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{said}");
    (serde_json::from_slice(&output.stdout).unwrap(), said)
}

#[test]
fn a_take_of_motive_gives_the_numbers_of_its_trc() {
    let folder = tempfile::tempdir().unwrap();
    // Squats of 35 cm.
    let squat = |t: f64| {
        let mut p = upright(&BODY);
        let u = 0.5 - 0.5 * (std::f64::consts::TAU * t / 2.5).cos();
        p.hip = [p.hip[0] - 0.15 * u, p.hip[1] - 0.35 * u];
        (p.trunk, p.pelvis, p.arms) = (0.7 * u, 0.4 * u, [0.9 * u; 2]);
        p
    };
    for (name, files) in [
        ("standing", BODY.recorded(1.0, &|_| upright(&BODY), &|_| Carried::Both)),
        ("motion", BODY.recorded(6.0, &squat, &|_| Carried::Both)),
    ] {
        let at = |ending: &str| folder.path().join(format!("{name}{ending}"));
        std::fs::write(at(".trc"), &files.trc).unwrap();
        std::fs::write(at(".csv"), motive(&files.trc)).unwrap();
        std::fs::write(at("_grf.mot"), &files.mot).unwrap();
    }
    let ((trc, _), (csv, _)) = (identified(folder.path(), "trc"), identified(folder.path(), "csv"));
    assert_eq!(csv["parameters"], trc["parameters"]);
    assert_eq!(csv["person"]["mass_kg"], trc["person"]["mass_kg"]);
    let mut markers = Command::new(env!("CARGO_BIN_EXE_rigident"));
    let output =
        markers.current_dir(folder.path()).args(["body", "markers", "motion.csv", "--json"]).output();
    let said = String::from_utf8(output.unwrap().stdout).unwrap();
    assert!(said.contains("1 fragments of markers without a name are left out"), "{said}");
    // Without forces it is named what is missing, and nothing else.
    std::fs::remove_file(folder.path().join("motion_grf.mot")).unwrap();
    let mut alone = Command::new(env!("CARGO_BIN_EXE_rigident"));
    let output = alone.current_dir(folder.path()).args(["body", "identify", "motion.csv"]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && said.contains("no forces of the ground"), "{said}");
}
