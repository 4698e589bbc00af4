//! The program without the simulated rig:
//! `cargo test -p rigident-cli --no-default-features --test integration`.
#![cfg(not(feature = "simulator"))]

use crate::program::rigident_anywhere as rigident;

#[test]
fn commands_for_the_simulated_rig_are_refused_with_the_feature_that_brings_it() {
    let recording = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/two-links.csv");
    for arguments in [&["demo"][..], &[], &["montecarlo"], &["replay", recording, "--mcu", "inproc"]] {
        let out = rigident(arguments);
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains("feature `simulator`"), "{arguments:?}: {said}");
    }
}

#[test]
fn the_help_names_features_missing_in_this_build() {
    let help = rigident(&["--help"]);
    let text = String::from_utf8_lossy(&help.stdout);
    let line = |command: &str| text.lines().find(|l| l.trim_start().starts_with(command)).unwrap().to_owned();
    for missing in ["demo", "montecarlo"] {
        assert!(line(missing).contains("feature `simulator`"), "{text}");
    }
    for there in
        ["identify", "run", "plan", "workspace", "factor", "merge", "solve", "convert", "ports", "model"]
    {
        assert!(!line(there).contains("simulator"), "{text}");
    }
}

#[test]
fn identifying_and_planning_need_no_simulated_rig() {
    let recording = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/two-links.csv");
    let folder = tempfile::tempdir().unwrap();
    let out = rigident(&["identify", recording, "--out", folder.path().join("a").to_str().unwrap()]);
    assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
    let out = rigident(&["plan", "poses", "--n", "3", "--json"]);
    assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
}
