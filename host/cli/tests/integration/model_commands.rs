//! `rigident model` as a user types it.

use std::path::Path;

use serde_json::Value;

use crate::program::rigident;

fn base_params(folder: &Path, arguments: &[&str]) -> Value {
    let words: Vec<&str> =
        ["model", "base-params"].iter().chain(arguments).copied().chain(["--json"]).collect();
    let output = rigident(folder, &words);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

const TWO_LINKS: &str = r#"
[[link]]
name = "base"
[[link]]
name = "arm"
parent = "base"
joint = "spherical"
position_m = [0.03, 0.0, 0.065]
"#;

#[test]
fn people_and_rig_files_are_counted_and_every_term_is_a_standard_parameter() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("two.rig.toml"), TWO_LINKS).unwrap();
    for (words, standard, count) in [
        (&["human34"][..], 150, 128),
        (&["human58"], 230, 200),
        (&["human34", "--tool", "r_hand@0,0,-0.3", "--height-m", "1.6", "--segment", "thigh=0.4"], 150, 128),
        (&["human34", "--rows", "both"], 150, 128),
        (&["two.rig.toml", "--floating"], 20, 19),
    ] {
        let found = base_params(place.path(), words);
        assert_eq!((&found["standard"], &found["count"]), (&standard.into(), &count.into()), "{words:?}");
        let parameters = found["parameters"].as_array().unwrap();
        assert_eq!(parameters.len(), count);
        for parameter in parameters {
            assert!(parameter["name"].is_string());
            for term in parameter["terms"].as_array().unwrap() {
                let name = term[0].as_str().unwrap();
                let (_, quantity) = name.rsplit_once('.').unwrap();
                assert!(rigident_shared::inertia::PARAMETER_NAMES[..10].contains(&quantity), "{name}");
                assert!(term[1].as_f64().is_some_and(f64::is_finite));
            }
        }
    }
}

#[test]
fn the_text_says_which_situation_it_is_and_how_sure_the_rank() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("two.rig.toml"), TWO_LINKS).unwrap();
    let said = |words: &[&str]| {
        let output = rigident(place.path(), words);
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let still = said(&["model", "base-params", "two.rig.toml", "--rows", "base"]);
    assert!(still.contains("held still") && still.contains("do not identify"), "{still}");
    let moving = said(&["model", "base-params", "two.rig.toml", "--floating"]);
    assert!(moving.contains("19 base parameters of 20") && moving.contains("singular values"), "{moving}");
    assert!(moving.contains("base.M = base.m + arm.m"), "{moving}");
}

#[test]
fn models_that_cannot_be_used_end_with_status_two_and_say_why() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    std::fs::write(
        at.join("loop.urdf"),
        "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/>\
        <joint name=\"ab\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>\
        <joint name=\"ba\" type=\"fixed\"><parent link=\"b\"/><child link=\"a\"/></joint></robot>",
    )
    .unwrap();
    std::fs::write(at.join("text.urdf"), "no robot").unwrap();
    for (words, why) in [
        (&["human35"][..], "human34 and human58"),
        (&["loop.urdf"], "make a loop"),
        (&["text.urdf"], "no <robot>"),
        (&["human34", "--tool", "tail"], "there is no link tail"),
        (&["human34", "--segment", "thigh"], "NAME=METRES"),
        (&["human34", "--height-m", "-1"], "people's is 0.4 to 2.8 m"),
        (&["human34", "--lock", "tail"], "has no joint tail"),
    ] {
        let words: Vec<&str> = ["model", "base-params"].iter().chain(words).copied().collect();
        let output = rigident(at, &words);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{words:?}: {said}");
        assert!(said.contains(why), "{words:?}: {said}");
        assert!(output.stdout.is_empty());
    }
}
