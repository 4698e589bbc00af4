//! `rigident calibrate joints` as a user types it.

use std::fs;
use std::path::Path;

use rigident::joint_offsets::{Noise, Pose, Setup};
use rigident::laboratory::standing::{
    Reading, contacts, csv, humanoid, random_offsets, random_poses, setup, squats,
};
use rigident::model::write::{generated, parse};
use rigident::model::xml::Language;
use serde_json::Value;

use crate::program::{complaint, json, rigident, said, status};

/// Files of a humanoid that stood in 40 poses, in a folder of their own.
pub struct Files {
    folder: tempfile::TempDir,
    /// The setup of the humanoid.
    pub setup: Setup,
    /// The poses.
    pub poses: Vec<Pose>,
    /// The true offsets.
    pub truth: Vec<f64>,
}

impl Files {
    /// Writes `robot.urdf`, `poses.csv` and `soles.toml`.
    pub fn new() -> Self {
        let truth = random_offsets(0.05, 21);
        let reading = Reading { encoder_rad: 0.05_f64.to_radians(), attitude_rad: 0.2_f64.to_radians() };
        Self::of(random_poses(40, &truth, reading, 22), truth)
    }

    /// Writes files of poses.
    pub fn of(poses: Vec<Pose>, truth: Vec<f64>) -> Self {
        let files =
            Self { folder: tempfile::tempdir().unwrap(), setup: setup(Noise::default()), poses, truth };
        files.write("robot.urdf", &generated(&humanoid(), Language::Urdf).unwrap());
        files.write("soles.toml", &contacts());
        files.write("poses.csv", &csv(&files.setup, &files.poses));
        files
    }

    /// Returns the paths of model, poses and soles.
    pub fn paths(&self) -> [String; 3] {
        ["robot.urdf", "poses.csv", "soles.toml"].map(|name| self.at().join(name).display().to_string())
    }

    /// Returns the folder.
    pub fn at(&self) -> &Path {
        self.folder.path()
    }

    /// Writes a file.
    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.at().join(name), text).unwrap();
    }

    /// Runs the command with more options.
    pub fn run(&self, more: &[&str]) -> std::process::Output {
        let words = ["calibrate", "joints", "robot.urdf", "poses.csv", "--contacts", "soles.toml"];
        rigident(self.at(), &[&words, more].concat())
    }

    /// Returns what is said after a file was changed.
    fn refused(&self, name: &str, change: impl Fn(&str) -> String) -> String {
        let text = fs::read_to_string(self.at().join(name)).unwrap();
        let changed = change(&text);
        assert_ne!(text, changed);
        self.write(name, &changed);
        let said = complaint(&self.run(&[]));
        self.write(name, &text);
        said
    }
}

/// Returns joints with value and U95, if they are identified.
pub fn offsets(found: &Value) -> Vec<(String, Option<[f64; 2]>)> {
    let of = |own: &Value| {
        let both = own["value"].as_f64().zip(own["u95"].as_f64()).map(|(value, u95)| [value, u95]);
        (own["joint"].as_str().unwrap().to_owned(), both)
    };
    found["offsets"].as_array().unwrap().iter().map(of).collect()
}

#[test]
fn offsets_are_found_written_and_gone_in_the_corrected_model() {
    let files = Files::new();
    let output = files.run(&["--json", "-o", "joints.rig.toml", "--write-model", "calibrated.urdf"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let found = json(&output);
    let all = offsets(&found);
    let inside = all.iter().zip(&files.truth).filter(|((_, own), truth)| {
        let [value, u95] = own.unwrap();
        (value - *truth).abs() <= u95
    });
    assert!(all.len() == 14 && inside.count() >= 11, "{all:?} {:?}", files.truth);
    assert_eq!(found["covariance"].as_array().unwrap().len(), 14);
    let over = found["over_poses"].as_array().unwrap();
    assert!(over.len() > 2 && over.last().unwrap()["identified"] == 14, "{over:?}");
    // The tables are those of a rig file, with the same numbers.
    let text = fs::read_to_string(files.at().join("joints.rig.toml")).unwrap();
    let rig: rigident::rig::RigFile = toml::from_str(&text).unwrap();
    assert_eq!(rig.joint.len(), 14);
    assert!(rig.joint.iter().all(|joint| joint.zero_std.is_some_and(|sd| sd > 0.0)));
    // With the corrected model nothing is left to be found.
    fs::rename(files.at().join("calibrated.urdf"), files.at().join("robot.urdf")).unwrap();
    let again = offsets(&json(&files.run(&["--json"])));
    assert!(again.iter().all(|(_, own)| own.unwrap()[0].abs() < 1e-8), "{again:?}");
    // Nothing is overwritten.
    assert!(complaint(&files.run(&["-o", "joints.rig.toml"])).contains("joints.rig.toml"));
}

#[test]
fn methods_agree_and_a_part_of_the_joints_can_be_asked_for() {
    let files = Files::new();
    let one = offsets(&json(&files.run(&["--json"])));
    let other = offsets(&json(&files.run(&["--json", "--method", "conjugate-gradient"])));
    for ((name, a), (_, b)) in one.iter().zip(&other) {
        assert!((a.unwrap()[0] - b.unwrap()[0]).abs().to_degrees() < 1e-6, "{name}");
    }
    // The offsets of the others are not zero: they are not to be left out.
    assert_eq!(status(&files.run(&["--joints", "left_knee_y,right_knee_y"])), 2);
    let mut truth = vec![0.0; 14];
    (truth[3], truth[10]) = (0.03, -0.02);
    let reading = Reading { encoder_rad: 0.05_f64.to_radians(), attitude_rad: 0.2_f64.to_radians() };
    let files = Files::of(random_poses(40, &truth, reading, 25), truth);
    let part = offsets(&json(&files.run(&["--json", "--joints", "left_knee_y,right_knee_y"])));
    let names: Vec<&str> = part.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["left_knee_y", "right_knee_y"]);
}

#[test]
fn squats_end_with_status_one_and_without_zeros() {
    let truth = random_offsets(0.03, 23);
    let reading = Reading { encoder_rad: 0.05_f64.to_radians(), attitude_rad: 0.2_f64.to_radians() };
    let files = Files::of(squats(12, &truth, reading, 24), truth);
    let output = files.run(&["-o", "joints.rig.toml"]);
    assert_eq!(status(&output), 1);
    let words = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(words.lines().any(|l| l.contains("left_hip_z") && l.contains("not identified")), "{words}");
    assert!(said(&output).contains("not determined by these poses: left_hip_z"), "{}", said(&output));
    let text = fs::read_to_string(files.at().join("joints.rig.toml")).unwrap();
    assert!(
        text.contains("# left_hip_z: not identified") && !text.contains("name = \"left_hip_z\""),
        "{text}"
    );
}

#[test]
fn a_page_shows_offsets_and_poses_before_and_after() {
    let mut files = Files::new();
    files.poses[9].positions[3] += 0.3;
    files.write("poses.csv", &csv(&files.setup, &files.poses));
    let output = files.run(&["--report", "joints.html"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let page = fs::read_to_string(files.at().join("joints.html")).unwrap();
    for word in
        ["14 of 14 offsets identified", "pose 10, left out", "left_knee_y", "heights ×", "slope of floor"]
    {
        assert!(page.contains(word), "{word}");
    }
    assert!(!page.contains("<script") && !page.contains("http"));
    assert!(complaint(&files.run(&["--report", "joints.html"])).contains("joints.html"));
}

#[test]
fn a_joint_that_stands_still_is_named() {
    let files = Files::new();
    let still = files.setup.tree.joint_name(files.setup.joints[4]).to_owned();
    // Poses that stand with the left shank not turned.
    let truth = files.truth.clone();
    let files = Files::of(still_poses(&files.setup, 4, &truth), truth);
    let output = files.run(&["--json"]);
    let found = json(&output);
    let own = found["offsets"].as_array().unwrap().iter().find(|own| own["joint"] == still).unwrap();
    assert!(own["moves_by"].as_f64().unwrap() < 0.01, "{own}");
    if own["value"].is_null() {
        assert!(own["why_not"].as_str().unwrap().contains("stands still"), "{own}");
    } else {
        let warnings = found["warnings"].as_array().unwrap();
        let names = |warning: &Value| warning.as_str().unwrap().contains(&format!("{still}: stands still"));
        assert!(warnings.iter().any(names), "{warnings:?}");
    }
}

/// Flat poses of the humanoid in which one joint does not move.
fn still_poses(setup: &Setup, joint: usize, truth: &[f64]) -> Vec<Pose> {
    crate::calibrate_joints_contacts::flat_poses(
        setup,
        40,
        truth,
        &|stance| stance.positions[joint + 1] = 0.0,
        &[joint + 1],
        [0.0; 2],
    )
}

#[test]
fn corners_may_be_sites_of_an_mjcf() {
    let files = Files::new();
    let text = generated(&humanoid(), Language::Mjcf).unwrap();
    let corners = [[0.13, 0.05], [0.13, -0.05], [-0.07, 0.05], [-0.07, -0.05]];
    let mut with_sites = text.clone();
    for side in ["left", "right"] {
        let body = format!("<body name=\"{side}_ankle_x_link\"");
        let at = with_sites.find(&body).unwrap();
        let end = at + with_sites[at..].find('>').unwrap() + 1;
        let sites: String = corners
            .iter()
            .enumerate()
            .map(|(k, [x, y])| format!("<site name=\"{side}{k}\" pos=\"{x} {y} -0.07\"/>"))
            .collect();
        with_sites.insert_str(end, &sites);
    }
    files.write("robot.xml", &with_sites);
    let soles: String = ["left", "right"]
        .iter()
        .map(|side| {
            format!(
                "[[sole]]\nname = \"{side}\"\nlink = \"{side}_ankle_x_link\"\ncorner_sites = \
                 [\"{side}0\", \"{side}1\", \"{side}2\", \"{side}3\"]\n"
            )
        })
        .collect();
    files.write("sites.toml", &soles);
    let words = ["calibrate", "joints", "robot.xml", "poses.csv", "--json", "--contacts"];
    let by_sites = offsets(&json(&rigident(files.at(), &[&words[..], &["sites.toml"]].concat())));
    let by_corners = offsets(&json(&rigident(files.at(), &[&words[..], &["soles.toml"]].concat())));
    for ((name, a), (_, b)) in by_sites.iter().zip(&by_corners) {
        assert!((a.unwrap()[0] - b.unwrap()[0]).abs() < 1e-12, "{name}");
    }
    files.write("sites.toml", &soles.replace("left3", "left9"));
    let said = complaint(&rigident(files.at(), &[&words[..], &["sites.toml"]].concat()));
    assert!(said.contains("no site left9") && said.contains("left3"), "{said}");
}

#[test]
fn a_bad_pose_is_named() {
    let mut files = Files::new();
    files.poses[9].positions[3] += 0.3;
    files.poses[9].name = "on a cable".to_owned();
    files.write("poses.csv", &csv(&files.setup, &files.poses));
    let output = files.run(&[]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    assert!(said(&output).contains("on a cable is left out"), "{}", said(&output));
}

#[test]
fn models_in_mjcf_are_taken_and_written() {
    let files = Files::new();
    files.write("robot.xml", &generated(&humanoid(), Language::Mjcf).unwrap());
    let words = ["calibrate", "joints", "robot.xml", "poses.csv", "--contacts", "soles.toml"];
    let output = rigident(files.at(), &[&words[..], &["--json", "--write-model", "new.xml"]].concat());
    assert_eq!(status(&output), 0, "{}", said(&output));
    let text = fs::read_to_string(files.at().join("new.xml")).unwrap();
    let written = parse(&text, "new.xml").unwrap().model;
    let [i, k] = [&written, &humanoid()].map(|model| model.joint("left_knee_y").unwrap());
    let turned = written.links[i].link.rotation - humanoid().links[k].link.rotation;
    let value = offsets(&json(&output))[3].1.unwrap()[0];
    assert!((turned.amax() - value.abs().sin()).abs() < 1e-6, "{turned} {value}");
}

#[test]
fn bad_input_is_said() {
    let files = Files::new();
    let with = |more: &[&str]| complaint(&files.run(more));
    assert!(with(&["--joints", "left_elbow"]).contains("no such joint"));
    assert!(with(&["--joints", "left_hip_z,left_hip_z"]).contains("given twice"));
    assert!(with(&["--height-noise-mm", "0"]).contains("--height-noise-mm 0"));
    assert!(with(&["--encoder-noise-deg", "-1"]).contains("--encoder-noise-deg -1"));
    assert!(with(&["--write-model", "a.txt"]).contains(".urdf"));

    let soles = |change: &dyn Fn(&str) -> String| files.refused("soles.toml", change);
    assert!(soles(&|_| "# none".to_owned()).contains("there is no [[sole]]"));
    assert!(soles(&|t| t.replace("left_ankle_x_link", "left_toe")).contains("no link left_toe"));
    assert!(soles(&|t| t.replace("0.13", "130.0")).contains("is it in mm?"));
    assert!(soles(&|t| t.replace("corners_m", "corners_mm")).contains("corners_mm"));
    assert!(soles(&|t| t.replace("\"right\"", "\"left\"")).contains("two soles are named left"));

    let poses = |change: &dyn Fn(&str) -> String| files.refused("poses.csv", change);
    let first = files.poses[0].positions[0].to_string();
    let w = files.poses[0].attitudes[0].w.to_string();
    assert!(poses(&|t| t.replace(&first, "NaN")).contains("line 2: left_hip_z_rad is \"NaN\""));
    assert!(poses(&|t| t.replace(&first, "")).contains("not a finite number"));
    assert!(poses(&|t| t.replace(&first, "31.5")).contains("is it in degrees?"));
    assert!(poses(&|t| t.replace(&w, "7.0")).contains("is no unit quaternion"));
    assert!(poses(&|t| t.replace("left_knee_y_rad", "left_knee_y_deg")).contains("has another unit"));
    assert!(poses(&|t| t.replace("left_knee_y_rad", "knee")).contains("column left_knee_y_rad is missing"));
    assert!(poses(&|t| t.replace("pelvis_qz", "other")).contains("column pelvis_qz is missing"));
    assert!(poses(&|t| t.replace("pelvis_q", "imu_q")).contains("has no link imu"));
    assert!(poses(&|t| t.replace("pelvis_q", "imu_")).contains("no link's attitude is measured"));
    assert!(poses(&|t| t.replacen("pose,", "contact,", 1)).contains("which is no contact"));
    assert!(poses(&|t| t.lines().next().unwrap().to_owned()).contains("no pose in it"));
    assert!(poses(&|t| t.lines().take(2).collect::<Vec<_>>().join("\n")).contains("too few poses"));
    assert!(poses(&|t| t.replace("pelvis_qw", "left_hip_z_rad")).contains("is there twice"));
}
