//! The wire knows no mathematics, the mathematics no serialisation: read off the sources.

use std::fs;
use std::path::{Path, PathBuf};

const MATHEMATICS: [&str; 15] = [
    "alignment",
    "calibration",
    "conditioning",
    "estimator",
    "factor",
    "forgetting",
    "consistency",
    "inertia",
    "linear_algebra",
    "random",
    "regressor",
    "screening",
    "spatial",
    "tree",
    "whitening",
];
/// Words that only the wire may use.
const SERIALISATION: [&str; 6] = ["serde", "Serialize", "postcard", "cobs", "wire", "Schema"];

fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// Returns the words of the code, comments left out.
fn words(source: &str) -> Vec<&str> {
    source
        .lines()
        .map(|line| line.split_once("//").map_or(line, |(code, _)| code))
        .flat_map(|code| code.split(|c: char| !c.is_alphanumeric() && c != '_'))
        .filter(|word| !word.is_empty())
        .collect()
}

/// Returns words in the code of one side that belong to the other.
fn trespasses(is_wire: bool, source: &str) -> Vec<&str> {
    let words = words(source);
    let forbidden = |at: usize, word: &str| {
        if is_wire {
            word == "nalgebra"
                || word == "Scalar"
                // A field or a variant may well be called like a module; only a path makes a dependency.
                || (MATHEMATICS.contains(&word) && at > 0 && matches!(words[at - 1], "crate" | "super"))
        } else {
            SERIALISATION.contains(&word)
        }
    };
    words.iter().enumerate().filter(|(at, word)| forbidden(*at, word)).map(|(_, word)| *word).collect()
}

#[test]
fn wire_imports_no_mathematics_and_the_mathematics_no_serialisation() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let (mut wire, mut mathematics) = (0, 0);
    for file in files {
        let inside = file.strip_prefix(&root).unwrap();
        if inside == Path::new("lib.rs") {
            continue;
        }
        let is_wire = inside.starts_with("wire");
        *(if is_wire { &mut wire } else { &mut mathematics }) += 1;
        let source = fs::read_to_string(&file).unwrap();
        assert!(
            trespasses(is_wire, &source).is_empty(),
            "{}: {:?}",
            inside.display(),
            trespasses(is_wire, &source)
        );
    }
    assert!(wire >= 4 && mathematics >= MATHEMATICS.len(), "{wire} and {mathematics} files");
}

#[test]
fn every_module_of_the_crate_is_on_one_side() {
    let root = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).unwrap();
    let modules = root.lines().filter_map(|line| {
        line.trim_start_matches("pub ").strip_prefix("mod ").and_then(|rest| rest.strip_suffix(';'))
    });
    for module in modules {
        assert!(
            ["wire", "scalar", "printable"].contains(&module) || MATHEMATICS.contains(&module),
            "{module}"
        );
    }
}

#[test]
fn a_planted_import_is_found() {
    assert_eq!(trespasses(true, "use crate::spatial::Wrench;"), ["spatial"]);
    assert_eq!(trespasses(true, "use nalgebra::Vector3;"), ["nalgebra"]);
    assert_eq!(trespasses(false, "#[derive(serde::Serialize)]"), ["serde", "Serialize"]);
    assert_eq!(trespasses(false, "use crate::wire::Settings;"), ["wire"]);
    assert!(trespasses(false, "//! sent over the wire").is_empty());
    assert!(trespasses(true, "pub calibration: [[f32; 6]; 6], // crate::calibration").is_empty());
}
