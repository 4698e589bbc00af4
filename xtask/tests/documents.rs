//! What the documents say of the project is so.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// Direct dependencies, from crates.io, of every crate in a workspace.
fn direct_dependencies(manifest: &Path) -> BTreeSet<String> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--format-version", "1", "--manifest-path"])
        .arg(manifest)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    packages
        .iter()
        .flat_map(|package| package["dependencies"].as_array().unwrap())
        .filter(|dependency| dependency["path"].is_null())
        .map(|dependency| dependency["name"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn every_direct_dependency_is_explained_and_none_is_explained_that_is_gone() {
    let manifests = ["Cargo.toml", "firmware/boards/mps2-an386/Cargo.toml", "fuzz/Cargo.toml"];
    let used: BTreeSet<String> =
        manifests.iter().flat_map(|manifest| direct_dependencies(&root().join(manifest))).collect();
    let text = std::fs::read_to_string(root().join("docs/dependencies.md")).unwrap();
    let explained: BTreeSet<String> = text
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once('`'))
        .map(|(name, _)| name.to_owned())
        .collect();
    let unexplained: Vec<_> = used.difference(&explained).collect();
    assert!(unexplained.is_empty(), "docs/dependencies.md does not name {unexplained:?}");
    let gone: Vec<_> = explained.difference(&used).collect();
    assert!(gone.is_empty(), "docs/dependencies.md names {gone:?}, which nothing uses");
}

#[test]
fn readme_names_exactly_two_commands_for_a_fresh_machine() {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let first_block: Vec<&str> = readme
        .split("```")
        .nth(1)
        .expect("README has a block of commands")
        .lines()
        .skip(1)
        .map(|line| line.split('#').next().unwrap_or("").trim())
        .filter(|line| !line.is_empty())
        .collect();
    assert_eq!(first_block, ["cargo run --release", "cargo xtask test"]);
}

#[test]
fn continuous_integration_runs_the_second_command_of_readme() {
    let script = std::fs::read_to_string(root().join(".ci/run")).unwrap();
    assert!(script.lines().any(|line| line.starts_with("exec cargo xtask test")), "{script}");
}

#[test]
fn both_licences_are_here() {
    let read = |name: &str| std::fs::read_to_string(root().join(name)).unwrap();
    assert!(read("LICENSE-MIT").starts_with("MIT License"));
    assert!(read("LICENSE-APACHE").contains("Apache License"));
}
