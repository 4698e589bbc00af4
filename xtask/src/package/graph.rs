//! The packages that the program is linked of on a system, as cargo resolves them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::places;
use crate::process;

/// The package of the program.
pub const PROGRAM: &str = "rigident-cli";

/// A package that the program holds.
pub struct Part {
    /// The package's name.
    pub name: String,
    /// The package's version.
    pub version: String,
    /// The package's licence, as an SPDX expression.
    pub licence: String,
    /// The address where its sources are published; empty if it does not say.
    pub repository: String,
    /// The folder of its sources here.
    pub folder: PathBuf,
    /// SHA-256 of the published package, from Cargo.lock.
    pub sha256: Option<String>,
}

/// Returns what `cargo metadata` says, for a system or for all.
pub fn metadata(target: Option<&str>) -> Result<Value> {
    let mut command = process::cargo(places::root());
    command.args(["metadata", "--locked", "--format-version", "1"]);
    command.args(target.iter().flat_map(|target| ["--filter-platform", target]));
    Ok(serde_json::from_str(&process::output(&mut command)?)?)
}

/// Returns the packages of others that are linked into the program, by name and version. What only builds or
/// tests is left out.
pub fn parts(target: &str) -> Result<Vec<Part>> {
    let metadata = metadata(Some(target))?;
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let packages: BTreeMap<String, Value> =
        list(&metadata["packages"]).into_iter().map(|package| (text(&package["id"]), package)).collect();
    let nodes: BTreeMap<String, Value> =
        list(&metadata["resolve"]["nodes"]).into_iter().map(|node| (text(&node["id"]), node)).collect();
    let root = packages.iter().find(|(_, package)| package["name"] == PROGRAM);
    let mut open = vec![root.context("rigident-cli is not in the workspace")?.0.clone()];
    let mut found = BTreeSet::new();
    // A macro is run by the compiler, and nothing of it is linked.
    let is_macro = |id: &str| {
        let targets = packages.get(id).map(|package| list(&package["targets"])).unwrap_or_default();
        targets.iter().any(|target| list(&target["kind"]).iter().any(|kind| kind == "proc-macro"))
    };
    while let Some(id) = open.pop() {
        if is_macro(&id) || !found.insert(id.clone()) {
            continue;
        }
        let dependencies = nodes.get(&id).map(|node| list(&node["deps"])).unwrap_or_default();
        let is_linked =
            |dependency: &Value| list(&dependency["dep_kinds"]).iter().any(|kind| kind["kind"].is_null());
        open.extend(dependencies.iter().filter(|d| is_linked(d)).map(|d| text(&d["pkg"])));
    }
    let sums = sums()?;
    let part = |package: &Value| {
        let (name, version) = (text(&package["name"]), text(&package["version"]));
        let manifest = PathBuf::from(text(&package["manifest_path"]));
        Part {
            licence: text(&package["license"]),
            repository: text(&package["repository"]),
            folder: manifest.parent().map(PathBuf::from).unwrap_or_default(),
            sha256: sums.get(&(name.clone(), version.clone())).cloned(),
            name,
            version,
        }
    };
    let others =
        found.iter().filter_map(|id| packages.get(id)).filter(|package| !package["source"].is_null());
    let mut parts: Vec<Part> = others.map(part).collect();
    parts.sort_by(|a, b| (&a.name, &a.version).cmp(&(&b.name, &b.version)));
    Ok(parts)
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

/// Checksums of the lock file by name and version.
fn sums() -> Result<BTreeMap<(String, String), String>> {
    let lock = std::fs::read_to_string(places::root().join("Cargo.lock"))?;
    let mut sums = BTreeMap::new();
    for package in lock.split("[[package]]") {
        let field = |key: &str| {
            let line = package.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(" = "));
            line.map(|line| line.trim_matches('"').to_owned())
        };
        if let (Some(name), Some(version), Some(sum)) = (field("name"), field("version"), field("checksum")) {
            sums.insert((name, version), sum);
        }
    }
    Ok(sums)
}
