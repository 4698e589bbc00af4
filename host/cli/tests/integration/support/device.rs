//! The device's result of several links, recorded and replayed.

use std::fs;
use std::path::Path;

use super::Found;
use crate::factors::simulated::{rigident, said, status};
use crate::tree_commands::noise;

/// The device's result of several links, recorded in `live`.
struct Live {
    place: tempfile::TempDir,
    found: Found,
    recording: String,
    body: &'static str,
}

impl Live {
    fn new(body: &'static str) -> Self {
        let place = tempfile::tempdir().unwrap();
        let words = ["demo", "--body", body, "--duration-s", "20", "--json", "--out", "live"];
        let found = Self::answer(place.path(), &words);
        Self { place, found, recording: format!("live/{}", Self::recording(body)), body }
    }

    fn answer(place: &Path, words: &[&str]) -> Found {
        let output = rigident(place, words);
        assert!(status(&output) < 2, "{}", said(&output));
        Found(serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output))))
    }

    /// Frames of a person are recorded as CSV.
    fn recording(body: &str) -> &'static str {
        if body == "human34" { "demo.csv" } else { "demo.mcap" }
    }

    /// Replays the recording through the firmware with options.
    fn replayed(&self, more: &[&str]) -> Found {
        let words =
            [&["replay", &self.recording, "--json", "--out", "again"], model(self.body), more].concat();
        Self::answer(self.place.path(), &words)
    }

    /// Name of the mass of all links.
    fn mass(&self) -> String {
        self.found.names().into_iter().find(|name| name.ends_with(".M")).unwrap()
    }
}

/// Frames name no model.
fn model(body: &str) -> &'static [&'static str] {
    if body == "human34" { &["--model", "human34"] } else { &[] }
}

fn known_values_of(body: &'static str) {
    let live = Live::new(body);
    let name = live.mass();
    let (value, u95) = live.found.of(&name);
    let sd = u95 / 1.96;
    let after = live.replayed(&["--known", &format!("{name}={}±{sd}", value + sd)]);
    let (together, narrower) = after.of(&name);
    assert!((together - value - 0.5 * sd).abs() < 0.01 * sd, "{together}");
    assert!((narrower / (u95 / 2.0_f64.sqrt()) - 1.0).abs() < 0.01, "{narrower} {u95}");
}

fn factor_files_of(body: &'static str) {
    let live = Live::new(body);
    let words = ["solve", "live/demo.factor", "--json", "--out", "solved"];
    let solved = Live::answer(live.place.path(), &words);
    for name in live.found.names() {
        let ((v, u95), (w, t)) = (live.found.of(&name), solved.of(&name));
        assert!((v - w).abs() < 1e-6 * u95 && (t / u95 - 1.0).abs() < 1e-6, "{name}: {v} {w} {u95} {t}");
    }
}

/// Writes `NAME.csv` of a demonstration's recording with its cells changed: row, column and value.
fn edited(place: &Path, recording: &str, name: &str, change: &dyn Fn(usize, &str, f64) -> f64) {
    let folder = recording.split('/').next().unwrap();
    let plain = format!("{folder}/demo.csv");
    if recording != plain {
        let converted = rigident(place, &["convert", recording, &plain]);
        assert_eq!(status(&converted), 0, "{}", said(&converted));
    }
    let text = fs::read_to_string(place.join(plain)).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header = lines.next().unwrap();
    let names: Vec<&str> = header.split(',').collect();
    let mut table = format!("{header}\n");
    for (row, line) in lines.enumerate() {
        let cells = line.split(',').zip(&names).map(|(cell, column)| match cell.parse() {
            Ok(value) => change(row, column, value).to_string(),
            Err(_) => cell.to_owned(),
        });
        table += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    fs::write(place.join(format!("{name}.csv")), table).unwrap();
    fs::copy(place.join(format!("{folder}/demo.rig.toml")), place.join(format!("{name}.rig.toml"))).unwrap();
}

/// The fixture is three tenths of the body, by the same motion with other noise.
fn tare_of(body: &'static str) {
    let live = Live::new(body);
    let place = live.place.path();
    let words = ["demo", "--body", body, "--duration-s", "20", "--seed", "2", "--json", "--out", "other"];
    Live::answer(place, &words);
    edited(place, &format!("other/{}", Live::recording(body)), "light", &|_, column, value| {
        if column.ends_with("_n") || column.ends_with("_nm") { 0.3 * value } else { value }
    });
    let output = rigident(place, &[&["factor", "light.csv", "-o", "light.factor"], model(body)].concat());
    assert_eq!(status(&output), 0, "{}", said(&output));
    let fixture = Live::answer(place, &["solve", "light.factor", "--json", "--out", "light"]);
    let tared = live.replayed(&["--tare", "light.factor"]);
    let names: Vec<_> = tared.names().into_iter().filter(|name| fixture.names().contains(name)).collect();
    assert!(names.contains(&live.mass()), "{names:?}");
    for name in names {
        let ((v, a), (w, b), (x, c)) = (live.found.of(&name), fixture.of(&name), tared.of(&name));
        assert!((x - (v - w)).abs() < 0.02 * c, "{name}: {v} - {w} = {x}");
        assert!((c / a.hypot(b) - 1.0).abs() < 0.02, "{name}: {a} {b} {c}");
    }
}

/// Noise of five times the load cell's, with a memory of a second.
fn autocorrelation_of(body: &'static str) {
    let live = Live::new(body);
    let place = live.place.path();
    let rate_hz = live.found.0["source"]["rate_hz"].as_f64().unwrap();
    let sigma = live.found.channel("fz")["sigma"].as_f64().unwrap();
    let keep = (-1.0 / rate_hz).exp();
    let mut drift = vec![0.0; 30_000];
    for row in 1..drift.len() {
        drift[row] = keep * drift[row - 1] + (1.0 - keep * keep).sqrt() * noise(100_000 + row);
    }
    edited(place, &live.recording, "slow", &|row, column, value| {
        if column == "fz_n" { value + 5.0 * sigma * drift[row] } else { value }
    });
    let slow =
        Live::answer(place, &[&["replay", "slow.csv", "--json", "--out", "slow"], model(body)].concat());
    assert!(live.found.channel("fz").get("autocorrelation").is_none(), "{}", live.found.channel("fz"));
    assert!(slow.channel("fz")["autocorrelation"].as_f64().unwrap() > 1.0);
}

cells!(one_body: 1 by "replay");

mod two_links {
    #[test]
    fn known_values() {
        crate::support::device::known_values_of("two-links");
    }

    #[test]
    fn factor_files() {
        crate::support::device::factor_files_of("two-links");
    }

    #[test]
    fn tare() {
        crate::support::device::tare_of("two-links");
    }

    #[test]
    fn autocorrelation() {
        crate::support::device::autocorrelation_of("two-links");
    }
}

mod tree {
    #[test]
    fn known_values() {
        crate::support::device::known_values_of("human34");
    }

    #[test]
    fn factor_files() {
        crate::support::device::factor_files_of("human34");
    }

    #[test]
    fn tare() {
        crate::support::device::tare_of("human34");
    }

    #[test]
    fn autocorrelation() {
        crate::support::device::autocorrelation_of("human34");
    }
}
