//! The answer of a fit against that of the old engine of one body: the same states and digits.

use nalgebra::{Matrix3, Vector3};
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::inertia::{InertialParameters, tensor_from_elements};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, Position, Sensor, SpecificForce, Wrench};
use serde_json::Value;

use super::assemble::{self, Asked, assemble};
use super::new::AnswerError;
use super::old_fit::of_body;
use super::result::*;
use super::selection::SelectionError;
use super::{Answer, Context, Links, StandardRequest};
use crate::fit::{Fit, FitOptions, Silent};
use crate::identification::known::Known;
use crate::identification::{self, Identification};
use crate::model::Model;
use crate::problem::{Problem, ProblemOptions};
use crate::recording::Recording;
use crate::rig::{BodyTable, RigFile, TruthTable};
use crate::simulated::trees::{person_recording, two_link_recording, two_links};

fn rig() -> RigFile {
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

fn body() -> InertialParameters<Sensor, f64> {
    let truth = rig().truth.unwrap();
    InertialParameters::from_centre_of_mass(
        truth.mass_kg,
        Position::from_array(truth.com_m),
        tensor_from_elements(truth.inertia_com_kgm2),
    )
}

/// Readings by the equations of Newton and Euler; `size` scales the rates.
fn readings(count: usize, rate_hz: f64, size: f64, noise: f64) -> Vec<Reading<f64>> {
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

fn input(readings: Vec<Reading<f64>>, is_static: bool, sigma: Option<f64>) -> identification::Input {
    identification::Input {
        readings,
        is_static,
        rate_hz: 200.0,
        mounting: ImuMounting::default(),
        channel_sigma: sigma.map(|s| std::array::from_fn(|c| if c < 3 { s } else { 0.1 * s })),
        gyro_sigma: Some(1e-4),
        known_offset: None,
        gain_sigma: [0.0; 6],
        limits: Limits::none(),
    }
}

fn source() -> (ResultSource, Source) {
    let (recording, mcu) = ("walk".to_owned(), "host".to_owned());
    let old = ResultSource {
        recording: recording.clone(),
        rows: 4000,
        rate_hz: Some(200.0),
        mcu: mcu.clone(),
        memory: None,
    };
    (old, Source { recording, recorded: None, rows: 4000, rate_hz: Some(200.0), duration_s: Some(20.0), mcu })
}

/// The two answers about one body.
fn both(
    found: &Identification,
    input: &identification::Input,
    words: &[&str],
) -> (assemble::Assembled, Answer) {
    let rig = rig();
    let words: Vec<String> = words.iter().map(|w| (*w).to_owned()).collect();
    let context = assemble::Context {
        rig: &rig,
        asked: &Asked::parse(&words).unwrap(),
        source: source().0,
        time_base: None,
        broken: None,
        warnings: Vec::new(),
    };
    let new = Context {
        body: rig.body.as_ref(),
        truth: rig.truth.as_ref(),
        asked: &words,
        source: source().1,
        ..Context::default()
    };
    (assemble(found, context), Answer::new(&of_body(found, input), new).unwrap())
}

/// Every field of the old object stands in the new one.
fn assert_kept(old: &Value, new: &Value, fields: &[&str]) {
    for field in fields {
        assert_eq!(old.get(*field), new.get(*field), "{field}");
    }
    let (old, new) = (old["parameters"].as_array().unwrap(), new["parameters"].as_array().unwrap());
    assert_eq!(old.len(), new.len());
    for (old, new) in old.iter().zip(new) {
        for (key, value) in old.as_object().unwrap() {
            // Trees did not say more of what stands for itself.
            assert_eq!(Some(value), new.get(key), "{key} of {}", old["name"]);
        }
    }
}

const BODY_FIELDS: [&str; 15] = [
    "status",
    "known",
    "prior_dominated",
    "mass_kg",
    "com_m",
    "com_u95_m",
    "inertia_com_kgm2",
    "inertia_com_u95_kgm2",
    "inertia_origin_kgm2",
    "body_frame",
    "physically_consistent",
    "condition_number",
    "residual_rms",
    "rejected_rows",
    "advice",
];

fn assert_same_body(found: &Identification, input: &identification::Input, words: &[&str]) -> Answer {
    let (old, new) = both(found, input, words);
    let (object, value) = (serde_json::to_value(&old.object).unwrap(), serde_json::to_value(&new).unwrap());
    assert!(!value.to_string().contains("null"), "{value}");
    let fields: Vec<&str> = BODY_FIELDS.into_iter().filter(|f| *f != "known").collect();
    assert_kept(&object, &value, &fields);
    assert_eq!(old.success, new.status == Status::Identified);
    for (k, moment) in new.principal.iter().enumerate() {
        let principal = old.object.principal.as_ref().unwrap();
        assert_eq!(moment.moment_kgm2, principal.moments_kgm2[k]);
        assert_eq!(moment.u95_kgm2, principal.moments_u95_kgm2[k]);
        assert_eq!((moment.axis, moment.axis_u95_rad), (principal.axes[k], principal.axes_u95_rad[k]));
    }
    // Whatever was a warning is told still.
    let told: Vec<&String> = new.warnings.iter().chain(&new.notes).collect();
    for warning in &old.object.warnings {
        let first = warning.split(&[':', ';', ','][..]).next().unwrap();
        assert!(told.iter().any(|t| t.starts_with(first)), "{warning}\n{told:?}");
    }
    assert_eq!(told.len(), old.object.warnings.len(), "{told:?}");
    new
}

#[test]
fn one_body_has_the_same_answer() {
    for sigma in [None, Some(0.5), Some(0.1), Some(3.0)] {
        let input = input(readings(4000, 200.0, 0.4, 0.5), false, sigma);
        let found = identification::identify(&input).unwrap();
        let new = assert_same_body(&found, &input, &[]);
        if sigma != Some(3.0) {
            assert_eq!((new.status, new.physically_consistent), (Status::Identified, Some(true)));
        }
        assert_eq!(new.truth.as_ref().unwrap().mass_kg, 3.2);
        assert_same_body(&found, &input, &["m", "mc", "offset"]);
    }
}

#[test]
fn what_a_slow_motion_leaves_open_is_advised_as_before() {
    for (size, words) in [(0.01, vec![]), (0.05, vec!["I"]), (0.0, vec!["m"])] {
        let input = input(readings(2000, 200.0, size, 0.5), false, Some(0.5));
        let found = identification::identify(&input).unwrap();
        let new = assert_same_body(&found, &input, &words);
        assert!(!new.advice.is_empty(), "{size}");
    }
}

#[test]
fn known_values_dominate_as_before() {
    let input = input(readings(2000, 200.0, 0.01, 0.5), false, Some(0.5));
    let mut found = identification::identify(&input).unwrap();
    let known =
        ["ixx_kgm2=0.0280±0.0005", "iyy_kgm2=0.0333±0.0005", "izz_kgm2=0.0166±0.5"].map(str::to_owned);
    found.estimate = found.estimate.with_known(&Known::parse_all(&known, &[]).unwrap()).unwrap();
    let new = assert_same_body(&found, &input, &[]);
    assert!(new.parameters.iter().any(|p| p.state.is_prior_dominated()));
    assert_eq!(new.known.len(), 3);
}

#[test]
fn still_poses_have_the_same_answer() {
    let poses = readings(40, 3.0, 0.0, 0.05);
    let input = input(poses, true, Some(0.05));
    let found = identification::identify(&input).unwrap();
    let new = assert_same_body(&found, &input, &["m", "mc"]);
    assert_eq!(new.status, Status::Identified);
    assert!(new.inertia_com_kgm2.is_none() && new.com_m.is_some());
}

#[test]
fn a_reversed_wrench_identifies_nothing_and_says_why() {
    let mut reversed = readings(2000, 200.0, 0.4, 0.2);
    for reading in &mut reversed {
        reading.wrench = Wrench::from_array(reading.wrench.array().map(|v| -v));
    }
    let input = input(reversed, false, None);
    let found = identification::identify(&input).unwrap();
    let new = assert_same_body(&found, &input, &[]);
    assert!(new.consistency.unwrap().reversed && new.status == Status::NotIdentified);
}

/// Returns the fit of a tree with its answer.
fn of_tree(model: &Model, recording: &Recording) -> (Fit, Answer) {
    let problem = Problem::from_recording(recording, Some(model), &ProblemOptions::default()).unwrap();
    let fit = problem.fit(&FitOptions::default(), &Silent).unwrap();
    let tree = problem.tree().unwrap();
    let input = tree.input();
    let links = Links {
        model: &input.model,
        base: tree.base(),
        situation: input.situation,
        drives: tree.drive_motions(),
        idle: Vec::new(),
        standard: Some(StandardRequest { nominal: model, trust: 1.0, symmetric: false, required: false }),
    };
    let context = Context {
        links: Some(links),
        source: source().1,
        rate_sigma: input.rate_sigma,
        ..Context::default()
    };
    let answer = Answer::new(&fit, context).unwrap();
    (fit, answer)
}

/// Returns fits with their answers: one body, two links, a person, a run that broke off.
pub(crate) fn samples() -> Vec<(&'static str, Fit, Answer)> {
    let of_body_ = |seconds: usize, size: f64, error: Option<&str>| {
        let input = input(readings(200 * seconds, 200.0, size, 0.5), false, None);
        let fit = of_body(&identification::identify(&input).unwrap(), &input);
        let rig = rig();
        let context = Context {
            body: rig.body.as_ref(),
            truth: rig.truth.as_ref(),
            source: source().1,
            error: error.map(str::to_owned),
            notes: vec!["rows at rest were not used for the friction".to_owned()],
            warnings: error.iter().map(|_| "the load cell's fz drifted by 1.2 N".to_owned()).collect(),
            ..Context::default()
        };
        let answer = Answer::new(&fit, context).unwrap();
        (fit, answer)
    };
    let (two, person) = (two_links(), crate::model::human::Person::default().human34().unwrap());
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

/// The two texts and pages about one body say the same.
#[test]
fn one_body_has_the_same_text() {
    for (size, words) in [(0.4, &[][..]), (0.01, &["m"][..])] {
        let input = input(readings(2000, 200.0, size, 0.5), false, None);
        let found = identification::identify(&input).unwrap();
        let (old, new) = both(&found, &input, words);
        assert_eq!(crate::present::plain::text(&new), crate::present::table::plain(&old.results));
    }
}

fn a_fit() -> Fit {
    let input = input(readings(2000, 200.0, 0.4, 0.5), false, None);
    of_body(&identification::identify(&input).unwrap(), &input)
}

#[test]
fn an_unknown_word_is_refused_and_a_broken_run_has_failed() {
    let fit = a_fit();
    let asked = ["leg".to_owned()];
    let refused = Answer::new(&fit, Context { asked: &asked, ..Context::default() }).unwrap_err();
    assert!(matches!(refused, AnswerError::Selection(SelectionError::Unknown { .. })));
    let broken = Context { error: Some("the link was lost".to_owned()), ..Context::default() };
    let answer = Answer::new(&fit, broken).unwrap();
    assert_eq!((answer.status, answer.error.as_deref()), (Status::Failed, Some("the link was lost")));
}

/// A factor alone has no residuals, so no root mean squares of them.
#[test]
fn what_is_not_known_is_absent_and_never_null() {
    let mut fit = a_fit();
    fit.residuals.clear();
    fit.estimate.condition_number = f64::INFINITY;
    let value = serde_json::to_value(Answer::new(&fit, Context::default()).unwrap()).unwrap();
    for absent in
        ["residual_rms", "condition_number", "error", "truth", "body_frame", "model", "known", "notes"]
    {
        assert!(value.get(absent).is_none(), "{absent}");
    }
    assert!(value["channels"].as_array().unwrap().iter().all(|c| c.get("residual_rms").is_none()));
    assert!(!value.to_string().contains("null"));
    let date = value["date"].as_str().unwrap();
    assert!(date.len() == 20 && date.ends_with('Z') && date.starts_with("20"), "{date}");
    let back: Answer = serde_json::from_value(value.clone()).unwrap();
    assert_eq!(serde_json::to_value(back).unwrap(), value);
}
