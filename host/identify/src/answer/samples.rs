//! Fits and answers of a body, trees and a run that broke off, for the tests of this crate and of those that
//! show answers.
#![allow(dead_code, reason = "each crate's tests use a part of it")]
#![allow(missing_docs, reason = "for tests")]

use nalgebra::{Matrix3, Vector3};
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::inertia::{InertialParameters, tensor_from_elements};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, Position, Sensor, SpecificForce, Wrench};

use rigident_fit::{Fit, FitOptions, Silent, fit};
use rigident_identify::answer::result::{Answer, Source};
use rigident_identify::answer::{Context, Links, StandardRequest};
use rigident_identify::problem::{Problem, ProblemOptions};
use rigident_io::recording::Recording;
use rigident_io::rig::{BodyTable, RigFile, TruthTable};
use rigident_laboratory::trees::{person_recording, two_link_recording, two_links};
use rigident_model::Model;
use rigident_rows::body::{BodySource, Input};
use rigident_rows::tree::drive::Friction;

pub fn rig() -> RigFile {
    RigFile {
        body: Some(BodyTable {
            name: "bracket".to_owned(),
            position_m: [0.01, 0.0, 0.02],
            rotation_wxyz: [0.9, 0.1, -0.3, 0.2],
        }),
        truth: Some(TruthTable {
            mass_kg: 3.2,
            com_m: [0.01, -0.02, 0.05],
            inertia_com_kgm2: [0.02, 0.025, 0.015, 0.001, -0.002, 0.0005],
            apparent_offset_n_nm: Some([1.0, -2.0, 0.5, 0.1, 0.02, -0.03]),
        }),
        ..RigFile::default()
    }
}

pub fn body() -> InertialParameters<Sensor, f64> {
    let truth = rig().truth.unwrap();
    InertialParameters::from_centre_of_mass(
        truth.mass_kg,
        Position::from_array(truth.com_m),
        tensor_from_elements(truth.inertia_com_kgm2),
    )
}

/// Readings by the equations of Newton and Euler; `size` scales the rates.
pub fn readings(count: usize, rate_hz: f64, size: f64, noise: f64) -> Vec<Reading<f64>> {
    let (phi, offset) = (body(), rig().truth.unwrap().apparent_offset_n_nm.unwrap());
    let (mass, mc) = (phi.mass, phi.first_moment);
    let tensor: Matrix3<f64> = phi.inertia;
    let mut state = 7_u64;
    let mut normal = move || {
        let mut sum = -6.0;
        for _ in 0..12 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (state >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    };
    (0..count)
        .map(|row| {
            let t = row as f64 / rate_hz;
            let wave = |k: usize, order: i32| -> f64 {
                (0..3)
                    .map(|n| {
                        let w = 2.0 + 1.7 * f64::from(n) + 0.31 * k as f64;
                        let (sin, cos) = (w * t + k as f64).sin_cos();
                        if order == 0 { sin } else { w * cos }
                    })
                    .sum()
            };
            let rate = Vector3::from_fn(|k, _| size * wave(k, 0));
            let change = Vector3::from_fn(|k, _| size * wave(k, 1));
            let force = Vector3::new(2.0 * wave(4, 0), 2.0 * wave(5, 0), 9.8 + wave(6, 0));
            let push = force * mass + change.cross(&mc) + rate.cross(&rate.cross(&mc));
            let turn = mc.cross(&force) + tensor * change + rate.cross(&(tensor * rate));
            let wrench = std::array::from_fn(|c| {
                let truth = if c < 3 { push[c] } else { turn[c - 3] };
                truth + offset[c] + noise * if c < 3 { 1.0 } else { 0.1 } * normal()
            });
            Reading {
                time_ns: (t * 1e9).round() as u64,
                wrench: Wrench::from_array(wrench),
                specific_force: SpecificForce::from_array(force.into()),
                angular_rate: AngularRate::from_array(rate.into()),
            }
        })
        .collect()
}

pub fn input(readings: Vec<Reading<f64>>, is_static: bool, sigma: Option<f64>) -> Input {
    Input {
        readings,
        is_static,
        rate_hz: 200.0,
        mounting: ImuMounting::default(),
        channel_sigma: sigma.map(|s| std::array::from_fn(|c| if c < 3 { s } else { 0.1 * s })),
        gyro_sigma: Some(1e-4),
        known_offset: None,
        nuisances: Vec::new(),
        rests: Vec::new(),
        beforehand: None,
        limits: Limits::none(),
    }
}

pub fn source() -> Source {
    Source {
        recording: "walk".to_owned(),
        recorded: None,
        rows: 4000,
        rate_hz: Some(200.0),
        duration_s: Some(20.0),
        mcu: "host".to_owned(),
    }
}

pub fn of_body(input: &Input) -> Fit {
    fit(&BodySource::new(input.clone(), None), &FitOptions::default(), &Silent).unwrap()
}

/// Returns the fit of a tree with its answer.
pub fn of_tree(model: &Model, recording: &Recording) -> (Fit, Answer) {
    with_friction(model, recording, &[])
}

/// Returns the same with columns of friction.
pub fn with_friction(model: &Model, recording: &Recording, lists: &[&str]) -> (Fit, Answer) {
    let friction = Friction::parse(lists).unwrap();
    let options = ProblemOptions { friction, ..ProblemOptions::default() };
    let problem = Problem::from_recording(recording, Some(model), &options).unwrap();
    let fit = problem.fit(&FitOptions::default(), &Silent).unwrap();
    let tree = problem.tree().unwrap();
    let input = tree.input();
    let links = Links {
        model: &input.model,
        base: tree.base(),
        situation: input.situation,
        drives: tree.drive_motions(),
        as_stated: &[],
        idle: Vec::new(),
        beyond: Vec::new(),
        standard: Some(StandardRequest { nominal: model, trust: 1.0, symmetric: false, required: false }),
    };
    let context =
        Context { links: Some(links), source: source(), rate_sigma: input.rate_sigma, ..Context::default() };
    let answer = Answer::new(&fit, context).unwrap();
    (fit, answer)
}

/// Returns fits with their answers: one body, two links, a person, a run that broke off.
pub fn samples() -> Vec<(&'static str, Fit, Answer)> {
    let of_body_ = |seconds: usize, size: f64, error: Option<&str>| {
        let input = input(readings(200 * seconds, 200.0, size, 0.5), false, None);
        let fit = of_body(&input);
        let rig = rig();
        let context = Context {
            body: rig.body.as_ref(),
            truth: rig.truth.as_ref(),
            source: source(),
            error: error.map(str::to_owned),
            notes: vec!["rows at rest were not used for the friction".to_owned()],
            warnings: error.iter().map(|_| "the load cell's fz drifted by 1.2 N".to_owned()).collect(),
            ..Context::default()
        };
        let answer = Answer::new(&fit, context).unwrap();
        (fit, answer)
    };
    let (two, person) = (two_links(), rigident_model::human::Person::default().human34().unwrap());
    let (body, body_answer) = of_body_(20, 0.4, None);
    let (broken, broken_answer) =
        of_body_(3, 0.02, Some("the connection to /dev/ttyACM0 was lost after 3.0 s"));
    let (links, links_answer) = of_tree(&two, &two_link_recording(&two, 200.0, 20.0, Some(3)));
    let (people, people_answer) = of_tree(&person, &person_recording(&person, 100.0, 10.0));
    vec![
        ("body", body, body_answer),
        ("failed", broken, broken_answer),
        ("two-links", links, links_answer),
        ("person", people, people_answer),
    ]
}
