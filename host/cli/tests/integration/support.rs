//! One test for each feature and kind of body in README's support matrix, of what `identify` does with a
//! recording: `support::two_links::forgetting`. xtask/src/support.rs has the list of cells.
#![cfg(feature = "simulator")]

mod simulated;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::factors::simulated::{json, rigident, said, status};
use crate::tree_commands::{noise, swing};
use simulated::{FORCE_NOISE, RATE_HZ, ROWS, Subject, Table, sigma};

/// An answer: value and U95 by name.
struct Found(Value);

impl Found {
    /// Value and U95 of a parameter; of a recording that cannot be true, those of its fit.
    fn of(&self, name: &str) -> (f64, f64) {
        let place = if self.0["status"] == "implausible" { &self.0["fit"] } else { &self.0 };
        let all = place["parameters"].as_array().unwrap();
        let p = all.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("no {name}: {all:?}"));
        (p["value"].as_f64().unwrap(), p["u95"].as_f64().unwrap())
    }

    /// Names of what is identified, but for the offsets, which each run has of its own.
    fn names(&self) -> Vec<String> {
        let all = self.0["parameters"].as_array().unwrap().iter();
        let names = all.filter(|p| p["value"].is_f64()).map(|p| p["name"].as_str().unwrap().to_owned());
        names.filter(|name| !name.starts_with("offset_")).collect()
    }

    fn channel(&self, name: &str) -> &Value {
        self.0["channels"].as_array().unwrap().iter().find(|c| c["name"] == name).unwrap()
    }
}

/// Answers of which all or a part is identified.
fn identify(subject: Subject, place: &Path, name: &str, more: &[&str]) -> Found {
    let words: String = [&[name], more].concat().concat().replace(|c: char| !c.is_ascii_alphanumeric(), "-");
    let file = format!("{name}.csv");
    let output = rigident(place, &[&[subject.command, &file, "--json", "--out", &words], more].concat());
    assert!(status(&output) < 2, "{}", said(&output));
    Found(serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output))))
}

/// The recording `a` as it is, in a new folder.
fn plain(subject: Subject) -> (tempfile::TempDir, Table, String) {
    let place = tempfile::tempdir().unwrap();
    let (table, rig) = (subject.table(place.path()), subject.rig("", "", false));
    table.write(place.path(), "a", &rig);
    (place, table, rig)
}

fn recordings(subject: Subject) {
    let (place, _, _) = plain(subject);
    let found = identify(subject, place.path(), "a", &[]);
    assert_eq!(found.0["status"], "identified");
    let (mass, u95) = found.of(subject.mass_name()[0]);
    assert!((mass - subject.mass()).abs() < 4.5 / 1.96 * u95 && u95 < 0.01, "{mass} {u95}");
    let output = rigident(place.path(), &["convert", "a.csv", "b.mcap"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let packed = Found(json(place.path(), &[subject.command, "b.mcap", "--json", "--out", "b"]));
    assert_eq!(packed.0["parameters"], found.0["parameters"]);
}

fn offsets(subject: Subject) {
    let (place, table, rig) = plain(subject);
    let moved = table.changed(|_, cells| cells[1..7].iter_mut().for_each(|w| *w += 1.5));
    moved.write(place.path(), "moved", &rig);
    let [before, after] = ["a", "moved"].map(|name| identify(subject, place.path(), name, &[]));
    for name in before.names() {
        let ((v, u95), (w, _)) = (before.of(&name), after.of(&name));
        assert!((v - w).abs() < subject.rounding(u95), "{name}: {v} {w}");
    }
    for name in ["offset_fx", "offset_mz"] {
        let ((v, u95), (w, _)) = (before.of(name), after.of(name));
        assert!((w - v - 1.5).abs() < subject.rounding(u95), "{name}");
    }
    table.write(place.path(), "known", &subject.rig("offset_n_nm = \"zero\"", "", false));
    let known = identify(subject, place.path(), "known", &[]);
    assert!(!known.0["parameters"].to_string().contains("offset_fx"));
}

/// Noise with a memory of a second is far slower than the filter of 0.1 s.
fn autocorrelation(subject: Subject) {
    let (place, table, rig) = plain(subject);
    let keep = (-1.0 / RATE_HZ).exp();
    let mut drift = vec![0.0; ROWS];
    for row in 1..ROWS {
        drift[row] = keep * drift[row - 1] + (1.0 - keep * keep).sqrt() * noise(100_000 + row);
    }
    table.changed(|row, cells| cells[3] += drift[row]).write(place.path(), "slow", &rig);
    let [before, after] = ["a", "slow"].map(|name| identify(subject, place.path(), name, &[]));
    assert!(before.channel("fz").get("autocorrelation").is_none(), "{}", before.channel("fz"));
    assert!(after.channel("fz")["autocorrelation"].as_f64().unwrap() > 1.0);
    assert!(after.channel("fx").get("autocorrelation").is_none(), "{}", after.channel("fx"));
    let (mass, u95) = after.of(subject.mass_name()[0]);
    assert!((mass - subject.mass()).abs() < 4.5 / 1.96 * u95, "{mass} {u95}");
}

fn imu_noise(subject: Subject) {
    let (place, table, _) = plain(subject);
    let gyro = 0.01;
    let first = table.names.iter().position(|name| name == "imu_gx_radps").unwrap();
    let last = first + 3 * subject.links;
    let noisy = table.changed(|row, cells| {
        for (c, cell) in cells[first..last].iter_mut().enumerate() {
            *cell += gyro * noise(1_000_000 + 9 * row + c);
        }
    });
    let cell = format!("noise_n_nm = {:?}", std::array::from_fn::<f64, 6, _>(sigma));
    noisy.write(place.path(), "stated", &subject.rig(&cell, &format!("gyro_noise_radps = {gyro}"), false));
    let [clean, stated] = ["a", "stated"].map(|name| identify(subject, place.path(), name, &[]));
    let largest = |found: &Found| {
        let sds = found.names().into_iter().map(|name| {
            let ((v, _), (w, u95)) = (clean.of(&name), found.of(&name));
            1.96 * (v - w).abs() / u95
        });
        sds.fold(0.0, f64::max)
    };
    // The noise of the gyros alone makes the difference: the same noise of the wrench is in both.
    assert!(largest(&stated) < 4.5, "{}", largest(&stated));
    assert!(stated.names().iter().any(|name| name == subject.mass_name()[0]));
}

fn outliers(subject: Subject) {
    let (place, table, rig) = plain(subject);
    let knocked = table.changed(|row, cells| {
        if (ROWS / 2..ROWS / 2 + 4).contains(&row) {
            cells[1] += 50.0 * 10.0 * FORCE_NOISE;
        }
    });
    knocked.write(place.path(), "knocked", &rig);
    let [clean, found] = ["a", "knocked"].map(|name| identify(subject, place.path(), name, &[]));
    // The filter of 0.1 s, a hundred blocks a second, sees the 20 ms in twelve blocks, faintly in the first
    // and last.
    let count = found.channel("fx")["outliers"].as_u64().unwrap();
    assert!((4..=12).contains(&count), "{count}");
    for name in clean.names() {
        let ((v, u95), (w, _)) = (clean.of(&name), found.of(&name));
        assert!((v - w).abs() < 0.5 * u95, "{name}: {v} {w} {u95}");
    }
}

/// Each channel has a gain of its own, six at most tell the mass: no combination of them is better than 1/√6
/// = 0.41 of one gain's σ, none worse than one alone.
fn gain_errors(subject: Subject) {
    let (place, table, _) = plain(subject);
    let gain = 0.01;
    table.write(
        place.path(),
        "gain",
        &subject.rig(&format!("gain_uncertainty = {:?}", [gain; 6]), "", false),
    );
    let [without, with] =
        ["a", "gain"].map(|name| identify(subject, place.path(), name, &[]).of(subject.mass_name()[0]).1);
    let of_gain = (with * with - without * without).sqrt() / (1.96 * gain * subject.mass());
    assert!((0.4..1.0).contains(&of_gain), "{of_gain}");
}

/// The IMU sits 10 mm from where the rig file has it: within what is stated that is found, beyond it is
/// named.
fn rig_errors(subject: Subject) {
    let (place, table, _) = plain(subject);
    let off = 0.01;
    for (std, status) in [(0.01, "identified"), (0.001, "implausible")] {
        let imu = format!("position_m = [{off}, 0.0, 0.0]\nposition_std_m = {std}");
        table.write(place.path(), status, &subject.rig("", &imu, false));
        let found = identify(subject, place.path(), status, &[]);
        assert_eq!(found.0["status"], status, "{}", found.0["warnings"]);
        let errors = found.0["errors"].as_array().unwrap();
        let error = errors.iter().find(|e| e["name"] == "lever_arm_x").unwrap();
        let (value, u95) = (error["value"].as_f64().unwrap(), error["u95"].as_f64().unwrap());
        assert!((value + off).abs() < 2.0 * u95 && u95 < 0.1 * off, "{error}");
        let (mass, u95) = found.of(subject.mass_name()[0]);
        assert!((mass - subject.mass()).abs() < 2.3 * u95, "{mass} {u95}");
        assert_eq!(found.0["warnings"].to_string().contains("lever_arm_x"), status == "implausible");
    }
}

/// A known value of one parameter alone is another measurement of it: inverse variances add.
fn known_values(subject: Subject) {
    let (place, _, _) = plain(subject);
    let [name, quantity] = subject.mass_name();
    let before = identify(subject, place.path(), "a", &[]);
    let (value, u95) = before.of(name);
    let (sd, known) = (u95 / 1.96, value + u95 / 1.96);
    let stated = format!("{quantity}={known}±{sd}");
    let after = identify(subject, place.path(), "a", &["--known", &stated]);
    let (together, narrower) = after.of(name);
    assert!((together - 0.5 * (value + known)).abs() < 0.01 * sd, "{together}");
    assert!((narrower / (u95 / 2.0_f64.sqrt()) - 1.0).abs() < 0.01, "{narrower} {u95}");
    let contradiction = format!("{quantity}={}±{sd}", value + 40.0 * sd);
    let output =
        rigident(place.path(), &[subject.command, "a.csv", "--known", &contradiction, "--out", "never"]);
    assert_eq!(status(&output), 2, "{}", said(&output));
}

/// The body is not symmetric about y: a loose statement narrows what it names, a tight one contradicts the
/// data. The mass of a link behind a joint is determined in sums only, so that metres off a plane are no
/// first moment: the refusal names the mass.
fn symmetry(subject: Subject) {
    let (place, _, _) = plain(subject);
    let refused = |plane: &str| {
        let output =
            rigident(place.path(), &[subject.command, "a.csv", "--symmetry", plane, "--out", "never"]);
        assert_eq!(status(&output), 2, "{}", said(&output));
        said(&output)
    };
    if subject.links > 1 {
        assert!(refused("arm:y±0.02").contains("arm.m"));
        return;
    }
    let [before, after] =
        [&[][..], &["--symmetry", "y±0.02"]].map(|more| identify(subject, place.path(), "a", more));
    assert!(after.of("mcy").1 < before.of("mcy").1);
    refused("y±0.0001");
}

/// A file with a rate and a clock of its own: late by this much, with the columns that begin with one of
/// these.
type FileOfClock = (&'static str, f64, f64, &'static [&'static str]);

/// Wrench; IMU of the base; IMU and attitude of the arm; encoder of the hand.
const CLOCKS: [FileOfClock; 4] = [
    ("wrench", 200.0, 0.0, &["fx", "fy", "fz", "mx", "my", "mz"]),
    ("imu", 211.0, 0.0065, &["imu_"]),
    ("arm", 230.0, -0.0031, &["imu1_", "q1_"]),
    ("hand", 173.0, 0.0042, &["hand_"]),
];

/// The angle of the last joint in place of its attitude, and its rate.
fn with_encoder(table: &Table) -> Table {
    let mut table = table.clone();
    table.names.extend(["hand_rad", "hand_radps"].map(str::to_owned));
    for cells in &mut table.rows {
        let [angle, rate, _] = swing(cells[0], 5, 0.8);
        cells.extend([angle, rate]);
    }
    table
}

/// Skews and parameters are within 4.5 sd of the truth; the parameters' is what the recording of one clock
/// says without noise.
fn several_clocks(subject: Subject) {
    let (place, table, rig) = plain(subject);
    let quiet = table.changed(|row, cells| {
        cells[1..7].iter_mut().enumerate().for_each(|(c, w)| *w -= sigma(c) * noise(6 * row + c));
    });
    quiet.write(place.path(), "truth", &rig);
    let truth = identify(subject, place.path(), "truth", &[]);
    let mut listed = String::new();
    for (name, rate_hz, late_s, begins) in &CLOCKS[..=subject.links] {
        let sampled = with_encoder(&subject.sampled(place.path(), *rate_hz, (rate_hz * 20.0) as usize));
        let kept: Vec<usize> = (0..sampled.names.len())
            .filter(|c| *c == 0 || begins.iter().any(|begin| sampled.names[*c].starts_with(begin)))
            .collect();
        let row = |cells: &Vec<f64>| {
            let mut cells: Vec<f64> = kept.iter().map(|c| cells[*c]).collect();
            cells[0] += 100.0 + late_s;
            cells
        };
        let file = Table {
            names: kept.iter().map(|c| sampled.names[*c].clone()).collect(),
            rows: sampled.rows.iter().map(row).collect(),
        };
        file.write(place.path(), name, "");
        fs::remove_file(place.path().join(format!("{name}.rig.toml"))).unwrap();
        let _ = write!(listed, "[[stream]]\nfile = \"{name}.csv\"\n");
    }
    let rig = subject.rig("", "", false).replace(&format!("rate_hz = {RATE_HZ}\n"), "");
    fs::write(place.path().join("run.rig.toml"), rig + &listed).unwrap();
    let found = Found(json(place.path(), &["identify", "run.rig.toml", "--json", "--out", "run"]));
    let streams = found.0["time_base"]["streams"].as_array().unwrap();
    for (stream, (name, _, late_s, _)) in streams.iter().zip(&CLOCKS).skip(1) {
        let [skew, u95] = ["value", "u95"].map(|key| stream["skew_s"][key].as_f64().unwrap());
        assert!((skew - late_s).abs() < 4.5 / 1.96 * u95 && u95 < 0.001, "{name}: {skew} {u95}");
    }
    for name in truth.names() {
        let ((v, _), (w, u95)) = (truth.of(&name), found.of(&name));
        assert!((v - w).abs() < 4.5 / 1.96 * u95, "{name}: {v} {w} {u95}");
    }
    let (_, u95) = found.of(subject.mass_name()[0]);
    assert!(u95 < 0.01 * subject.mass(), "{u95}");
    // The factor of the same files, and its solution.
    let made = rigident(place.path(), &["factor", "run.rig.toml", "-o", "run.factor"]);
    assert_eq!(status(&made), 0, "{}", said(&made));
    let solved = Found(json(place.path(), &["solve", "run.factor", "--json", "--out", "solved"]));
    for name in found.names() {
        let ((v, u95), (w, _)) = (found.of(&name), solved.of(&name));
        assert!((v - w).abs() < subject.rounding(u95), "{name}: {v} {w}");
    }
}

fn halves(place: &Path, table: &Table, rig: &str) {
    for (name, rows) in [("early", 0..ROWS / 2), ("late", ROWS / 2..ROWS)] {
        table.part(rows).write(place, name, rig);
        let output = rigident(place, &["factor", &format!("{name}.csv"), "-o", &format!("{name}.factor")]);
        assert_eq!(status(&output), 0, "{}", said(&output));
    }
}

/// Two runs are independent: values subtract and variances add.
fn tare(subject: Subject) {
    let (place, table, rig) = plain(subject);
    let heavy = table.changed(|row, cells| {
        if row < ROWS / 2 {
            cells[1..7].iter_mut().for_each(|w| *w *= 3.0);
        }
    });
    halves(place.path(), &heavy, &rig);
    let [early, late] = ["early", "late"].map(|name| identify(subject, place.path(), name, &[]));
    let tared = identify(subject, place.path(), "early", &["--tare", "late.factor"]);
    let full = |names: &[String]| {
        names.iter().filter(|name| tared.names().contains(*name)).cloned().collect::<Vec<_>>()
    };
    let names = full(&early.names());
    assert!(!names.is_empty() && names.iter().any(|name| name == subject.mass_name()[0]), "{names:?}");
    for name in names {
        let ((v, a), (w, b), (x, c)) = (early.of(&name), late.of(&name), tared.of(&name));
        assert!((x - (v - w)).abs() < 0.01 * c, "{name}: {v} - {w} = {x}");
        assert!((c / a.hypot(b) - 1.0).abs() < 0.02, "{name}: {a} {b} {c}");
    }
}

fn factor_files(subject: Subject) {
    let (place, table, rig) = plain(subject);
    halves(place.path(), &table, &rig);
    let solve =
        |file: &str| Found(json(place.path(), &["solve", file, "--json", "--out", &file.replace('.', "-")]));
    let [early, solved] = [identify(subject, place.path(), "early", &[]), solve("early.factor")];
    let merged = rigident(
        place.path(),
        &["merge", "early.factor", "late.factor", "--shared-offset", "-o", "both.factor"],
    );
    assert_eq!(status(&merged), 0, "{}", said(&merged));
    let (merged, whole) = (solve("both.factor"), identify(subject, place.path(), "a", &[]));
    for name in whole.names() {
        let ((v, u95), (w, _)) = (early.of(&name), solved.of(&name));
        assert!((v - w).abs() < subject.rounding(u95), "{name}: {v} {w}");
        // A fiftieth of the rows at most is lost where the halves meet, which moves an estimate by a seventh
        // of its sd.
        let ((v, u95), (w, t)) = (whole.of(&name), merged.of(&name));
        assert!(
            (v - w).abs() < 4.5 / 7.0 / 1.96 * u95 && (t / u95 - 1.0).abs() < 0.05,
            "{name}: {v} {w} {u95} {t}"
        );
    }
}

/// The wrench is linear in the parameters: half as much again is a body half as heavy again, until a quarter
/// of the time.
fn forgetting(subject: Subject) {
    let (place, table, rig) = plain(subject);
    let heavy = table.changed(|row, cells| {
        if row < ROWS / 4 {
            cells[1..7].iter_mut().for_each(|w| *w *= 1.5);
        }
    });
    heavy.write(place.path(), "heavy", &rig);
    let name = subject.mass_name()[0];
    // Ten time constants leave 5e-5 of the change; the window ends five seconds after it.
    for memory in [["--forget", "1.5"], ["--window", "10"]] {
        let (mass, u95) = identify(subject, place.path(), "heavy", &memory).of(name);
        assert!((mass - subject.mass()).abs() < 4.5 / 1.96 * u95, "{memory:?}: {mass} {u95}");
        assert!(u95 < 0.05 * subject.mass(), "{memory:?}: {u95}");
    }
    let whole = identify(subject, place.path(), "heavy", &[]);
    let p = whole.0["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap();
    assert!(p["value"].as_f64().is_none_or(|mass| mass > 1.05 * subject.mass()), "{p}");
}

macro_rules! cells {
    ($($body:ident: $links:literal),* by $command:literal) => {
        $( cells!(@ $body, $links, $command, recordings, offsets, autocorrelation, imu_noise, outliers, gain_errors,
            known_values, symmetry, tare, factor_files, forgetting); )*
    };
    (@ $body:ident, $links:literal, $command:literal, $($feature:ident),*) => {
        mod $body {
            $( #[test]
            fn $feature() {
                crate::support::$feature(crate::support::Subject { links: $links, command: $command });
            } )*
        }
    };
}

cells!(one_body: 1, two_links: 2, tree: 3 by "identify");

mod errors {
    cells!(@ one_body, 1, "identify", rig_errors);
    cells!(@ one_body_on_device, 1, "replay", rig_errors);
    cells!(@ two_links, 2, "identify", rig_errors);
    cells!(@ tree, 3, "identify", rig_errors);
}

mod clocks {
    cells!(@ one_body, 1, "identify", several_clocks);
    cells!(@ two_links, 2, "identify", several_clocks);
    cells!(@ tree, 3, "identify", several_clocks);
}

mod device;
