//! Bodies on hooked springs that Python simulates with numpy alone (`springs/world.py`): springs as lines
//! between points, which are not quite where the rig file has them. `RIGIDENT_PYTHON` names an interpreter
//! that has numpy, as `cargo xtask setup` installs it.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::program::{json, python, rigident, said, status};
use crate::study_length::runs;

const WORLD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/integration/springs/world.py");
/// Names of the ten parameters in an answer.
const TEN: [&str; 10] = ["m", "mcx", "mcy", "mcz", "Ixx", "Iyy", "Izz", "Iyz", "Izx", "Ixy"];
/// Errors of a careful person with a tape measure and springs that were calibrated to 0.3 %.
const MEASURED: [&str; 8] = [
    "place_m=0.001",
    "axis_rad=0.009",
    "height_m=0.001",
    "length_m=0.005",
    "pull=0.1",
    "stiffness=0.003",
    "common=0.003",
    "keys=stiffness_std=0.003;stiffness_common_std=0.003",
];

/// Simulates worlds of the numbers from `first` on.
fn simulate(folder: &Path, first: usize, count: usize, keys: &[&str]) {
    let numbers = [first.to_string(), count.to_string()];
    let output = Command::new(python()).arg(WORLD).arg(folder).args(&numbers).args(keys).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
}

/// Returns the ten parameters of a world's body about the origin of S.
fn truth(folder: &Path, number: usize) -> [f64; 10] {
    let text = fs::read_to_string(folder.join(format!("{number}.json"))).unwrap();
    let own: Value = serde_json::from_str(&text).unwrap();
    let at = |key: &str, k: usize| own[key][k].as_f64().unwrap();
    let (m, [x, y, z]) = (own["mass"].as_f64().unwrap(), [0, 1, 2].map(|k| at("com", k)));
    let i: [f64; 6] = std::array::from_fn(|k| at("inertia", k));
    [
        m,
        m * x,
        m * y,
        m * z,
        i[0] + m * (y * y + z * z),
        i[1] + m * (z * z + x * x),
        i[2] + m * (x * x + y * y),
        i[3] - m * y * z,
        i[4] - m * z * x,
        i[5] - m * x * y,
    ]
}

/// Returns the errors of the parameters that the modes identify, by their U95; `None` if there is no body.
fn errors(folder: &Path, number: usize) -> Option<Vec<f64>> {
    let output = rigident(folder, &["vibration", "identify", &format!("{number}.csv"), "--json"]);
    assert!(status(&output) < 2, "{}", said(&output));
    let found = json(&output);
    Some(off(found["by_modes"]["parameters"].as_array()?, &truth(folder, number)))
}

/// Returns the errors of the ten parameters that have a value, by their U95.
fn off(parameters: &[Value], truth: &[f64; 10]) -> Vec<f64> {
    let of = |p: &Value| {
        let k = TEN.iter().position(|name| p["name"] == *name)?;
        Some((p["value"].as_f64()? - truth[k]) / p["u95"].as_f64()?)
    };
    parameters.iter().filter_map(of).collect()
}

#[test]
#[ignore = "needs numpy in Python"]
fn springs_off_their_places_leave_the_body_inside_its_intervals() {
    let place = tempfile::tempdir().unwrap();
    let count = runs(8, 4) as usize;
    simulate(place.path(), 1, count, &MEASURED);
    let all: Vec<Vec<f64>> = (1..=count).filter_map(|number| errors(place.path(), number)).collect();
    let values: Vec<f64> = all.concat();
    let outside = values.iter().filter(|off| off.abs() > 1.0).count();
    assert!(all.len() + 1 >= count && values.len() >= 7 * count, "{} of {count} runs", all.len());
    // 5 % of ten values a run that are not independent.
    assert!(8 * outside <= 10 * count && values.iter().all(|off| off.abs() < 2.0), "{values:?}");
    // The same without their errors of place: no body, or one that is far outside.
    let exact = "[suspension]\nplace_std_m = 0.0\naxis_std_rad = 0.0\nanchor_height_std_m = 0.0\n\
                 length_std_m = 0.0\npreload_std = 0.0\nshare_std = 0.0\n";
    for number in 1..=runs(3, 1) as usize {
        let file = place.path().join(format!("{number}.rig.toml"));
        let rig = fs::read_to_string(&file).unwrap();
        fs::write(&file, rig.replacen("[suspension]\n", exact, 1)).unwrap();
        let found = errors(place.path(), number);
        assert!(found.is_none_or(|found| found.iter().any(|off| off.abs() > 1.5)), "{number}");
    }
}

/// Of swings of a millimetre the markers' noise of 0.2 mm has most of what lies above the modes: the motion
/// is smoothed below that, and the body is neither refused nor too small.
#[test]
#[ignore = "needs numpy in Python"]
fn swings_of_a_millimetre_leave_the_body_inside_its_intervals() {
    let place = tempfile::tempdir().unwrap();
    let weak = ["amplitude=0.2", "place_m=0.0005", "axis_rad=0.004", "stiffness=0.003", "common=0.003"];
    let known = "keys=stiffness_std=0.003;stiffness_common_std=0.003";
    let count = runs(12, 2) as usize;
    simulate(place.path(), 24, count, &[&weak[..], &[known]].concat());
    for number in 24..24 + count {
        let output = rigident(place.path(), &["identify", &format!("{number}.csv"), "--json"]);
        let found = json(&output);
        assert_ne!(found["status"], "implausible", "{number}: {}", found["warnings"]);
        let errors = off(found["parameters"].as_array().unwrap(), &truth(place.path(), number));
        assert!(!errors.is_empty() && errors.iter().all(|off| off.abs() < 1.5), "{number}: {errors:?}");
    }
}

/// Turns and springs that change direction add vibrations of the second order beside weak modes: quiet
/// cameras see them at 3 mm, all at 12 mm.
#[test]
#[ignore = "needs numpy in Python"]
fn products_of_modes_neither_refuse_a_body_nor_move_it() {
    let place = tempfile::tempdir().unwrap();
    let (quiet, wide) = (runs(8, 2) as usize, runs(8, 1) as usize);
    let with = |more: &'static str| MEASURED.iter().copied().chain([more]).collect::<Vec<&str>>();
    simulate(place.path(), 1, quiet, &with("marker_m=2e-5"));
    simulate(place.path(), 101, wide, &with("amplitude=2"));
    let all: Vec<Vec<f64>> =
        (1..=quiet).chain(101..101 + wide).filter_map(|number| errors(place.path(), number)).collect();
    let values: Vec<f64> = all.concat();
    assert!(all.len() + 1 >= quiet + wide && values.len() >= 8 * all.len(), "{all:?}");
    let outside = values.iter().filter(|off| off.abs() > 1.0).count();
    assert!(8 * outside <= values.len() && values.iter().all(|off| off.abs() < 2.0), "{values:?}");
}

#[test]
#[ignore = "needs numpy in Python"]
fn a_rest_without_the_body_gives_the_mass_and_finds_springs_that_stiffen() {
    let place = tempfile::tempdir().unwrap();
    let u95 = |number: usize| {
        let output = rigident(place.path(), &["vibration", "identify", &format!("{number}.csv"), "--json"]);
        let found = json(&output);
        let all = found["by_modes"]["parameters"].as_array().unwrap().clone();
        let mass = all.iter().find(|p| p["name"] == "m").unwrap();
        let off = (mass["value"].as_f64().unwrap() - truth(place.path(), number)[0]).abs();
        (off, mass["u95"].as_f64().unwrap())
    };
    simulate(place.path(), 1, 1, &["stiffness=0.02"]);
    let (off, without) = u95(1);
    assert!(off < 1.5 * without, "{off} {without}");
    let linear = "keys=static_std=0.002";
    simulate(place.path(), 1, 1, &["stiffness=0.02", "rests=1", linear]);
    let (off, with) = u95(1);
    assert!(off < 1.5 * with && with < 0.5 * without, "{off} {with} {without}");
    // 9 % at 15 mm, of which a swing of 2 mm shows nothing.
    let good = "keys=static_std=0.002;stiffness_std=0.003;stiffness_common_std=0.003";
    simulate(place.path(), 1, 1, &["stiffens=0.09", "amplitude=0.3", "rests=1", good]);
    for words in [&["vibration", "identify", "1.csv"][..], &["identify", "1.csv"]] {
        let output = rigident(place.path(), words);
        let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), said(&output));
        assert!(status(&output) == 1 && text.contains("modes and springs say"), "{words:?}: {text}");
    }
}
