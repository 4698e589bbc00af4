//! The tutorials' commands, run as they are typed, one after the other, beside the examples.
#![cfg(feature = "simulator")]

use std::path::Path;

use super::document;
use crate::program::{rigident, said, status};

/// The commands of a tutorial: the lines of its blocks of shell.
fn commands(text: &str) -> Vec<Vec<String>> {
    let blocks = text.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next());
    let lines = blocks.flat_map(str::lines);
    lines.map(|line| line.split(' ').map(str::to_owned).collect()).collect()
}

/// Follows a tutorial in a folder that has the examples.
fn follow(name: &str) {
    let place = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples");
    for entry in std::fs::read_dir(examples).unwrap() {
        let path = entry.unwrap().path();
        std::fs::copy(&path, place.path().join(path.file_name().unwrap())).unwrap();
    }
    let commands = commands(&document(&format!("docs/tutorials/{name}.md")));
    assert!(commands.len() >= 2, "{commands:?}");
    for words in commands {
        assert_eq!(words[0], "rigident");
        let arguments: Vec<&str> = words[1..].iter().map(String::as_str).collect();
        let output = rigident(place.path(), &arguments);
        assert_eq!(status(&output), 0, "{}: {}", words.join(" "), said(&output));
        assert!(!output.stdout.is_empty(), "{}", words.join(" "));
    }
}

#[test]
fn who_tests_parts_gets_through() {
    follow("part");
}

#[test]
fn who_has_a_robot_gets_through() {
    follow("robot");
}

#[test]
fn who_studies_people_gets_through() {
    follow("person");
}

#[test]
fn who_builds_a_rig_gets_through() {
    follow("rig");
}

#[test]
fn who_learns_gets_through() {
    follow("student");
}
