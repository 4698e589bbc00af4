//! The changes that a student makes: a body of one's own, its noise, the ten steps, and the estimator in
//! one's own firmware.
#![cfg(feature = "simulator")]

use serde_json::Value;

use crate::program::{complaint, json, parameter, rigident, said, status};

/// Four standard deviations: by chance one of ten numbers misses in a thousand runs.
#[track_caller]
fn near(result: &Value, name: &str, truth: f64) {
    let found = parameter(result, name);
    let (value, u95) = (found["value"].as_f64().unwrap(), found["u95"].as_f64().unwrap());
    assert!((value - truth).abs() < 4.0 / 1.96 * u95, "{name}: {value} ± {u95}, {truth}");
}

#[test]
fn a_body_of_ones_own_is_identified_and_noise_widens_its_intervals() {
    let place = tempfile::tempdir().unwrap();
    let body = ["--mass", "3kg", "--com", "0,10,50mm", "--inertia", "600,500,400kgcm2", "--duration-s", "20"];
    let run = |name: &str, more: &[&str]| {
        let words = [&["demo", "--json", "--out", name], &body[..], more].concat();
        let output = rigident(place.path(), &words);
        assert!(matches!(status(&output), 0 | 1), "{}", said(&output));
        json(&output)
    };
    let (quiet, loud) = (run("quiet", &[]), run("loud", &["--noise", "3"]));
    for result in [&quiet, &loud] {
        for (name, truth) in [("m", 3.0), ("mcx", 0.0), ("mcy", 0.03), ("mcz", 0.15)] {
            near(result, name, truth);
        }
    }
    // Steiner: 3 kg at (0, 0.01, 0.05) m. With three times the noise no tensor is identified.
    near(&quiet, "Ixx", 0.06 + 3.0 * (0.01 * 0.01 + 0.05 * 0.05));
    near(&quiet, "Izz", 0.04 + 3.0 * 0.01 * 0.01);
    assert!(parameter(&loud, "Ixx").get("value").is_none());
    let u95 = |result: &Value| parameter(result, "m")["u95"].as_f64().unwrap();
    let ratio = u95(&loud) / u95(&quiet);
    assert!((2.0..4.0).contains(&ratio), "{ratio}");
}

#[test]
fn impossible_bodies_are_refused() {
    let place = tempfile::tempdir().unwrap();
    for (words, said) in [
        (&["--mass", "1", "--inertia", "1,1,5"][..], "no body has this tensor"),
        (&["--mass", "400"], "carries 40 kg"),
        (&["--mass", "-3"], "greater than zero"),
        (&["--com", "0,0,0"], "--mass"),
        (&["--mass", "1", "--com", "0,0"], "3 numbers"),
        (&["--noise", "0"], "greater than zero"),
        (&["--noise", "2", "--body", "two-links"], "of one body"),
    ] {
        let output = rigident(place.path(), &[&["demo"], words].concat());
        let complaint = complaint(&output);
        assert!(complaint.contains(said), "{words:?}: {complaint}");
    }
}

#[test]
fn ten_steps_lead_to_a_mass_near_that_of_the_answer() {
    let place = tempfile::tempdir().unwrap();
    let output = rigident(place.path(), &["demo", "--explain", "--duration-s", "20", "--out", "out"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    for step in 1..=10 {
        assert!(text.lines().any(|line| line.starts_with(&format!("{step:2}. "))), "{step}: {text}");
    }
    let (_, after) = text.split_once("covariance: m = ").unwrap();
    let mut words = after.split(' ');
    let mass: f64 = words.next().unwrap().parse().unwrap();
    let u95: f64 = words.nth(1).unwrap().parse().unwrap();
    assert!((mass - 20.0).abs() < 3.0 * u95, "{mass} ± {u95}");
}
