//! Gains of an arm whose efforts are currents: forces by Newton and Euler about the centres of mass, each
//! over a gain of its own.

use std::path::{Path, PathBuf};

use super::*;
use crate::application::{Identified, IdentifyOptions, identify};
use rigident_laboratory::arm::{ArmRun, csv};
use rigident_laboratory::trees::seven_axes;
use rigident_model::write::generated;
use rigident_model::xml::Language;

/// N m/A.
const GAINS: [f64; 7] = [13.2, -12.6, 12.9, 9.4, 9.1, 6.0, 6.3];
const LINK: &str = "l7@0.02,-0.01,0.1";
const FRICTION: &str = "viscous,coulomb,offset";

/// Ten parameters of a cuboid of 0.1 × 0.16 × 0.24 m about a corner of the flange.
fn load(mass_kg: f64) -> [f64; 10] {
    let c = [0.02, 0.03, 0.08];
    let half = [0.05, 0.08, 0.12];
    let square = |k: usize| mass_kg * (half[k] * half[k] / 3.0 + c[k] * c[k]);
    let [x, y, z] = [square(0), square(1), square(2)];
    let of = |i: usize, j: usize| -mass_kg * c[i] * c[j];
    let first = c.map(|v| mass_kg * v);
    [mass_kg, first[0], first[1], first[2], y + z, x + z, x + y, of(1, 2), of(2, 0), of(0, 1)]
}

/// Returns a recording of torques, dry friction of which grows by a share of the load.
fn torques(mass_kg: f64, motion: usize, share: f64) -> Recording {
    let mut model = seven_axes();
    if mass_kg > 0.0 {
        model.hold_tool(LINK).unwrap();
        model.links.last_mut().unwrap().nominal = Some(load(mass_kg));
    }
    let run = ArmRun {
        load: share,
        motion,
        motion_s: 12.0,
        rate_hz: 100.0,
        rest_s: 0.0,
        effort_noise: 0.05,
        seed: motion as u64 + 5,
        rate_noise: 1e-4,
        slip: 0.02,
        ..ArmRun::default()
    };
    run.recording(&model)
}

/// Writes torques as currents, under the names of currents or of torques.
fn written(folder: &Path, name: &str, mut recording: Recording, unit: &str) -> PathBuf {
    let efforts = recording.extra.iter_mut().filter(|(name, _)| name.ends_with("_nm"));
    for ((name, cells), gain) in efforts.zip(GAINS) {
        *name = name.replace("_nm", unit);
        for cell in cells {
            *cell = format!("{:e}", cell.parse::<f64>().unwrap() / gain);
        }
    }
    let path = folder.join(name).with_extension("csv");
    std::fs::write(&path, csv(&recording)).unwrap();
    path
}

/// Writes a recording of currents, under the names of currents or of torques.
fn record(folder: &Path, name: &str, mass_kg: f64, motion: usize, unit: &str) -> PathBuf {
    written(folder, name, torques(mass_kg, motion, 0.0), unit)
}

/// Writes the model, each of its links off by some per cent.
fn tree(folder: &Path) -> Tree {
    heavier(folder, 1.0)
}

/// Writes the model that many times as heavy, each of its links off by some per cent more.
fn heavier(folder: &Path, times: f64) -> Tree {
    let mut model = seven_axes();
    for (k, link) in model.links.iter_mut().enumerate() {
        let by = times * (1.0 + 0.12 * (7.0 * k as f64).sin());
        link.nominal = link.nominal.map(|phi| phi.map(|v| v * by));
    }
    let path = folder.join("arm.urdf");
    std::fs::write(&path, generated(&model, Language::Urdf).unwrap()).unwrap();
    Tree { model: Some(path.display().to_string()), ..Tree::default() }
}

fn options(folder: &Path) -> DriveGainOptions {
    DriveGainOptions {
        tree: tree(folder),
        friction: Friction::parse(&[FRICTION]).unwrap(),
        ..DriveGainOptions::default()
    }
}

fn known(statements: &[&str]) -> KnownValues {
    let all: Vec<String> = statements.iter().map(|s| (*s).to_owned()).collect();
    KnownValues::parse(&all, &[]).unwrap()
}

/// A load that is weighed tells every gain, and the rig file with them the mass of another load.
#[test]
fn gains_by_a_known_load_weigh_another() {
    let folder = tempfile::tempdir().unwrap();
    let bare = record(folder.path(), "bare", 0.0, 0, "_a");
    let loaded = record(folder.path(), "loaded", 4.0, 1, "_a");
    let mut options = options(folder.path());
    options.loaded = Some((loaded, LINK.to_owned()));
    options.known = known(&["mass_kg=4.000±0.004"]);
    let found = drive_gains(std::slice::from_ref(&bare), &options, &Caller::default()).unwrap();
    let over = |(drive, gain): (&DriveGain, f64)| (drive.gain - gain) / drive.u95;
    let errors: Vec<f64> = found.drives.iter().zip(GAINS).map(over).collect();
    let widths: Vec<f64> =
        found.drives.iter().zip(GAINS).map(|(drive, gain)| drive.u95 / gain.abs()).collect();
    println!("{} rounds, errors over U95 {errors:.2?}, U95 {widths:.4?}, {:?}", found.rounds, found.warnings);
    assert!(found.drives.iter().filter(|drive| drive.is_identified).count() >= 5, "{widths:.3?}");
    assert!(errors.iter().all(|error| error.abs() < 1.6), "{errors:.2?}");

    // Without a load gains have ratios alone, and the rig file no scale.
    (options.known, options.loaded) = (KnownValues::default(), None);
    let ratios = drive_gains(std::slice::from_ref(&bare), &options, &Caller::default()).unwrap();
    assert!(ratios.drives.iter().all(|drive| !drive.is_identified), "{:?}", ratios.drives);
    let to = ratios.reference.unwrap();
    let known_ratios: Vec<f64> = ratios
        .drives
        .iter()
        .zip(GAINS)
        .filter_map(|(drive, gain)| drive.ratio.map(|(value, u95)| (value - gain / GAINS[to]) / u95))
        .collect();
    println!("ratios off, over U95 {known_ratios:.2?}");
    assert!(known_ratios.len() >= 3 && known_ratios.iter().all(|e| e.abs() < 1.6), "{known_ratios:.2?}");
    assert!(ratios.rig.joint.is_empty(), "{:?}", ratios.rig.joint);

    assert!(found.is_complete(), "{widths:.3?}");
    let part = record(folder.path(), "part", 1.5, 2, "_a");
    for path in [&bare, &part] {
        std::fs::write(path.with_extension("rig.toml"), found.rig.to_toml()).unwrap();
    }
    let by_gains = IdentifyOptions {
        tree: options.tree.clone(),
        friction: options.friction.clone(),
        tare: vec![crate::application::Fixture::File(bare)],
        payload: Some(LINK.to_owned()),
        ..IdentifyOptions::default()
    };
    let Identified { answer, .. } = identify(part.into(), &by_gains, &Caller::default()).unwrap();
    let (mass, u95) = (answer.mass_kg.unwrap(), answer.parameters[0].state.measured().unwrap().u95);
    println!("{mass} ± {u95} kg of 1.5");
    assert!((mass - 1.5).abs() < 1.6 * u95 && u95 < 0.15, "{mass} ± {u95}");
}

/// A nominal model of a robot half as heavy makes gains a bad first guess: that accuses no known load. Dry
/// friction that grows with the load takes no part in gains.
#[test]
fn a_known_load_is_judged_by_the_gains_found() {
    let folder = tempfile::tempdir().unwrap();
    let bare = written(folder.path(), "bare", torques(0.0, 0, 0.08), "_a");
    let loaded = written(folder.path(), "loaded", torques(4.0, 1, 0.08), "_a");
    let options = DriveGainOptions {
        tree: heavier(folder.path(), 0.5),
        loaded: Some((loaded, LINK.to_owned())),
        known: known(&["mass_kg=4.000±0.004"]),
        ..options(folder.path())
    };
    let found = drive_gains(&[bare], &options, &Caller::default()).unwrap();
    let over = |(drive, gain): (&DriveGain, f64)| (drive.gain - gain) / drive.u95;
    let errors: Vec<f64> = found.drives.iter().zip(GAINS).map(over).collect();
    println!("{} rounds, errors over U95 {errors:.2?}, {:?}", found.rounds, found.warnings);
    assert!(found.drives.iter().filter(|drive| drive.is_identified).count() >= 5, "{:?}", found.drives);
    assert!(errors.iter().all(|error| error.abs() < 1.6), "{errors:.2?}");
}

/// With and without a load an arm differs by the load, though gears rub more under it.
#[test]
fn gears_that_rub_more_under_a_payload_make_no_other_arm() {
    let folder = tempfile::tempdir().unwrap();
    let [bare, loaded] = [("bare", 0.0, 0), ("with", 4.0, 1)].map(|(name, mass_kg, motion)| {
        let path = folder.path().join(name).with_extension("csv");
        std::fs::write(&path, csv(&torques(mass_kg, motion, 0.08))).unwrap();
        path
    });
    let by_torques = IdentifyOptions {
        tree: tree(folder.path()),
        friction: Friction::parse(&[FRICTION]).unwrap(),
        tare: vec![crate::application::Fixture::File(bare)],
        payload: Some(LINK.to_owned()),
        ..IdentifyOptions::default()
    };
    let Identified { answer, .. } = identify(loaded.into(), &by_torques, &Caller::default()).unwrap();
    let said = answer.warnings.join(" ");
    assert!(!said.contains("with and without the payload the arm differs"), "{said}");
    let wanted = load(4.0);
    let measured = answer.parameters.iter().zip(wanted).filter_map(|(own, wanted)| {
        let found = own.state.measured()?;
        Some((found.value - wanted) / found.u95)
    });
    let errors: Vec<f64> = measured.collect();
    println!("{errors:.2?}");
    assert!(errors.len() >= 4 && errors.iter().all(|error| error.abs() < 1.8), "{errors:.2?}");
}

/// Currents under the names of torques are named as what they are, not as a unit.
#[test]
fn currents_given_as_torques_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = record(folder.path(), "arm", 0.0, 0, "_nm");
    let options = IdentifyOptions {
        tree: tree(folder.path()),
        friction: Friction::parse(&[FRICTION]).unwrap(),
        ..IdentifyOptions::default()
    };
    let Identified { answer, .. } = identify(path.into(), &options, &Caller::default()).unwrap();
    let cause = answer.cause.clone().unwrap_or_else(|| panic!("{:?} {:?}", answer.status, answer.warnings));
    println!("{cause:?}");
    assert!(cause.what.contains("motor currents"), "{cause:?}");
    assert_eq!(answer.status, Status::Implausible);
}
