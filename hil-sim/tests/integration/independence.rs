//! The simulator is the estimator's oracle, so its physics must not share code with it.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules that make up the physics, with everything below them.
const PHYSICS: [&str; 6] = ["devices", "link", "links", "rig", "sensors", "suspension"];

/// Returns the lines of code (not comments) that reach into the crates the firmware is made of.
fn offences(source: &str) -> Vec<&str> {
    source
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .filter(|line| {
            ["rigident_shared", "rigident_firmware", "regressor", "estimator"]
                .iter()
                .any(|w| line.contains(w))
        })
        .collect()
}

fn sources(path: &Path, found: &mut Vec<PathBuf>) {
    if path.is_dir() {
        for entry in fs::read_dir(path).unwrap() {
            sources(&entry.unwrap().path(), found);
        }
    } else if path.extension().is_some_and(|e| e == "rs") {
        found.push(path.to_owned());
    }
}

#[test]
fn physics_modules_do_not_use_the_estimators_crates() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for module in PHYSICS {
        let mut files = Vec::new();
        sources(&root.join(format!("{module}.rs")), &mut files);
        let folder = root.join(module);
        if folder.exists() {
            sources(&folder, &mut files);
        }
        assert!(!files.is_empty(), "no sources of {module}");
        for file in files {
            let text = fs::read_to_string(&file).unwrap();
            assert_eq!(offences(&text), Vec::<&str>::new(), "{}", file.display());
        }
    }
}

#[test]
fn the_platforms_mechanics_do_not_use_the_estimators_crates() {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../hexapod/src"), &mut files);
    assert!(!files.is_empty(), "no sources of hexapod");
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        assert_eq!(offences(&text), Vec::<&str>::new(), "{}", file.display());
    }
}

#[test]
fn the_scan_catches_a_planted_offender() {
    let planted = "//! The regressor may be spoken of.\nuse rigident_shared::regressor::block;\n";
    assert_eq!(offences(planted), ["use rigident_shared::regressor::block;"]);
}
