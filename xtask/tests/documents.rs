//! Checks that the documents' statements about the project are true.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// The workspaces.
const MANIFESTS: [&str; 5] = [
    "Cargo.toml",
    "firmware/boards/mps2-an386/Cargo.toml",
    "firmware/boards/stm32f405/Cargo.toml",
    "firmware/boards/rp2350/Cargo.toml",
    "fuzz/Cargo.toml",
];

/// Returns the packages of a workspace, its members alone or everything it builds on.
fn packages(manifest: &str, scope: &[&str]) -> Vec<serde_json::Value> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--locked", "--format-version", "1"])
        .args(scope)
        .arg("--manifest-path")
        .arg(root().join(manifest))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

/// Returns the direct dependencies, from crates.io, of every crate in a workspace.
fn direct_dependencies(manifest: &str) -> BTreeSet<String> {
    packages(manifest, &["--no-deps"])
        .iter()
        .flat_map(|package| package["dependencies"].as_array().unwrap())
        .filter(|dependency| dependency["path"].is_null())
        .map(|dependency| dependency["name"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn every_direct_dependency_is_explained_and_none_is_explained_that_is_gone() {
    let used: BTreeSet<String> =
        MANIFESTS.iter().flat_map(|manifest| direct_dependencies(manifest)).collect();
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

/// Returns the licences that `deny.toml` allows.
fn allowed() -> BTreeSet<String> {
    let text = std::fs::read_to_string(root().join("deny.toml")).unwrap();
    let (_, list) = text.split_once("\nallow = [").expect("deny.toml allows licences");
    let (list, _) = list.split_once(']').unwrap();
    list.split('"').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Tells whether we may ship under MIT OR Apache-2.0 what is under this licence: of every part that must
/// hold, one choice.
fn is_acceptable(licence: &str) -> bool {
    let allowed = allowed();
    licence
        .replace('/', " OR ")
        .split(" AND ")
        .all(|part| part.trim_matches(['(', ')']).split(" OR ").any(|choice| allowed.contains(choice.trim())))
}

#[test]
fn licences_are_judged_by_their_expression() {
    assert!(is_acceptable("MIT/Apache-2.0"));
    assert!(is_acceptable("(MIT OR Apache-2.0) AND Unicode-3.0"));
    assert!(is_acceptable("LGPL-2.1-or-later OR MIT"));
    assert!(!is_acceptable("GPL-3.0-only"));
    assert!(!is_acceptable("MIT AND GPL-3.0-only"));
}

#[test]
fn every_package_is_under_a_licence_we_can_ship() {
    for manifest in MANIFESTS {
        for package in packages(manifest, &["--filter-platform", "x86_64-unknown-linux-gnu"]) {
            let licence = package["license"].as_str().unwrap_or("none");
            assert!(is_acceptable(licence), "{} is under {licence}", package["name"]);
        }
    }
}

/// Pins of the board crate: name, then port and number.
fn pins_of_the_board() -> BTreeSet<(String, String)> {
    let text = std::fs::read_to_string(root().join("firmware/boards/stm32f405/src/pins.rs")).unwrap();
    text.lines()
        .filter_map(|line| line.strip_prefix("pub const ")?.split_once(": Pin = Pin::"))
        .map(|(name, pin)| {
            let (port, number) = pin.strip_suffix(");").unwrap().split_once('(').unwrap();
            (name.to_owned(), format!("P{}{number}", port.to_uppercase()))
        })
        .collect()
}

#[test]
fn the_wiring_page_and_its_drawing_have_the_pins_of_the_board() {
    let pins = pins_of_the_board();
    assert_eq!(pins.len(), 11);
    let page = std::fs::read_to_string(root().join("docs/wiring.md")).unwrap();
    let table: BTreeSet<(String, String)> = page
        .lines()
        .filter_map(|line| line.strip_prefix("| P")?.split_once(" | `"))
        .map(|(pin, rest)| (rest.split_once('`').unwrap().0.to_owned(), format!("P{pin}")))
        .collect();
    assert_eq!(table, pins);
    let drawing = std::fs::read_to_string(root().join("docs/images/wiring.svg")).unwrap();
    for (name, pin) in &pins {
        assert!(
            drawing.contains(&format!(">{pin}<")) || drawing.contains(&format!(">{pin} ")),
            "{pin} {name}"
        );
    }
    let different: BTreeSet<&String> = pins.iter().map(|(_, pin)| pin).collect();
    assert_eq!(different.len(), pins.len(), "two names for one pin");
}

/// Parts add up to what the page says, and to what was promised.
#[test]
fn the_parts_of_the_wiring_page_cost_less_than_200() {
    let page = std::fs::read_to_string(root().join("docs/wiring.md")).unwrap();
    let table = page.split("| part |").nth(1).unwrap().split("\n\n").next().unwrap();
    let price = |line: &str| line.rsplit('|').nth(1).and_then(|cell| cell.trim().parse::<u32>().ok());
    let (all, parts): (Vec<&str>, Vec<&str>) = table.lines().partition(|line| line.contains("in all"));
    let sum: u32 = parts.iter().filter_map(|line| price(line)).sum();
    assert!(all[0].contains(&format!("**{sum}**")) && sum < 200, "{sum}: {}", all[0]);
}

/// The bridges stay inside the converter's range, and the lower half of the budget follows from the upper
/// half.
#[test]
fn the_budget_of_the_wiring_page_follows_from_its_data_sheets_and_keeps_the_converters_limits() {
    let page = std::fs::read_to_string(root().join("docs/wiring.md")).unwrap();
    let table = page.split("| budget | value |").nth(1).unwrap().split("\n\n").next().unwrap();
    let cell = |name: &str| {
        let line = table.lines().find(|line| line.starts_with(&format!("| {name} |"))).expect(name);
        line.split('|').nth(2).unwrap().trim().to_owned()
    };
    let number = |name: &str| cell(name).split(' ').next().unwrap().parse::<f64>().unwrap();
    let gain = number("gain of the firmware");
    let firmware = std::fs::read_to_string(root().join("firmware/src/instrument.rs")).unwrap();
    assert!(firmware.contains(&format!("const GAIN: u8 = {gain};")));
    let (most_v, v) = (number("excitation, at most"), number("excitation"));
    let (avdd_v, sensitivity, load_n) =
        (number("AVDD, at least"), 1e-3 * number("sensitivity"), number("full load"));
    let noise_v = 1e-6 * number("noise at gain 64, 1 kHz");
    let by_division = 1e-6 * number("noise at gain 1, 1 kHz") / number("divided excitation");
    // A bar of 1 kΩ.
    let computed = [
        ("highest input, limit", format!("{:.3} V", avdd_v - 1.8)),
        ("highest input, at full load", format!("{:.3} V", most_v / 2.0 + sensitivity * most_v / 2.0)),
        ("largest signal, limit", format!("{:.2} mV", 1.2e3 / gain)),
        ("largest signal", format!("{:.2} mV", 1e3 * sensitivity * most_v)),
        ("noise of a sample of one bar", format!("{:.4} N", noise_v / (sensitivity * v) * load_n)),
        ("of this, by the division, at full load", format!("{:.4} N", by_division * load_n)),
        ("excitation of six bars", format!("{:.1} mA", 6.0 * v)),
    ];
    for (name, value) in &computed {
        assert_eq!(cell(name), *value, "{name}");
    }
    assert!(number("highest input, at full load") < number("highest input, limit"));
    assert!(number("largest signal") < number("largest signal, limit"));
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
