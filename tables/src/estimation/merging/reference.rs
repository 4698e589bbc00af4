//! Recordings of a rig that a body of known properties has calibrated before.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rigident::fit::Silent;
use rigident::fit::pool::PooledFactor;
use rigident::problem::{Problem, Subject};
use rigident::reference::{ReferenceBody, Run, calibrate};
use rigident::rig::calibration::CalibratedRig;
use rigident::rig::{RigCalibration, RigFile};

use super::machines::{fitted, recording};
use super::runs::bound::{deviations_calibrated, information};
use super::runs::laboratory::{Rig, rig_file};
use super::runs::{Body, Conditions};
use crate::estimation::Normal;

/// Mass of the reference, kg.
const MASS_KG: f64 = 5.0;
/// 1 σ of its mass, kg, of its centre of mass, m, and of its tensor about that, kg m².
const KNOWN: [f64; 3] = [5e-4, 2e-5, 2e-5];
/// Recordings of the body that is sought.
pub const RUNS: u64 = 4;

/// Returns the body moved by this many standard deviations of each of its ten properties.
fn moved(by: &[f64; 10]) -> Body {
    let nominal = Body::of_mass(MASS_KG);
    let [mass, centre, tensor] = KNOWN;
    let [xx, yy, zz, yz, zx, xy] = std::array::from_fn(|k| tensor * by[4 + k]);
    Body {
        mass: nominal.mass + mass * by[0],
        com: nominal.com + centre * Vector3::new(by[1], by[2], by[3]),
        central: nominal.central + Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz),
    }
}

/// Returns the covariance of its ten parameters beforehand.
fn known() -> DMatrix<f64> {
    let unit = |k: usize, by: f64| moved(&std::array::from_fn(|j| if j == k { by } else { 0.0 }));
    let slope = |k: usize| {
        let [more, less] = [0.5, -0.5].map(|by| DVector::from_row_slice(&unit(k, by).parameters()));
        more - less
    };
    let slopes = DMatrix::from_columns(&(0..10).map(slope).collect::<Vec<_>>());
    &slopes * slopes.transpose()
}

/// Returns the file of the reference.
fn reference() -> ReferenceBody {
    let body = Body::of_mass(MASS_KG);
    let (com, i) = (<[f64; 3]>::from(body.com), body.central);
    let elements = [i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(1, 2)], i[(2, 0)], i[(0, 1)]];
    let [mass, centre, tensor] = KNOWN;
    let text = format!(
        "name = \"reference\"\nmass_kg = {MASS_KG}\nmass_std_kg = {mass}\ndensity_std = 1e-7\n[measured]\n\
         com_m = {com:?}\ncom_std_m = {:?}\ninertia_com_kgm2 = {elements:?}\ninertia_com_std_kgm2 = {:?}\n\
         [place]\nposition_tolerance_m = {:?}\nrotation_tolerance_deg = {:?}\n",
        [centre; 3], [tensor; 6], [1e-7; 3], [1e-5; 3],
    );
    ReferenceBody::parse(&text, "reference.toml").unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Returns the rig file of a rig that a recording of the reference has calibrated; `None` if it was refused.
fn calibrated(rig: &Rig, number: usize, file: &RigFile, seed: u64) -> Option<RigFile> {
    let mut normal = Normal::new(3_000_000 + number as u64);
    let readings = rig.record(&moved(&std::array::from_fn(|_| normal.draw())), seed, &Conditions::STATED);
    let problem = Problem::of_body(recording(file, "reference", readings)).expect("a body");
    let Subject::Body { source, .. } = &problem.subject else { unreachable!("one body") };
    let mounted = reference().mounted(None);
    let run = Run { name: "reference".to_owned(), source, mounted };
    let found = calibrate(&[run], &Silent).map_err(|error| eprintln!("    {error}")).ok()?;
    let units: Vec<String> = found.before.iter().map(|own| own.unit.clone()).collect();
    let known = RigCalibration::of(&found.known, &units, CalibratedRig::of(file).expect("a rig"));
    let mut file = file.clone();
    file.calibrate(RigCalibration { name: format!("rig {number}"), ..known }).expect("a calibration");
    Some(file)
}

/// Returns the factors of recordings of a rig that was calibrated before; none if that was refused.
pub fn factors(number: usize, body: &Body, seed: u64) -> Vec<PooledFactor> {
    let rig = Rig::new(number as u64, &Conditions::STATED);
    let file = rig_file(&format!("rig {number}"), &Conditions::STATED);
    let Some(file) = calibrated(&rig, number, &file, seed + RUNS) else { return Vec::new() };
    let one = |k: u64| {
        let readings = rig.record(body, seed + k, &Conditions::STATED);
        let name = format!("{number} {k}");
        PooledFactor::of(&fitted(&recording(&file, &name, readings), None), &name)
    };
    (0..RUNS).map(one).collect()
}

/// Returns the standard deviations of the best estimate of that.
pub fn best(body: &Body, seed: u64) -> Vec<f64> {
    let runs = (0..RUNS).map(|k| information(body, seed + k, &Conditions::STATED)).collect();
    let of_reference = information(&Body::of_mass(MASS_KG), seed + RUNS, &Conditions::STATED);
    deviations_calibrated(runs, &of_reference, &known())
}
