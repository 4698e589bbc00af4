//! The examples run and say what they should.

use std::path::Path;

use rigident::rig::RigFile;

use crate::program::{json, rigident, said, status};

#[path = "../../../examples/identify_csv.rs"]
mod identify_csv;
#[path = "../../../examples/talk_to_device.rs"]
mod talk_to_device;

#[test]
fn the_device_weighs_its_body() {
    talk_to_device::main().unwrap();
    // 20 kg and an offset of 3.7 N that an experiment finds.
    let force = talk_to_device::weigh().unwrap();
    assert!((force - 20.0 * 9.80665 - 3.7).abs() < 1.0, "{force} N");
}

/// 16 true values within four standard deviations: by chance one misses in a thousand.
#[test]
fn a_csv_is_identified() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples");
    let answer = identify_csv::identify(&folder.join("bracket.csv")).unwrap();
    let truth = RigFile::load(&folder.join("bracket.rig.toml")).unwrap().truth.unwrap();
    let ([x, y, z], m) = (truth.com_m, truth.mass_kg);
    // Steiner, about the load cell's origin.
    let moved = [y * y + z * z, z * z + x * x, x * x + y * y, -y * z, -z * x, -x * y];
    let tensor = truth.inertia_com_kgm2.iter().zip(moved).map(|(about_com, by)| about_com + m * by);
    let ten = [m, m * x, m * y, m * z].into_iter().chain(tensor);
    let sixteen = ten.chain(truth.apparent_offset_n_nm.unwrap());
    assert_eq!(answer.parameters.len(), 16);
    for (parameter, truth) in answer.parameters.iter().zip(sixteen) {
        let found = parameter.state.measured().unwrap();
        assert!(
            (found.value - truth).abs() < 4.0 / 1.96 * found.u95,
            "{}: {found:?} {truth}",
            parameter.name
        );
    }
}

/// The arm of picks-up.py holds 0.4 kg at (0.30, 0, −0.03) m of its hand from 8 to 11.5 s.
#[test]
fn loads_that_an_arm_picks_up_and_puts_down_are_reported_with_their_size() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples");
    let [recording, model] =
        ["picks-up.csv", "picks-up.urdf"].map(|name| examples.join(name).display().to_string());
    let place = tempfile::tempdir().unwrap();
    let line = ["watch", &recording, "--model", &model, "--link", "hand", "--settle-s", "6", "--json"];
    let output = rigident(place.path(), &line);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let answer = json(&output);
    let changes = answer["changes"].as_array().unwrap();
    assert_eq!(changes.len(), 2, "{answer}");
    for (change, (at_s, sign)) in changes.iter().zip([(8.0, 1.0), (11.5, -1.0)]) {
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        let between = &change["between_s"];
        assert!(number(&between[0]) <= at_s && at_s <= number(&between[1]), "{change}");
        for (name, wanted) in [("mass", 0.4), ("mcx", 0.12), ("mcz", -0.012)] {
            let size = change["size"].as_array().unwrap();
            let entry_found = size.iter().find(|entry| entry["name"] == name).unwrap();
            // Four standard deviations.
            let error = (number(&entry_found["change"]) - sign * wanted).abs();
            assert!(error < 4.0 / 1.96 * number(&entry_found["u95"]), "{name}: {change}");
        }
    }
    let frames = &answer["frames"];
    assert_eq!((&frames["sent"], &frames["taken"], &frames["lost"]), (&864.into(), &864.into(), &0.into()));
}
