//! Trials that cannot be used, or are not what they are said to be: each is refused in words that say what,
//! where and what to do.

use std::path::{Path, PathBuf};
use std::process::Command;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name)
}

/// The walk on a treadmill, as text: markers and forces.
fn walk() -> (String, String) {
    let read =
        |name: &str| std::fs::read_to_string(data("human_gait2354_subject01_walk").join(name)).unwrap();
    (read("subject01_walk1.trc"), read("subject01_walk1_grf.mot"))
}

/// The walk over three plates.
fn c3d() -> Vec<u8> {
    std::fs::read(data("human_btk_pig_60kg_functional/FunctionalWalk.c3d")).unwrap()
}

/// Runs `body identify` in a folder; exit status and what was said on standard error or, with an answer, on
/// output.
fn identify(folder: &Path, line: &[&str]) -> (i32, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
    let output = command.current_dir(folder).args(["body", "identify"]).args(line).output().unwrap();
    let said = [output.stderr, output.stdout].concat();
    (output.status.code().unwrap(), String::from_utf8_lossy(&said).into_owned())
}

/// Changes the cells of the frames of a table: line by line, the first `header` lines left alone.
fn cells(text: &str, header: usize, change: impl Fn(usize, f64) -> f64) -> String {
    let line = |(k, line): (usize, &str)| {
        if k < header {
            return line.to_owned();
        }
        let own = line.split('\t').enumerate().map(|(c, cell)| match cell.trim().parse::<f64>() {
            Ok(value) => change(c, value).to_string(),
            Err(_) => cell.to_owned(),
        });
        own.collect::<Vec<_>>().join("\t")
    };
    text.lines().enumerate().map(line).collect::<Vec<_>>().join("\n")
}

/// Lines of the header of a MOT file, its names of columns among them.
fn mot_header(text: &str) -> usize {
    text.lines().position(|line| line.trim() == "endheader").unwrap() + 2
}

/// Renames markers, of which a TRC file has the names in its fourth line.
fn rename(trc: &str, change: impl Fn(&str) -> String) -> String {
    let line = |(k, line): (usize, &str)| {
        if k == 3 { line.split('\t').map(&change).collect::<Vec<_>>().join("\t") } else { line.to_owned() }
    };
    trc.lines().enumerate().map(line).collect::<Vec<_>>().join("\n")
}

/// Left for right in a name.
fn other_side(name: &str) -> String {
    match name.split_once('.') {
        Some(("R", rest)) => format!("L.{rest}"),
        Some(("L", rest)) => format!("R.{rest}"),
        _ => name.to_owned(),
    }
}

/// Returns where the data of a parameter of a C3D file begin, which holds floating numbers or text.
fn parameter(bytes: &[u8], name: &str) -> usize {
    let at = (512..bytes.len()).find(|k| bytes[*k..].starts_with(name.as_bytes())).unwrap() + name.len();
    // Offset to the next, type, number of dimensions, dimensions.
    at + 4 + usize::from(bytes[at + 3])
}

/// Changes the floating numbers of a parameter.
fn floats(bytes: &mut [u8], name: &str, count: usize, change: impl Fn(usize, f32) -> f32) {
    let at = parameter(bytes, name);
    for k in 0..count {
        let own = &mut bytes[at + 4 * k..at + 4 * k + 4];
        let value = change(k, f32::from_le_bytes([own[0], own[1], own[2], own[3]]));
        own.copy_from_slice(&value.to_le_bytes());
    }
}

/// Writes a treadmill walk and says what becomes of it.
fn treadmill(trc: &str, mot: Option<&str>, more: &[&str]) -> (i32, String) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("walk.trc"), trc).unwrap();
    if let Some(mot) = mot {
        std::fs::write(folder.path().join("walk_grf.mot"), mot).unwrap();
    }
    let standing = data("human_gait2354_subject01_walk/subject01_static.trc");
    let mut line = vec!["walk.trc", "--out", "out"];
    if !more.contains(&"--alone") {
        line.extend(["--static", standing.to_str().unwrap()]);
    }
    line.extend(more.iter().filter(|word| **word != "--alone"));
    identify(folder.path(), &line)
}

/// Writes a walk over plates and says what becomes of it.
fn plates(bytes: &[u8]) -> (i32, String) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("walk.c3d"), bytes).unwrap();
    identify(folder.path(), &["walk.c3d", "--out", "out"])
}

#[track_caller]
fn refused((status, said): (i32, String), code: i32, words: &[&str]) {
    assert_eq!(status, code, "{said}");
    for word in words {
        assert!(said.contains(word), "{word:?} is not in: {said}");
    }
    assert!(!said.contains("panicked"), "{said}");
}

#[test]
#[ignore = "needs ../shared/data"]
fn markers_of_shared_data_that_cannot_be_are_named() {
    let (trc, mot) = walk();
    let mot = Some(mot.as_str());
    // Names that nobody knows.
    let unknown =
        rename(&trc, |name| if name.contains('.') { name.replace('.', "_x") } else { name.to_owned() });
    refused(treadmill(&unknown, mot, &["--alone"]), 2, &["names that are known", "R_xASIS", "--markers"]);
    // All sides exchanged, then a pair of them.
    refused(
        treadmill(&rename(&trc, other_side), mot, &["--alone"]),
        2,
        &["left and right are exchanged", "all markers"],
    );
    let pair = rename(&trc, |name| if name.ends_with("Heel") { other_side(name) } else { name.to_owned() });
    refused(treadmill(&pair, mot, &[]), 2, &["R.Heel", "L.Heel", "are exchanged"]);
    // Another unit.
    let metres = trc.replacen("\tmm\t", "\tm\t", 1);
    refused(treadmill(&metres, mot, &["--alone"]), 2, &["m tall", "Units"]);
    // A rate that the times contradict, and a file that is cut off.
    let rate = trc.replacen("60.00\t60.00", "120.00\t120.00", 1);
    refused(treadmill(&rate, mot, &[]), 2, &["by 120 frames a second"]);
    let cut: Vec<&str> = trc.lines().take(60).collect();
    refused(treadmill(&cut.join("\n"), mot, &[]), 2, &["cut off"]);
    // No marker is ever seen.
    let blind = cells(&trc, 5, |c, value| if c < 2 { value } else { f64::NAN });
    refused(treadmill(&blind, mot, &["--alone"]), 2, &["0 of 41 markers"]);
}

#[test]
#[ignore = "needs ../shared/data"]
fn forces_of_shared_data_that_cannot_be_are_named() {
    let (trc, mot) = walk();
    let header = mot_header(&mot);
    // Nobody measured them.
    refused(treadmill(&trc, None, &[]), 2, &["no forces of the ground", "--ground"]);
    // The action on the ground, of both belts and of one.
    let force = |c: usize| (1..=3).contains(&c) || (7..=9).contains(&c);
    let all = cells(&mot, header, |c, value| if force(c) { -value } else { value });
    refused(treadmill(&trc, Some(&all), &[]), 2, &["wrong sign", "reaction on the person"]);
    let one = cells(&mot, header, |c, value| if (1..=3).contains(&c) { -value } else { value });
    refused(treadmill(&trc, Some(&one), &[]), 2, &["against the others", "wrong sign"]);
    // A laboratory with its origin elsewhere.
    let elsewhere = cells(&mot, header, |c, value| if c == 6 || c == 12 { value + 1.0 } else { value });
    refused(treadmill(&trc, Some(&elsewhere), &[]), 2, &["another frame than the markers"]);
    // Other times, another trial, fewer rows than the header says, a column that is missing.
    let later = cells(&mot, header, |c, value| if c == 0 { value + 10.0 } else { value });
    refused(treadmill(&trc, Some(&later), &[]), 2, &["the plates recorded nothing"]);
    let slower = cells(&mot, header, |c, value| if c == 0 { value * 1.6 } else { value });
    let (status, said) = treadmill(&trc, Some(&slower), &[]);
    assert!(status == 2 && (said.contains("do not follow") || said.contains("another frame")), "{said}");
    let cut: Vec<&str> = mot.lines().take(700).collect();
    refused(treadmill(&trc, Some(&cut.join("\n")), &[]), 2, &["cut off"]);
    let missing = mot.replacen("1_ground_force_px", "1_ground_force_qx", 1);
    refused(treadmill(&trc, Some(&missing), &[]), 2, &["1_ground_force_px is missing"]);
    // The belts exchanged, and only their centres of pressure.
    let names = mot.lines().nth(header - 1).unwrap();
    let exchanged = |which: &str| {
        let swap = |name: &str| match name.strip_prefix("1_") {
            Some(rest) if rest.contains(which) => rest.to_owned(),
            None if name.contains(which) => format!("1_{name}"),
            _ => name.to_owned(),
        };
        let own: Vec<String> = names.split('\t').map(|name| swap(name.trim())).collect();
        mot.replacen(names, &own.join("\t"), 1)
    };
    for which in ["ground_force_p", "ground_"] {
        let words = ["on one foot", "the foot that is in the air", "exchanged"];
        if which == "ground_" {
            // Both plates with all their columns are the same plates.
            assert_eq!(treadmill(&trc, Some(&exchanged(which)), &["--height-m", "1.8"]).0, 0);
        } else {
            refused(treadmill(&trc, Some(&exchanged(which)), &[]), 2, &words);
        }
    }
    // Columns of both belts under one name.
    let twice = mot.replace("1_ground", "ground");
    refused(treadmill(&trc, Some(&twice), &[]), 2, &["two columns are called ground_force_vx"]);
    // Horizontal axes flipped, and exchanged.
    for (axis, own) in [("along x", [1, 7]), ("along y", [3, 9])] {
        let flipped = cells(&mot, header, |c, value| if own.contains(&c) { -value } else { value });
        refused(treadmill(&trc, Some(&flipped), &[]), 2, &[axis, "push against the motion"]);
    }
    // Kilograms-force.
    let kgf = cells(&mot, header, |c, value| if force(c) || c > 12 { value / 9.80665 } else { value });
    refused(treadmill(&trc, Some(&kgf), &["--height-m", "1.8"]), 2, &["forces in newtons"]);
    // Cameras that were blind for three frames: these are dropped.
    let first = trc.lines().count() - 60;
    let blind: Vec<String> = trc
        .lines()
        .enumerate()
        .map(|(k, line)| match (first..first + 3).contains(&k) {
            true => line
                .split('\t')
                .enumerate()
                .map(|(c, v)| if c < 2 { v } else { "" })
                .collect::<Vec<_>>()
                .join("\t"),
            false => line.to_owned(),
        })
        .collect();
    let (status, said) = treadmill(&blind.join("\n"), Some(&mot), &["--height-m", "1.8"]);
    assert!(status == 0 && said.contains("Whole mass"), "{said}");
    // A mass that the plates contradict.
    refused(treadmill(&trc, Some(&mot), &["--mass-kg", "90"]), 1, &["--mass-kg 90 contradicts the plates"]);
}

#[test]
#[ignore = "needs ../shared/data"]
fn plates_of_shared_data_that_cannot_be_are_named() {
    let bytes = c3d();
    refused(plates(&bytes[..bytes.len() / 2]), 2, &["cut off"]);
    // No description, though the channels are there.
    let mut nameless = bytes.clone();
    let at = (512..bytes.len()).find(|k| bytes[*k..].starts_with(b"FORCE_PLATFORM")).unwrap();
    nameless[at..at + 14].copy_from_slice(b"FORCE_PLATTERS");
    refused(plates(&nameless), 2, &["no description of force plates", "FORCE_PLATFORM"]);
    // Corners of another laboratory: a metre further to the left.
    let mut moved = bytes.clone();
    floats(&mut moved, "CORNERS", 36, |k, value| if k % 3 == 1 { value + 1500.0 } else { value });
    refused(plates(&moved), 2, &["another frame than the markers"]);
    // Corners that nobody filled in, and corners that are no rectangle's.
    let mut empty = bytes.clone();
    floats(&mut empty, "CORNERS", 36, |_, _| 0.0);
    refused(plates(&empty), 2, &["has no corners in FORCE_PLATFORM", "forces between person and ground"]);
    let mut line = bytes.clone();
    floats(&mut line, "CORNERS", 36, |k, value| if k % 3 == 0 { value } else { 0.0 });
    refused(plates(&line), 2, &["corners", "rectangle"]);
    // More links than the firmware takes.
    let folder = tempfile::tempdir().unwrap();
    let files = ["PiG_Motion-FlatFoot-Full.c3d", "PiG_Calibration-FlatFoot-Full.c3d"];
    let [walk, standing] = files.map(|f| data("human_btk_pig_47kg_fullbody").join(f).display().to_string());
    let line = [&walk, "--static", &standing, "--model", "human58", "--mcu", "inproc", "--out", "out"];
    refused(identify(folder.path(), &line), 2, &["--mcu", "links", "leave --mcu out"]);
    assert!(!folder.path().join("out").exists());
    // Millimetres that are said to be metres.
    let mut metres = bytes;
    let at = parameter(&metres, "UNITS");
    metres[at..at + 2].copy_from_slice(b"m ");
    refused(plates(&metres), 2, &["m tall"]);
}

#[test]
fn files_without_a_trial_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("walk.csv"), "t,fx\n0,1\n").unwrap();
    std::fs::write(folder.path().join("text.c3d"), "this is no C3D file").unwrap();
    std::fs::write(folder.path().join("walk.tsv"), "t,fx\n0,1\n").unwrap();
    refused(identify(folder.path(), &["walk.tsv"]), 2, &["walk.tsv is no trial by its name", ".c3d, .trc"]);
    refused(identify(folder.path(), &["walk.csv"]), 2, &["walk.csv", "OptiTrack's Motive", ".c3d or .trc"]);
    refused(identify(folder.path(), &["text.c3d"]), 2, &["text.c3d", "C3D"]);
    refused(identify(folder.path(), &["none.c3d"]), 2, &["none.c3d cannot be read"]);
    refused(identify(folder.path(), &["none.c3d", "--mass-kg", "-3"]), 2, &["--mass-kg -3"]);
    refused(identify(folder.path(), &["none.c3d", "--parts", "0"]), 2, &["--parts", "1 to 100, or strides"]);
    refused(
        identify(folder.path(), &["none.c3d", "--write-model", "she.osim"]),
        2,
        &["she.osim", "--osim FILE"],
    );
}

#[test]
#[ignore = "needs ../shared/data"]
fn opensim_models_that_are_no_persons_of_shared_data_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let gait = |file: &str| data(&format!("human_gait2354_subject01_walk/{file}")).display().to_string();
    let with = |text: &str, more: &[&str]| {
        std::fs::write(folder.path().join("her.osim"), text).unwrap();
        let (trial, standing) = (gait("subject01_walk1.trc"), gait("subject01_static.trc"));
        let line = [&[trial.as_str(), "--static", &standing, "--osim", "her.osim"], more].concat();
        let said = identify(folder.path(), &line);
        assert!(!folder.path().join("new.osim").exists());
        said
    };
    let own = std::fs::read_to_string(data("human_gait2354_subject01_walk/subject01.osim")).unwrap();
    let write: &[&str] = &["--write-model", "new.osim"];
    refused(with(&own[..own.len() / 2], &[]), 2, &["her.osim", "no XML"]);
    refused(with("<robot/>", &[]), 2, &["her.osim", "no model of OpenSim's"]);
    refused(
        with(&own.replacen("11.37517129", "eleven", 1), &[]),
        2,
        &["mass of Body pelvis", "no finite numbers"],
    );
    refused(with(&own.replace("femur_r", "bone_r"), write), 2, &["no body femur_r", "--osim"]);
    // Of another person, and in millimetres: the ankles.
    let ankle = own.lines().find(|l| l.contains("location_in_parent") && l.contains("-0.42")).unwrap().trim();
    let lower = ankle.replace("-0.42", "-0.52");
    refused(with(&own.replace(ankle, &lower), &[]), 2, &["shank of --osim is 0.52", "scaled to this person"]);
    let far = ankle.replace("-0.42", "-42");
    refused(with(&own.replace(ankle, &far), &[]), 2, &["shank of --osim is 42", "in metres"]);
    // Of another person who is about as tall, and of a taller one.
    let other = std::fs::read_to_string(data("human_rajagopal2016_walk/subject_walk_scaled.osim")).unwrap();
    let (status, said) = with(&other, &["--height-m", "1.8"]);
    assert!(status == 0 && said.contains("lengths by --osim, and with the markers"), "{said}");
    let small = data("human_btk_pig_47kg_fullbody/PiG_Motion-FlatFoot-Full.c3d").display().to_string();
    let standing =
        data("human_btk_pig_47kg_fullbody/PiG_Calibration-FlatFoot-Full.c3d").display().to_string();
    let tall = gait("subject01.osim");
    let line = [&small, "--static", &standing, "--height-m", "1.505", "--osim", &tall];
    refused(identify(folder.path(), &line), 2, &["thigh of --osim is 0.454", "scaled to this person"]);
}

#[test]
#[ignore = "needs ../shared/data"]
fn trials_of_two_persons_of_shared_data_are_distinguished() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| data(name).display().to_string();
    let one = file("human_btk_pig_60kg_functional/FunctionalWalk.c3d");
    let other = file("human_btk_pig_47kg_fullbody/PiG_Motion-FlatFoot-Full.c3d");
    let standing = file("human_btk_pig_47kg_fullbody/PiG_Calibration-FlatFoot-Full.c3d");
    let off = &["mm off the model", "another person"];
    refused(identify(folder.path(), &[&one, &other]), 2, off);
    refused(identify(folder.path(), &[&one, "--static", &standing]), 2, off);
    refused(identify(folder.path(), &[&one, &one]), 2, &["is in it twice"]);
    // Two markers of one name, and a text that begins with a byte order mark.
    let (trc, mot) = walk();
    refused(
        treadmill(&trc.replace("L.ASIS", "R.ASIS"), Some(&mot), &[]),
        2,
        &["two markers are called R.ASIS"],
    );
    let (status, said) = treadmill(&format!("\u{feff}{trc}"), Some(&mot), &[]);
    assert!(status == 0 && said.contains("Whole mass"), "{said}");
}

#[test]
#[ignore = "needs ../shared/data"]
fn trials_of_shared_data_with_two_masses_contradict_each_other() {
    let (trc, mot) = walk();
    let header = mot_header(&mot);
    let force = |c: usize| (1..=3).contains(&c) || (7..=9).contains(&c) || c > 12;
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, mot: &str| {
        std::fs::write(folder.path().join(format!("{name}.trc")), &trc).unwrap();
        std::fs::write(folder.path().join(format!("{name}_grf.mot")), mot).unwrap();
    };
    write("one", &mot);
    write("other", &cells(&mot, header, |c, value| if force(c) { 1.05 * value } else { value }));
    let line = ["one.trc", "other.trc", "--height-m", "1.8", "--out", "out"];
    let words = ["contradict each other", "one says 72", "other says 7"];
    refused(identify(folder.path(), &line), 1, &words);
}

/// Runs a trial that was altered, in words that it must say, or, with none, that it must not.
#[track_caller]
fn said_of_plates((status, said): (i32, String), code: i32, words: &[&str]) {
    if words.is_empty() {
        let doubts = ["not where the file has it", "check the scales", "drifts", "contradict each other"];
        assert!(doubts.iter().all(|word| !said.contains(word)), "{said}");
    }
    refused((status, said), code, words);
}

#[test]
#[ignore = "needs ../shared/data"]
fn plates_of_shared_data_that_are_not_where_the_file_has_them_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let standing = data("human_btk_pig_60kg_functional/FunctionalStatic.c3d").display().to_string();
    let over_plates = |bytes: &[u8]| {
        std::fs::write(folder.path().join("walk.c3d"), bytes).unwrap();
        let line = ["walk.c3d", "--static", &standing, "--height-m", "1.68", "--out", "out"];
        let said = identify(folder.path(), &line);
        std::fs::remove_dir_all(folder.path().join("out")).unwrap();
        said
    };
    said_of_plates(over_plates(&c3d()), 0, &[]);
    // Across the way, which is x: 6 cm of all plates, and of the first.
    let across = |count: usize, by_mm: f32| {
        let mut bytes = c3d();
        floats(&mut bytes, "CORNERS", count, |k, value| if k % 3 == 1 { value + by_mm } else { value });
        over_plates(&bytes)
    };
    said_of_plates(across(36, 60.0), 0, &["plate 2: by feet", "along y", "CORNERS"]);
    said_of_plates(across(36, -60.0), 0, &["plate 3: by feet", "along y"]);
    said_of_plates(across(12, 60.0), 0, &["plate 1: by feet", "along y"]);
    // Along the way a foot tells less.
    let mut back = c3d();
    floats(&mut back, "CORNERS", 36, |k, value| if k % 3 == 0 { value - 80.0 } else { value });
    said_of_plates(over_plates(&back), 0, &["plate 1: by feet", "along x"]);
    // Centres of pressure of a treadmill, 3 cm to the right.
    let (trc, mot) = walk();
    let right = |c: usize, value: f64| if c == 6 || c == 12 { value + 0.03 } else { value };
    let moved = cells(&mot, mot_header(&mot), right);
    said_of_plates(treadmill(&trc, Some(&moved), &["--height-m", "1.8"]), 0, &["1_ground_force: by feet"]);
    said_of_plates(treadmill(&trc, Some(&mot), &["--height-m", "1.8"]), 0, &[]);
}

#[test]
#[ignore = "needs ../shared/data"]
fn plates_of_shared_data_with_another_scale_or_a_zero_that_drifts_are_reported() {
    let (trc, mot) = walk();
    let header = mot_header(&mot);
    // One belt of two.
    let own = |c: usize| (1..=3).contains(&c) || (13..=15).contains(&c);
    let scaled = cells(&mot, header, |c, value| if own(c) { 1.1 * value } else { value });
    let words = ["ground_force reads 1.1", "times what 1_ground_force does", "check the scales"];
    said_of_plates(treadmill(&trc, Some(&scaled), &["--height-m", "1.8"]), 1, &words);
    // The first of three plates: its channels are the first six of ANALOG:SCALE.
    let mut bytes = c3d();
    floats(&mut bytes, "\u{5}\u{4}SCALE", 6, |_, value| 1.1 * value);
    said_of_plates(plates(&bytes), 1, &["plate 1 reads 1.", "times what plate 2 does"]);
    said_of_plates(plates(&c3d()), 0, &[]);
    // A zero that moves by 20 N in two seconds.
    let rows = mot.lines().count() - header;
    let drifts = |(k, line): (usize, &str)| {
        let mut own: Vec<String> = line.split('\t').map(str::to_owned).collect();
        if k >= header {
            let force: f64 = own[2].trim().parse().unwrap();
            own[2] = (force + 20.0 * (k - header) as f64 / rows as f64).to_string();
        }
        own.join("\t")
    };
    let moved: Vec<String> = mot.lines().enumerate().map(drifts).collect();
    let said = treadmill(&trc, Some(&moved.join("\n")), &["--height-m", "1.8"]);
    said_of_plates((0, said.1), 0, &["ground_force: its zero drifts by"]);
}
