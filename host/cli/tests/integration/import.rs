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
fn units_missing_in_the_file_are_asked_for() {
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
fn a_look_names_missing_entries_and_writes_nothing() {
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

/// Files that nptdms and openpyxl wrote: proposed, read, and reported by `info`.
#[test]
fn workbooks_and_tdms_files_are_imported_and_reported() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/recording_table");
    let folder = tempfile::tempdir().unwrap();
    for (name, form) in [("waveform.tdms", "tdms"), ("openpyxl.xlsx", "xlsx")] {
        fs::copy(corpus.join(name), folder.path().join(name)).unwrap();
        let output = rigident(folder.path(), &["import", name, "--json"]);
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        let object: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let file = &object["files"][0];
        assert_eq!((&file["written"]["form"], &file["rows"]), (&form.into(), &40.into()), "{object}");
        assert_eq!(file["rate_hz"].as_f64().map(f64::round), Some(500.0));
        let read = Recording::load(&folder.path().join(name), None).unwrap();
        assert_eq!(read.wrench.unwrap()[3][0], 1234.618);
        let output = rigident(folder.path(), &["convert", name, &format!("{form}.csv")]);
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        let again = Recording::load(&folder.path().join(format!("{form}.csv")), None).unwrap();
        assert_eq!(again.wrench.unwrap()[3][0], 1234.618);
    }
}

#[test]
fn an_impossible_model_is_repaired_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = |izz: &str| {
        format!(
            "<?xml version='1.0'?>\n<robot name='r'><!-- kept --><link name='base'/><link \
             name='arm'><inertial><origin xyz='0.1 0 0.2'/><mass value='2'/><inertia ixx='0.1' iyy='0.1' \
             izz='{izz}' ixy='0' ixz='0' iyz='0'/></inertial></link><joint name='j' type='revolute'><parent \
             link='base'/><child link='arm'/><axis xyz='0 0 1'/><limit lower='-1' upper='1' effort='1' \
             velocity='1'/></joint></robot>\n"
        )
    };
    fs::write(folder.path().join("bad.urdf"), urdf("0.45")).unwrap();
    fs::write(folder.path().join("good.urdf"), urdf("0.15")).unwrap();
    let output = rigident(folder.path(), &["model", "repair", "bad.urdf", "--write", "new.urdf", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let object: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&object["written"], &object["repairs"][0]["link"]), (&"new.urdf".into(), &"arm".into()));
    let text = fs::read_to_string(folder.path().join("new.urdf")).unwrap();
    assert!(text.contains("<!-- kept -->"), "{text}");
    let again = rigident(folder.path(), &["model", "repair", "new.urdf", "--write", "newer.urdf"]);
    assert!(said(&again).contains("every inertia is possible; nothing is written"), "{}", said(&again));
    let good = rigident(folder.path(), &["model", "repair", "good.urdf", "--write", "newer.urdf"]);
    assert_eq!(good.status.code(), Some(0), "{}", said(&good));
    assert!(!folder.path().join("newer.urdf").exists());
    let taken = rigident(folder.path(), &["model", "repair", "bad.urdf", "--write", "good.urdf"]);
    assert_eq!(taken.status.code(), Some(2), "{}", said(&taken));
}

#[test]
fn markers_are_shown_with_their_places_and_missing_ones_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let names = "LASI RASI LPSI RPSI LTHI LKNE LTIB LANK LHEE LTOE RTHI RKNE RTIB RANK RHEE odd";
    let labels: Vec<&str> = names.split(' ').collect();
    let head = labels.iter().map(|name| format!("{name}\t\t")).collect::<Vec<_>>().join("\t");
    let axes = (1..=labels.len()).map(|k| format!("X{k}\tY{k}\tZ{k}")).collect::<Vec<_>>().join("\t");
    let row = |frame: usize| {
        let points = (0..labels.len()).map(|k| format!("{}.5\t{}.25\t3.5", 100 + k, 900 + frame));
        format!("{}\t{:.3}\t{}\n", frame + 1, 0.01 * frame as f64, points.collect::<Vec<_>>().join("\t"))
    };
    let text = format!(
        "PathFileType\t4\t(X/Y/Z)\twalk.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n100\t100\t20\t{}\tmm\t100\t1\t20\nFrame#\tTime\t{head}\n\t\t{axes}\n\n{}",
        labels.len(),
        (0..20).map(row).collect::<String>()
    );
    fs::write(folder.path().join("walk.trc"), text).unwrap();
    let output = rigident(folder.path(), &["body", "markers", "walk.trc"]);
    let words = said(&output);
    assert_eq!(output.status.code(), Some(1), "{words}");
    for part in [
        "LKNE: l_thigh, 0 mm forward, 56 mm left, 0 mm up of l_knee",
        "odd: not known",
        "Plug-in Gait: 15 of its 16 markers; RTOE missing",
        "torso: 0 of the 2 markers",
        "[marker.\"odd\"]",
    ] {
        assert!(words.contains(part), "{part}: {words}");
    }
    let output = rigident(folder.path(), &["body", "markers", "walk.trc", "--json"]);
    let object: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&object["set"], &object["unknown"][0]), (&"Plug-in Gait".into(), &"odd".into()));
    assert_eq!((&object["frames"], &object["segments"][0]), (&20.into(), &"pelvis".into()));
    // The page that plays them is written once.
    let page = ["body", "markers", "walk.trc", "--page", "walk.html"];
    assert_eq!(rigident(folder.path(), &page).status.code(), Some(1));
    let html = fs::read_to_string(folder.path().join("walk.html")).unwrap();
    assert!(html.contains(r#""marker_names":["LASI","#) && html.contains(r#"id="time""#));
    let again = rigident(folder.path(), &page);
    assert_eq!(again.status.code(), Some(2), "{}", said(&again));
}

/// The bracket's load cell and IMU in files of their own, the clock of the IMU 300 s ahead.
#[test]
fn a_look_at_two_loggers_gives_their_rig_file_and_sets_their_clocks() {
    let folder = tempfile::tempdir().unwrap();
    let bracket = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/bracket.csv");
    let text = fs::read_to_string(bracket).unwrap();
    let (mut force, mut imu) = (String::new(), String::new());
    for (n, row) in text.lines().enumerate() {
        let cells: Vec<&str> = row.split(',').collect();
        let time = if n == 0 {
            "t_s".to_owned()
        } else {
            format!("{:.3}", cells[0].parse::<f64>().unwrap() + 300.0)
        };
        force += &format!("{}\n", cells[..7].join(","));
        imu += &format!("{time},{}\n", cells[7..13].join(","));
    }
    fs::write(folder.path().join("force.csv"), force).unwrap();
    fs::write(folder.path().join("imu.csv"), imu).unwrap();
    let look = |words: &[&str]| -> serde_json::Value {
        let output = rigident(folder.path(), &[&["import", "--look"], words].concat());
        serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)))
    };
    let rig = look(&["force.csv", "imu.csv"])["rig"].as_str().unwrap().to_owned();
    let written =
        rigident(folder.path(), &["import", "force.csv", "imu.csv", "--to", "run.rig.toml", "--yes"]);
    assert_eq!(fs::read_to_string(folder.path().join("run.rig.toml")).unwrap(), rig, "{}", said(&written));
    let found = &look(&["run.rig.toml"])["files"][0];
    assert_eq!((&found["clock_of"], &found["error"]), (&"force.csv".into(), &serde_json::Value::Null));
    let [force, imu] = [0, 1].map(|k| &found["streams"][k]);
    assert!(force["clock"].is_null() && force["from_s"] == 0.0, "{force}");
    // A sample of 100 Hz is 10 ms long.
    let [from, offset] = [&imu["from_s"], &imu["clock"]["offset_s"]].map(|v| v.as_f64().unwrap());
    assert!(from.abs() < 5e-3 && (offset + 300.0).abs() < 0.1, "{from} {offset}");
    assert!(imu["curve"]["points"].as_array().unwrap().len() > 100);
    assert!(
        found["warnings"][0].as_str().unwrap().contains("the clock of imu.csv is not that of the wrench")
    );
    assert!(found["recording"]["rows"].as_u64().unwrap() > 900, "{}", found["recording"]);
    // A choice of a column that no file has is refused.
    let refused =
        rigident(folder.path(), &["import", "--look", "force.csv", "imu.csv", "--column", "t_s=time"]);
    assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
}
