//! One recording predicts another, as `rigident identify` and `rigident validate` do it: an arm's, and those
//! of simulated ones.

use rigident::answer::predictor::Predictor;
use rigident::answer::{Answer, Context, Links, StandardRequest};
use rigident::fit::{FitOptions, Prediction, RowSource, Silent, plain_least_squares};
use rigident::laboratory::arm::ArmRun;
use rigident::model::Model;
use rigident::model::human::Person;
use rigident::problem::{Problem, ProblemOptions};
use rigident::recording::Recording;
use rigident::rig::TreeClass;
use rigident::rows::tree::TreeSource;
use rigident::rows::tree::drive::Friction;
use rigident_shared::tree::Joint;

use super::staubli;

/// A model with two recordings, one to identify it and one to predict.
struct Case {
    name: &'static str,
    model: Model,
    recordings: [Recording; 2],
    drives: Vec<String>,
}

fn source(case: &Case, which: usize) -> TreeSource {
    let friction = Friction::parse(&["viscous,coulomb,offset,rotor"]).expect("friction");
    let options = ProblemOptions { friction, drives: case.drives.clone(), ..ProblemOptions::default() };
    let problem =
        Problem::from_recording(&case.recordings[which], Some(&case.model), &options).expect("frames");
    match problem.subject {
        rigident::problem::Subject::Tree { source, .. } => *source,
        _ => panic!("{} is a tree with sensors", case.name),
    }
}

fn answer(case: &Case, source: &TreeSource) -> Answer {
    let fit = rigident::fit::fit(source, &FitOptions::default(), &Silent).expect("a fit");
    let links = Links {
        model: &source.input().model,
        base: source.base(),
        situation: source.input().situation,
        drives: source.drive_motions(),
        as_stated: &[],
        idle: Vec::new(),
        beyond: Vec::new(),
        standard: Some(StandardRequest {
            nominal: &case.model,
            trust: 1.0,
            symmetric: false,
            required: false,
        }),
    };
    Answer::new(&fit, Context { links: Some(links), ..Context::default() }).expect("an answer")
}

/// Returns the NRMSE of every channel in per cent.
fn shares(found: &Prediction) -> Vec<f64> {
    found.residual_rms.iter().zip(&found.measured_sd).map(|(rms, sd)| 100.0 * rms / sd).collect()
}

fn rows(case: &Case) -> String {
    let (own, other) = (source(case, 0), source(case, 1));
    let predict = |values: &[f64], errors: &[(String, f64)]| {
        shares(&Prediction::of(&other, values, errors).expect("a prediction"))
    };
    let found = Predictor::of_answer(&answer(case, &own));
    let nominal = Predictor::of_model(&case.model);
    let lines = [
        ("nominal model", predict(&nominal.values(other.parameters()).0, &[])),
        ("`identify`", predict(&found.values(other.parameters()).0, found.errors())),
        ("plain least squares", predict(&plain_least_squares(&own, &Silent).expect("a fit"), &[])),
    ];
    let line = |(by, shares): &(&str, Vec<f64>)| {
        let cells = (0..7)
            .map(|k| shares.get(k).map_or("–".to_owned(), |v| rigident::fit::figures::significant(*v, 3)));
        format!("| {} | {by} | {} |\n", case.name, cells.collect::<Vec<_>>().join(" | "))
    };
    lines.iter().map(line).collect()
}

fn robot(file: &str, locked: &[&str]) -> Model {
    let path = staubli::data().join("../urdf").join(file);
    let mut model = rigident::rows::named_model::open(path.to_str().expect("a path"), &Person::default())
        .expect("a robot")
        .0;
    for joint in locked {
        let at = model.joint(joint).expect("a joint");
        model.links[at].link.joint = Joint::Fixed;
    }
    model
}

pub fn table() -> String {
    let run = ArmRun { position_noise: 1e-5, rate_noise: 2e-3, rotor: 0.2, ..ArmRun::default() };
    let other = ArmRun { motion: 1, seed: 8, ..run.clone() };
    let arms = [
        ("UR5, simulated", robot("ur5_robot.urdf", &[])),
        ("Panda, simulated", robot("panda.urdf", &["panda_finger_joint1", "panda_finger_joint2"])),
    ];
    let mut cases = Vec::new();
    let [first, second] = staubli::halves();
    let drives = vec!["m6=joint_5+joint_6".to_owned()];
    for (names, recordings) in [
        (["TX40, first half → second", "the same, errors stated exact"], [first.clone(), second.clone()]),
        (["TX40, second half → first", "the same, errors stated exact"], [second, first]),
    ] {
        for (k, name) in names.into_iter().enumerate() {
            let mut recordings = recordings.clone();
            for recording in recordings.iter_mut().filter(|_| k > 0) {
                recording.rig.tree.class = Some(TreeClass::Exact);
            }
            cases.push(Case { name, model: staubli::model(), recordings, drives: drives.clone() });
        }
    }
    for (name, model) in arms {
        let recordings = [run.recording(&model), other.recording(&model)];
        cases.push(Case { name, model, recordings, drives: Vec::new() });
    }
    "| recording | by | joint 1 | 2 | 3 | 4 | 5 | 6 | 7 |\n|---|---|---|---|---|---|---|---|---|\n".to_owned()
        + &cases.iter().map(rows).collect::<String>()
}
