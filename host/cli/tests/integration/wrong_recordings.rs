//! Recordings with one gross fault each, as a user makes them: each is named for what it is.
#![cfg(feature = "simulator")]

use std::fs;
use std::path::Path;

use crate::program::{json, rigident, said, status};

/// The demonstration's recording as CSV, and the text of its rig file.
fn recording(at: &Path) -> String {
    let demo = rigident(at, &["demo", "--duration-s", "20", "--json", "--out", "d"]);
    assert_eq!(demo.status.code(), Some(0), "{}", said(&demo));
    let converted = rigident(at, &["convert", "d/demo.mcap", "a.csv"]);
    assert_eq!(converted.status.code(), Some(0), "{}", said(&converted));
    fs::read_to_string(at.join("a.rig.toml")).unwrap()
}

#[test]
fn one_wrong_line_in_the_rig_file_is_named_and_nothing_gets_a_number() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let rig = recording(at);
    let identify = |name: &str, text: &str| {
        assert_ne!(text, rig);
        fs::write(at.join(name), text).unwrap();
        rigident(at, &["identify", "a.csv", "--rig", name, "--json", "--out", &format!("{name}.out")])
    };

    let sign = identify("sign.toml", &rig.replace("\"on_body\"", "\"on_sensor\""));
    assert_eq!(sign.status.code(), Some(1), "{}", said(&sign));
    let result = json(&sign);
    assert!(result["parameters"].as_array().unwrap().iter().all(|p| p["state"] == "not_identified"));
    assert!(
        result["cause"]["what"].as_str().unwrap().contains("the sign of the other body"),
        "{}",
        result["cause"]
    );
    assert!(result["notes"].to_string().contains("the mass comes out negative: is wrench_sign right?"));
    // It was turned about every axis: there is nothing to advise.
    assert!(
        result.get("advice").is_none_or(|a| a.as_array().is_some_and(Vec::is_empty)),
        "{}",
        result["advice"]
    );

    let scaled = |scale: f64| {
        let column = |k| format!("imu_a{k}_mps2 = {{ name = \"imu_a{k}_mps2\", scale = {scale:?} }}");
        let columns = format!("[recording]\ncolumns = {{ {} }}", ["x", "y", "z"].map(column).join(", "));
        rig.replace("[recording]", &columns)
    };
    for (name, text, words) in [
        ("g.toml", scaled(1.0 / 9.80665), "looks like g"),
        ("still.toml", rig.replace("static = false", "static = true"), "the gyro is more than"),
    ] {
        let output = identify(name, &text);
        assert_eq!(output.status.code(), Some(2), "{name}: {}", said(&output));
        let object = json(&output);
        assert!(said(&output).contains(words) && object["status"] == "failed", "{name}: {}", said(&output));
        assert!(object.get("parameters").is_none(), "{name}: {object}");
    }
}

#[test]
fn the_fault_of_a_body_s_recording_is_named_and_corrected_by_the_advice() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    // Of a gyro whose range is stated most readings in degrees are beyond it, and left out.
    let rig = recording(at).replace("range_radps", "# range_radps");
    let text = fs::read_to_string(at.join("a.csv")).unwrap();
    let degrees = |cell: &str| (cell.parse::<f64>().unwrap().to_degrees()).to_string();
    let reversed = |cell: &str| (-cell.parse::<f64>().unwrap()).to_string();
    let all = |names: [&str; 3], value: &dyn Fn(&str) -> String| {
        names.iter().fold(text.clone(), |text, name| with_column(&text, name, |_, cell| value(cell)))
    };
    let gyro = ["imu_gx_radps", "imu_gy_radps", "imu_gz_radps"];
    let swapped = text.replacen("imu_ax_mps2,imu_ay_mps2", "imu_ay_mps2,imu_ax_mps2", 1);
    for (name, changed, cause) in [
        ("degrees", all(gyro, &degrees), "the gyro is in deg/s"),
        ("moments", all(["mx_nm", "my_nm", "mz_nm"], &reversed), "the moment is reversed"),
        ("swapped", swapped, "the accelerometer has x and y swapped"),
    ] {
        assert_ne!(changed, text, "{name}");
        fs::write(at.join(format!("{name}.csv")), changed).unwrap();
        fs::write(at.join(format!("{name}.rig.toml")), &rig).unwrap();
        let output =
            rigident(at, &["identify", &format!("{name}.csv"), "--json", "--out", &format!("{name}.out")]);
        let result = json(&output);
        assert_eq!(
            (output.status.code(), result["status"].as_str()),
            (Some(1), Some("implausible")),
            "{name}"
        );
        let named = &result["cause"];
        assert!(
            named["what"].as_str().unwrap().contains(cause) && named["confirmed"] == true,
            "{name}: {named}"
        );
        // The same judgement by way of the device.
        let replayed = ["replay", &format!("{name}.csv"), "--json", "--out", &format!("{name}.replayed")];
        let replayed = json(&rigident(at, &replayed));
        assert_eq!(
            (&replayed["status"], &replayed["cause"]["what"], &replayed["cause"]["confirmed"]),
            (&result["status"], &named["what"], &named["confirmed"]),
            "{name}"
        );
        let page = fs::read_to_string(at.join(format!("{name}.out/report.html"))).unwrap();
        assert!(
            page.contains(&format!("Not to be used: most likely {cause}"))
                && !page.contains("class=\"badge good\""),
            "{name}"
        );
    }
    let scale = gyro.map(|name| format!("{name} = {{ name = \"{name}\", scale = 0.017453292519943295 }}"));
    let corrected = rig.replace("[recording]", &format!("[recording]\ncolumns = {{ {} }}", scale.join(", ")));
    fs::write(at.join("degrees.rig.toml"), corrected).unwrap();
    let output = rigident(at, &["identify", "degrees.csv", "--json", "--out", "corrected"]);
    assert_eq!(json(&output)["status"], "identified", "{}", said(&output));
}

/// Moments in N mm: as moments in N m would be of forces in kN, but no matter is as dense as that body.
/// Nobody measured where the IMU sits, and the rig file takes it to be at the origin.
#[test]
fn an_imu_that_sits_elsewhere_is_named_with_its_place() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let rig = recording(at);
    let line = rig.lines().find(|line| line.starts_with("position_m")).unwrap();
    let stated: Vec<f64> = line.split(['[', ']', ',']).filter_map(|cell| cell.trim().parse().ok()).collect();
    fs::write(at.join("o.toml"), rig.replace(line, "position_m = [0.0, 0.0, 0.0]")).unwrap();
    let output = rigident(at, &["identify", "a.csv", "--rig", "o.toml", "--json", "--out", "o"]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let cause = json(&output)["cause"]["remedy"].as_str().unwrap().to_owned();
    let found: Vec<f64> = cause.split(['[', ']', ',']).filter_map(|cell| cell.trim().parse().ok()).collect();
    assert_eq!(found.len(), 3, "{cause}");
    assert!(found.iter().zip(&stated).all(|(a, b)| (a - b).abs() < 0.003), "{cause} {stated:?}");
}

#[test]
fn of_two_units_that_explain_alike_the_possible_body_decides() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples");
    let rig = fs::read_to_string(examples.join("bracket.rig.toml")).unwrap();
    let text = fs::read_to_string(examples.join("bracket.csv")).unwrap();
    let thousand = |cell: &str| format!("{:e}", 1000.0 * cell.parse::<f64>().unwrap());
    let moments = ["mx_nm", "my_nm", "mz_nm"];
    let changed = moments.iter().fold(text, |text, name| with_column(&text, name, |_, cell| thousand(cell)));
    fs::write(at.join("mm.csv"), changed).unwrap();
    fs::write(at.join("mm.rig.toml"), &rig).unwrap();
    let result = json(&rigident(at, &["identify", "mm.csv", "--json", "--out", "mm.out"]));
    let cause = &result["cause"];
    assert_eq!((&result["status"], &cause["confirmed"]), (&"implausible".into(), &true.into()), "{cause}");
    assert!(cause["what"].as_str().unwrap().contains("the moment is in N mm"), "{cause}");
    let scale = moments.map(|name| format!("{name} = {{ name = \"{name}\", scale = 0.001 }}"));
    let corrected = rig.replace("[recording]", &format!("[recording]\ncolumns = {{ {} }}", scale.join(", ")));
    assert_ne!(corrected, rig);
    fs::write(at.join("mm.rig.toml"), corrected).unwrap();
    let found = json(&rigident(at, &["identify", "mm.csv", "--json", "--out", "corrected"]));
    assert_eq!(found["status"], "identified", "{found}");
    // The bracket's own moment, which 1 N mm in place of 1 N m would make a thousand times as large.
    assert!(found["inertia_com_kgm2"][0].as_f64().unwrap() < 0.1, "{found}");
}

const HEADER: &str = "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,imu_gx_radps,\
                      imu_gy_radps,imu_gz_radps\n";

#[test]
fn a_recording_that_never_changes_is_a_frozen_sensor_and_one_row_is_too_few() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let rows = |count: u32, row: &str| -> String {
        let lines: String = (0..count).map(|n| format!("{:.3},{row}\n", f64::from(n) * 1e-3)).collect();
        format!("{HEADER}{lines}")
    };
    fs::write(at.join("zero.csv"), rows(2000, "0,0,0,0,0,0,0,0,0,0,0,0")).unwrap();
    fs::write(at.join("same.csv"), rows(2000, "1,2,30,0.1,0.2,0.3,0.1,0.2,9.8,0,0,0.01")).unwrap();
    fs::write(at.join("one.csv"), rows(1, "1,2,30,0.1,0.2,0.3,0.1,0.2,9.8,0,0,0.01")).unwrap();
    fs::write(at.join("one.rig.toml"), "[load_cell]\nnoise_n_nm = [1, 1, 1, 0.1, 0.1, 0.1]\n").unwrap();
    for name in ["zero.csv", "same.csv"] {
        let output = rigident(at, &["identify", name, "--json"]);
        assert_eq!(output.status.code(), Some(2), "{name}: {}", said(&output));
        assert!(said(&output).contains("the load cell is frozen"), "{name}: {}", said(&output));
    }
    let one = rigident(at, &["identify", "one.csv", "--json", "--out", "o"]);
    assert_eq!(one.status.code(), Some(2), "{}", said(&one));
    assert!(said(&one).contains("no usable rows: of 1 samples 0 were rejected"), "{}", said(&one));
}

/// The demonstration with another value in one column, row by row.
fn with_column(text: &str, name: &str, value: impl Fn(usize, &str) -> String) -> String {
    let mut column = None;
    let mut row = 0;
    let lines = text.lines().map(|line| {
        if line.starts_with('#') {
            return line.to_owned();
        }
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        match column {
            None => column = Some(cells.iter().position(|cell| cell == name).unwrap()),
            Some(column) => {
                cells[column] = value(row, &cells[column]);
                row += 1;
            }
        }
        cells.join(",")
    });
    lines.collect::<Vec<_>>().join("\n") + "\n"
}

#[test]
fn a_dead_channel_of_any_sensor_is_named_and_a_spike_of_the_imu_moves_nothing() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let rig = recording(at);
    let text = fs::read_to_string(at.join("a.csv")).unwrap();
    let identify = |name: &str, text: &str| {
        fs::write(at.join(format!("{name}.csv")), text).unwrap();
        fs::write(at.join(format!("{name}.rig.toml")), &rig).unwrap();
        rigident(at, &["identify", &format!("{name}.csv"), "--json", "--out", &format!("{name}.out")])
    };
    for (name, value) in
        [("mz_nm", "0.0"), ("imu_gy_radps", "0.0"), ("imu_ax_mps2", "0.25"), ("fx_n", "-3.0")]
    {
        let output = identify(name, &with_column(&text, name, |_, _| value.to_owned()));
        assert_eq!(output.status.code(), Some(2), "{name}: {}", said(&output));
        assert!(said(&output).contains(name) && json(&output)["status"] == "failed", "{}", said(&output));
    }
    let clean = json(&identify("clean", &text));
    for (name, spike) in [("imu_gx_radps", 35.0), ("imu_az_mps2", -400.0)] {
        let spoilt = with_column(&text, name, |row, cell| {
            if row == 12_345 {
                format!("{:?}", cell.parse::<f64>().unwrap() + spike)
            } else {
                cell.to_owned()
            }
        });
        // A range would screen it: as where none is stated.
        let spoilt_rig: String =
            rig.lines().filter(|l| !l.starts_with("range_")).map(|l| format!("{l}\n")).collect();
        fs::write(at.join("free.rig.toml"), spoilt_rig).unwrap();
        fs::write(at.join(format!("{name}-spike.csv")), spoilt).unwrap();
        let file = format!("{name}-spike.csv");
        let output = rigident(
            at,
            &["identify", &file, "--rig", "free.rig.toml", "--json", "--out", &format!("{name}.s")],
        );
        let result = json(&output);
        assert!(result["warnings"].to_string().contains(name), "{}", result["warnings"]);
        for (now, before) in
            result["parameters"].as_array().unwrap().iter().zip(clean["parameters"].as_array().unwrap())
        {
            // A tenth of a second in twenty is lost.
            let moved = (now["value"].as_f64().unwrap() - before["value"].as_f64().unwrap()).abs();
            assert!(moved < 0.2 * before["u95"].as_f64().unwrap(), "{name}: {now} {before}");
        }
    }
}

/// A recording that was cut off after its first rows is answered, or refused, and in either case at once.
#[test]
fn recordings_of_a_few_rows_end() {
    let place = tempfile::tempdir().unwrap();
    let examples = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples");
    let text = std::fs::read_to_string(examples.join("bracket.csv")).unwrap();
    std::fs::copy(examples.join("bracket.rig.toml"), place.path().join("cut.rig.toml")).unwrap();
    for lines in [2, 3, 6, 8, 10, 11, 12, 13, 14, 20, 30] {
        let cut: Vec<&str> = text.lines().take(lines).collect();
        for rig in [true, false] {
            let name = if rig { "cut.csv" } else { "bare.csv" };
            std::fs::write(place.path().join(name), cut.join("\n")).unwrap();
            let out = format!("{lines}-{rig}");
            let output = rigident(place.path(), &["identify", name, "--json", "--out", &out]);
            assert!(matches!(status(&output), 0..=2), "{lines} lines: {}", said(&output));
        }
    }
}
