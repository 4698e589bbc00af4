//! Recordings of the laboratory, what is made of them, and how far off it is.

use std::collections::BTreeMap;

use rigident::fit::pool::PooledFactor;
use rigident::fit::tare::Tare;
use rigident::fit::{Fit, FitOptions, Parameter, Silent};
use rigident::problem::body::{BodySource, prepare};
use rigident::problem::{Problem, Subject};

#[path = "laboratory.rs"]
mod laboratory;

pub use laboratory::{Body, Conditions};
use laboratory::{RATE_HZ, Rig, rig_file};

/// Errors in U95 of the ten parameters, and U95.
pub type Errors = Vec<(f64, f64)>;

const TEN: [&str; 10] = ["m", "mcx", "mcy", "mcz", "Ixx", "Iyy", "Izz", "Iyz", "Izx", "Ixy"];

/// Returns what a recording alone says.
pub fn fit(rig: u64, body: &Body, seed: u64, conditions: &Conditions) -> Fit {
    let file = rig_file(&format!("rig {rig}"), conditions.errors);
    let input = prepare::input(
        &file,
        Rig::new(rig, conditions.errors).record(body, seed, conditions),
        false,
        RATE_HZ,
    );
    let source = Box::new(BodySource::new(input, file.imu.first()));
    let subject = Subject::Body { source, gravity_columns: false };
    let problem = Problem::new(&format!("{rig} {seed}"), file, subject);
    problem.fit(&FitOptions::default(), &Silent).unwrap()
}

/// Returns its factor.
pub fn factor(rig: u64, body: &Body, seed: u64, conditions: &Conditions) -> PooledFactor {
    PooledFactor::of(&fit(rig, body, seed, conditions), &format!("{rig} {seed}"))
}

/// Returns the factors of four recordings of a rig, the first with five times the noise that is stated.
pub fn noisy_first(rig: u64, body: &Body, seed: u64) -> Vec<PooledFactor> {
    let conditions = |k: u64| Conditions { noisier: if k == 0 { 5.0 } else { 1.0 }, ..Conditions::STATED };
    (0..4).map(|k| factor(rig, body, seed + k, &conditions(k))).collect()
}

/// Returns how far 0.64 kg on a fixture of 6.4 kg are off, whose own recording is taken off.
pub fn tared(rig: u64, seed: u64) -> Errors {
    let [small, bare, both] = [0.64, 6.4, 7.04].map(Body::of_mass);
    let mut total = fit(rig, &both, seed, &Conditions::STATED);
    let tare = Tare::new(factor(rig, &bare, seed + 1, &Conditions::STATED)).unwrap();
    tare.take_off(&mut total).unwrap();
    off(&total, &small)
}

/// Returns how far a fit is off.
pub fn off(fit: &Fit, body: &Body) -> Errors {
    let truth: BTreeMap<&str, f64> = TEN.into_iter().zip(body.parameters()).collect();
    let own = |(j, p): (usize, &Parameter)| {
        let measured = fit.estimate.measured(j)?;
        Some(((measured.value - truth.get(p.name.as_str())?) / measured.u95, measured.u95))
    };
    fit.parameters.iter().enumerate().filter_map(own).collect()
}

/// Returns the share of truths outside U95.
pub fn outside(all: &[Errors]) -> f64 {
    let of: Vec<f64> = all.iter().flatten().map(|(off, _)| off.abs()).collect();
    of.iter().filter(|off| **off > 1.0).count() as f64 / of.len() as f64
}

/// Returns the root of the mean square of all errors, in standard deviations.
pub fn rms(all: &[Errors]) -> f64 {
    let of: Vec<f64> = all.iter().flatten().map(|(off, _)| (1.96 * off).powi(2)).collect();
    (of.iter().sum::<f64>() / of.len() as f64).sqrt()
}

/// Returns the geometric mean, over all parameters, of U95 by that of others.
pub fn larger(all: &[Errors], others: &[Errors]) -> f64 {
    let of = all.iter().flatten().zip(others.iter().flatten()).map(|(a, b)| (a.1 / b.1).ln());
    let of: Vec<f64> = of.collect();
    (of.iter().sum::<f64>() / of.len() as f64).exp()
}
