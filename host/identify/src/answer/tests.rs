//! The answer of a fit: what it says of a body that is known, what it leaves out.

use nalgebra::{Matrix3, Vector3};
use rigident_shared::inertia::tensor_from_elements;
use rigident_shared::spatial::Wrench;

use super::drive_signs::rotors_without_a_cause;
use super::new::AnswerError;
use super::result::*;
use super::samples::*;
use super::selection::SelectionError;
use super::{Answer, Context, Finding, WITHHELD};
use rigident_fit::Fit;
use rigident_fit::prior::KnownValues;
use rigident_laboratory::arm::ArmRun;
use rigident_laboratory::trees::{seven_axes, two_link_recording, two_links};

/// Returns the answer about the body of [`rig`].
fn answer(fit: &Fit, words: &[&str]) -> Answer {
    let rig = rig();
    let words: Vec<String> = words.iter().map(|w| (*w).to_owned()).collect();
    let context = Context {
        body: rig.body.as_ref(),
        truth: rig.truth.as_ref(),
        asked: &words,
        source: source(),
        ..Context::default()
    };
    let answer = Answer::new(fit, context).unwrap();
    let value = serde_json::to_value(&answer).unwrap();
    assert!(!value.to_string().contains("null"), "{value}");
    answer
}

fn tensor(elements: [f64; 6]) -> Matrix3<f64> {
    tensor_from_elements(elements)
}

/// Returns the tensor about a point that is `arm` away from the centre of mass.
fn steiner(about_com: &Matrix3<f64>, mass: f64, arm: Vector3<f64>) -> Matrix3<f64> {
    about_com + mass * (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose())
}

#[track_caller]
fn near(a: f64, b: f64, by: f64) {
    assert!((a - b).abs() <= by, "{a} {b} ± {by}");
}

/// Everything that follows from the ten parameters agrees with them, by Steiner's theorem and an eigenvalue
/// problem, and holds the truth.
#[test]
fn an_answer_s_quantities_are_those_of_one_body() {
    let truth = rig().truth.unwrap();
    for sigma in [None, Some(0.5), Some(0.1)] {
        let fit = of_body(&input(readings(4000, 200.0, 0.4, 0.5), false, sigma));
        let new = answer(&fit, &[]);
        assert_eq!((new.status, new.physically_consistent), (Status::Identified, Some(true)), "{sigma:?}");
        assert_eq!(new.truth.as_ref().unwrap().mass_kg, 3.2);
        assert_eq!(answer(&fit, &["m", "mc", "offset"]).status, Status::Identified);
        let phi: Vec<f64> = new.parameters.iter().map(|p| p.state.measured().unwrap().value).collect();
        let mass = new.mass_kg.unwrap();
        let com = Vector3::from(new.com_m.unwrap());
        assert_eq!(mass, phi[0]);
        (0..3).for_each(|k| near(com[k], phi[1 + k] / mass, 1e-12));
        let about_com = tensor(new.inertia_com_kgm2.unwrap());
        let about_origin = tensor(new.inertia_origin_kgm2.unwrap());
        let steiner_s = steiner(&about_com, mass, com);
        let elements = tensor(std::array::from_fn(|k| phi[4 + k]));
        for (origin, (by_steiner, own)) in about_origin.iter().zip(steiner_s.iter().zip(&elements)) {
            near(*origin, *by_steiner, 1e-12);
            near(*origin, *own, 1e-12);
        }
        let mut moments: Vec<f64> = about_com.symmetric_eigenvalues().iter().copied().collect();
        moments.sort_by(|a, b| b.total_cmp(a));
        assert_eq!(new.principal.len(), 3);
        for (principal, moment) in new.principal.iter().zip(moments) {
            near(principal.moment_kgm2, moment, 1e-12);
            if let Some(axis) = principal.axis {
                let axis = Vector3::from(axis);
                assert!((about_com * axis - moment * axis).norm() < 1e-9 * moment);
            }
        }
        // The customer's frame: R of the quaternion turns its axes to those of S.
        let frame = new.body_frame.as_ref().unwrap();
        let [w, x, y, z] = rig().body.unwrap().rotation_wxyz;
        let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        let turn = turn.to_rotation_matrix().into_inner();
        let own = turn.transpose() * (com - Vector3::from(rig().body.unwrap().position_m));
        (0..3).for_each(|k| near(frame.com_m[k], own[k], 1e-9));
        let own_tensor = steiner(&(turn.transpose() * about_com * turn), mass, own);
        for (a, b) in tensor(frame.inertia_origin_kgm2.unwrap()).iter().zip(&own_tensor) {
            near(*a, *b, 1e-9);
        }
        // Of 19 intervals of 95 % more than one and a half times as wide none fails but once in a hundred.
        near(mass, truth.mass_kg, 1.5 * new.parameters[0].state.measured().unwrap().u95);
        (0..3).for_each(|k| near(com[k], truth.com_m[k], 1.5 * new.com_u95_m.unwrap()[k]));
        let (inertia, u95) = (new.inertia_com_kgm2.unwrap(), new.inertia_com_u95_kgm2.unwrap());
        (0..6).for_each(|k| near(inertia[k], truth.inertia_com_kgm2[k], 1.5 * u95[k]));
        assert_eq!(new.condition_number, Some(fit.estimate.condition_number));
        assert_eq!(new.residual_rms.len(), 6);
    }
}

#[test]
fn parameters_open_by_a_slow_motion_are_not_identified_and_advised() {
    for (size, words) in [(0.01, vec![]), (0.05, vec!["I"]), (0.0, vec!["m"])] {
        let new = answer(&of_body(&input(readings(2000, 200.0, size, 0.5), false, Some(0.5))), &words);
        assert!(!new.advice.is_empty(), "{size}");
        assert!(new.parameters.iter().any(|p| p.state == ParameterState::NotIdentified), "{size}");
    }
}

#[test]
fn known_values_dominate_parameters_not_in_the_data() {
    let mut fit = of_body(&input(readings(2000, 200.0, 0.01, 0.5), false, Some(0.5)));
    let known =
        ["ixx_kgm2=0.0280±0.0005", "iyy_kgm2=0.0333±0.0005", "izz_kgm2=0.0166±0.5"].map(str::to_owned);
    KnownValues::parse(&known, &[]).unwrap().apply(&mut fit).unwrap();
    let new = answer(&fit, &[]);
    let names: Vec<&str> =
        new.parameters.iter().filter(|p| p.state.is_prior_dominated()).map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["Ixx", "Iyy"]);
    assert_eq!(new.known.len(), 3);
}

#[test]
fn still_poses_tell_mass_and_centre_of_mass() {
    let new = answer(&of_body(&input(readings(40, 3.0, 0.0, 0.05), true, Some(0.05))), &["m", "mc"]);
    assert_eq!(new.status, Status::Identified);
    assert!(new.inertia_com_kgm2.is_none() && new.com_m.is_some());
}

#[test]
fn a_reversed_wrench_identifies_nothing_and_says_why() {
    let mut reversed = readings(2000, 200.0, 0.4, 0.2);
    for reading in &mut reversed {
        reading.wrench = Wrench::from_array(reading.wrench.array().map(|v| -v));
    }
    let new = answer(&of_body(&input(reversed, false, None)), &[]);
    assert!(new.fit.unwrap().consistency.unwrap().reversed && new.status == Status::Implausible);
    assert!(new.parameters.iter().all(|p| p.state == ParameterState::NotIdentified));
}

/// Dry friction that grows with the rate has a negative part of Stribeck's, and gives no energy as long as
/// the sum is none; one of the wrong sign does.
#[test]
fn friction_that_grows_with_the_rate_gives_no_energy() {
    let mut model = seven_axes();
    model.links.truncate(3);
    let run = ArmRun { slip: 0.1, rest_s: 0.0, motion_s: 10.0, rate_noise: 1e-5, ..ArmRun::default() };
    let lists = ["viscous,coulomb:0,offset,stribeck:0.1"];
    let said = |run: &ArmRun| {
        let (fit, answer) = with_friction(&model, &run.recording(&model), &lists);
        let j = fit.parameters.iter().position(|p| p.name == "l1_joint.stribeck").unwrap();
        let estimate = fit.estimate.unjudged();
        let is_far = estimate.values[j] < -5.0 * estimate.covariance[(j, j)].sqrt();
        (is_far, answer.warnings.iter().any(|text| text.contains("friction and rotors take energy")))
    };
    assert_eq!(said(&run), (true, false));
    assert!(said(&ArmRun { friction: [2.0, -4.0, 0.2], ..run }).1);
}

/// Something that acts as a negative rotor would, beside friction that takes energy: the model lacks it, and
/// only the rotor is lost. Where friction gives energy, too, a sign is wrong.
#[test]
fn a_negative_rotor_beside_friction_of_its_sign_is_not_identified_and_contradicts_nothing() {
    let mut model = seven_axes();
    model.links.truncate(4);
    let lists = ["viscous,coulomb:0,offset,rotor"];
    let run = ArmRun { rotor: -0.5, rest_s: 0.0, motion_s: 10.0, rate_noise: 1e-5, ..ArmRun::default() };
    let (fit, own) = with_friction(&model, &run.recording(&model), &lists);
    assert_ne!(own.status, Status::Implausible, "{:?}", own.warnings);
    let lost: Vec<&str> =
        rotors_without_a_cause(&fit).iter().map(|j| fit.parameters[*j].name.as_str()).collect();
    assert_eq!(lost, ["l3_joint.rotor"]);
    assert!(own.warnings.iter().any(|text| text.contains("no rotor is negative") && text.contains(lost[0])));
    for parameter in &own.parameters {
        let is_lost = parameter.name == lost[0];
        assert!(!is_lost || parameter.state == ParameterState::NotIdentified);
        let is_friction = parameter.name.ends_with(".viscous") || parameter.name.ends_with(".coulomb");
        assert!(!is_friction || parameter.state.is_identified(), "{}", parameter.name);
    }
    // Three standard deviations below zero are neither a contradiction nor a rotor.
    let at = fit.parameters.iter().position(|parameter| parameter.name == lost[0]).unwrap();
    let sd = fit.data_alone().covariance(at, at).unwrap().sqrt();
    let doubtful = ArmRun { rotor: -3.0 * sd, ..run.clone() };
    let (_, own) = with_friction(&model, &doubtful.recording(&model), &lists);
    assert_ne!(own.status, Status::Implausible, "{:?}", own.warnings);
    assert_eq!(own.parameters[at].state, ParameterState::NotIdentified);
    assert!(own.warnings.iter().any(|text| text.contains("below zero") && text.contains(lost[0])));
    let run = ArmRun { friction: [-2.0, -4.0, 0.2], ..run };
    let (_, own) = with_friction(&model, &run.recording(&model), &lists);
    assert_eq!(own.status, Status::Implausible);
}

/// A model whose arm has a moment that no mass has, and the recording simulated with it: the model is named,
/// not the sensors alone.
#[test]
fn impossible_links_of_the_model_are_named_as_its_own() {
    let mut model = two_links();
    let arm = model.links.len() - 1;
    let sound = of_tree(&model, &two_link_recording(&model, 200.0, 20.0, Some(3))).1;
    assert!(!sound.warnings.iter().any(|text| text.contains("that no body has")), "{:?}", sound.warnings);
    if let Some(phi) = &mut model.links[arm].nominal {
        phi[4] += 2.0 * (phi[5] + phi[6]);
    }
    let (_, answer) = of_tree(&model, &two_link_recording(&model, 200.0, 20.0, Some(3)));
    assert_eq!(answer.status, Status::Implausible);
    let own = format!("The model itself states inertias that no body has, of {}", model.links[arm].name);
    assert!(answer.warnings.iter().any(|text| text.contains(&own)), "{:?}", answer.warnings);
}

fn a_fit() -> Fit {
    let input = input(readings(2000, 200.0, 0.4, 0.5), false, None);
    of_body(&input)
}

/// A twentieth of the body is lost after 12 s: every number is one of before or after within its interval.
#[test]
fn a_body_that_changed_is_reported_with_time_and_size_and_is_not_identified() {
    let mut all = readings(4000, 200.0, 0.4, 0.5);
    let offset = rig().truth.unwrap().apparent_offset_n_nm.unwrap();
    for reading in &mut all[2400..] {
        let wrench = reading.wrench.array();
        reading.wrench =
            Wrench::from_array(std::array::from_fn(|c| wrench[c] - 0.05 * (wrench[c] - offset[c])));
    }
    let fit = of_body(&input(all, false, Some(0.5)));
    let answer = answer(&fit, &[]);
    let change = answer.change.as_ref().expect("a change");
    assert_eq!((answer.status, change.changed), (Status::Implausible, Changed::Body));
    near(change.time_s.value, 12.0, change.time_s.u95);
    let of_mass = change.steps.iter().find(|s| s.name == "m").unwrap().step;
    near(of_mass.value, -0.05 * 3.2, of_mass.u95);
    let mass = &answer.fit.as_ref().unwrap().parameters[0];
    assert_eq!((answer.parameters[0].state, mass.name.as_str()), (ParameterState::Contradicted, "m"));
    assert!((mass.value - 3.2).abs() < mass.u95 && (mass.value - 0.95 * 3.2).abs() < mass.u95, "{mass:?}");
    let warning = answer.warnings.iter().find(|w| w.contains("after the beginning")).unwrap();
    assert!(warning.contains(": m −1") && warning.contains(" g, "), "{warning}");
    let back: Answer = serde_json::from_value(serde_json::to_value(&answer).unwrap()).unwrap();
    assert_eq!(back, answer);
}

/// The numbers of a fit that must not be used are in `fit` alone, also where the run broke off.
#[test]
fn of_a_recording_that_cannot_be_true_nothing_is_given() {
    let fit = a_fit();
    let rig = rig();
    let with = |findings: &[Finding], error: Option<&str>| {
        let context = Context {
            body: rig.body.as_ref(),
            findings: findings.to_vec(),
            error: error.map(str::to_owned),
            ..Context::default()
        };
        Answer::new(&fit, context).unwrap()
    };
    let honest = with(&[Finding::warning("the lamp is off")], None);
    assert_eq!((honest.status, honest.fit.as_ref()), (Status::Identified, None));
    assert_eq!(honest.warnings.last().unwrap(), "the lamp is off");
    for (error, status) in [(None, Status::Implausible), (Some("the link was lost"), Status::Failed)] {
        let untrue = with(&[Finding::contradiction("it was upside down")], error);
        assert_eq!((untrue.status, untrue.is_contradicted()), (status, true));
        assert!(untrue.parameters.iter().all(|p| p.state == ParameterState::Contradicted));
        assert_eq!(untrue.warnings.last().unwrap(), "it was upside down");
        let value = serde_json::to_value(&untrue).unwrap();
        for absent in WITHHELD {
            assert!(value.get(absent).is_none(), "{absent}");
        }
        let numbers = untrue.fit.as_ref().unwrap();
        for (own, kept) in honest.parameters.iter().zip(&numbers.parameters) {
            let measured = own.state.measured().unwrap();
            assert_eq!((&own.name, measured.value, measured.u95), (&kept.name, kept.value, kept.u95));
        }
        assert_eq!(numbers.consistency, honest.consistency);
        let back: Answer = serde_json::from_value(value).unwrap();
        assert_eq!(back, untrue);
    }
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
fn unknown_values_are_absent_and_never_null() {
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
