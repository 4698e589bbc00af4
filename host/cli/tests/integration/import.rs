//! `rigident import`: what it understands of files of other programs, and the rig file it writes.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use rigident::recording::Recording;
use rigident::rig::{RigFile, WrenchSign};

const CASES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/cases/exports/");

fn rigident(folder: &Path, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
    command.args(words).current_dir(folder).stdin(Stdio::null()).output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

#[test]
#[ignore = "needs ../shared/cases"]
fn shared_cases_are_read_as_proposed_and_nothing_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["Messung_01.csv", "messung_02.lvm", "ati_log.csv", "imu_logger.csv"] {
        let bytes = fs::read(format!("{CASES}{name}")).unwrap();
        fs::write(at(name), &bytes).unwrap();
        let before = Recording::load(&at(name), None).unwrap();
        let output = rigident(folder.path(), &["import", name, "--sign", "on-sensor"]);
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        let rig = at(name).with_extension("rig.toml");
        let file = RigFile::load(&rig).unwrap();
        let has_wrench = before.wrench.is_some();
        assert_eq!(file.recording.wrench_sign == WrenchSign::OnSensor, has_wrench, "{name}");
        let after = Recording::load(&at(name), None).unwrap();
        let turned = |w: &[f64; 6]| w.map(|v| -v);
        let known: Option<Vec<[f64; 6]>> = before.wrench.as_ref().map(|w| w.iter().map(turned).collect());
        assert_eq!((after.wrench, after.imus, after.time_ns), (known, before.imus, before.time_ns), "{name}");
        assert_eq!((before.assumed.is_some(), after.assumed), (true, None), "{name}");
        assert_eq!(fs::read(at(name)).unwrap(), bytes, "{name}");
        let again = rigident(folder.path(), &["import", name]);
        assert_eq!(again.status.code(), Some(2));
        assert!(said(&again).contains("is there already"), "{}", said(&again));
    }
    // Two loggers are one recording of two clocks.
    let both = ["import", "Messung_01.csv", "imu_logger.csv", "--to", "run.rig.toml", "--json"];
    let output = rigident(folder.path(), &both);
    let object: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(object["files"][0]["written"]["encoding"], "windows-1252");
    assert_eq!(object["files"][0]["written"]["numbers"], "decimal comma");
    assert_eq!(object["files"][1]["columns"][2]["column"], "imu_ax_mps2");
    assert_eq!(object["files"][1]["rate_hz"], 400.0);
    let rig = RigFile::load(&at("run.rig.toml")).unwrap();
    assert_eq!(
        rig.stream.iter().map(|s| s.file.as_str()).collect::<Vec<_>>(),
        ["Messung_01.csv", "imu_logger.csv"]
    );
}

#[test]
fn what_the_file_does_not_say_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let names = "when;Fx;Fy;Fz;Mx;My;Mz\n";
    let row = |k: usize| format!("{};1,5;2,5;3,5;0,1;0,2;0,{k:02}\n", 2 * k);
    let text = names.to_owned() + &(0..30).map(row).collect::<String>();
    fs::write(folder.path().join("a.csv"), text).unwrap();
    let output = rigident(folder.path(), &["import", "a.csv"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        said(&output).contains("the unit of Fx, Fy, Fz, Mx, My, Mz is written nowhere"),
        "{}",
        said(&output)
    );
    let mut words = vec!["import", "a.csv", "--column", "t_s=when:ms"];
    for unit in ["Fx=kgf", "Fy=kgf", "Fz=kgf", "Mx=N mm", "My=N mm", "Mz=N mm"] {
        words.extend(["--unit", unit]);
    }
    let output = rigident(folder.path(), &words);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let read = Recording::load(&folder.path().join("a.csv"), None).unwrap();
    assert_eq!(
        read.wrench.unwrap()[0],
        [1.5 * 9.80665, 2.5 * 9.80665, 3.5 * 9.80665, 0.1 * 1e-3, 0.2 * 1e-3, 0.0]
    );
    assert_eq!(read.rate_hz, Some(500.0));
}

#[test]
fn a_look_says_what_is_missing_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..50).map(|k| format!("{};1,5;2;19,6;0;0;{},25\n", k * 10, k % 3)).collect();
    fs::write(folder.path().join("a.csv"), format!("Zeit;Fx;Fy;Fz;Mx;My;Mz\n{rows}")).unwrap();
    let look = |more: &[&str]| {
        let words = [&["import", "--look", "a.csv"], more].concat();
        let output = rigident(folder.path(), &words);
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        let mut object: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        object["files"][0].take()
    };
    let first = look(&[]);
    assert_eq!(first["written"]["separator"], "semicolon", "{first}");
    assert!(first["missing_units"].as_array().unwrap().contains(&"Fx".into()), "{first}");
    assert!(first["recording"].is_null() && first["error"].is_string(), "{first}");
    let units: Vec<String> = ["Zeit=ms", "Fx=N", "Fy=N", "Fz=N", "Mx=N m", "My=N m", "Mz=N m"]
        .iter()
        .flat_map(|unit| ["--unit".to_owned(), (*unit).to_owned()])
        .collect();
    let units: Vec<&str> = units.iter().map(String::as_str).collect();
    let found = look(&units);
    assert!(found["error"].is_null(), "{found}");
    assert_eq!((&found["recording"]["rows"], &found["recording"]["rate_hz"]), (&50.into(), &100.0.into()));
    let rig = found["rig"].as_str().unwrap();
    assert!(RigFile::parse(rig).unwrap().recording.columns.contains_key("fz_n"), "{rig}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is written");
    // With the rig file beside it nothing is asked.
    fs::write(folder.path().join("a.rig.toml"), rig).unwrap();
    let beside = look(&[]);
    assert_eq!((&beside["rig_file"], &beside["recording"]["rows"]), (&"a.rig.toml".into(), &50.into()));
}
