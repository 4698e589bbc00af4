//! `rigident vibration identify`: the modes, and the body by them and by the motion.

use std::process::ExitCode;

use nalgebra::DMatrix;
use serde::Serialize;

use super::bare_platform::take_platform_off;
use super::loaded::Loaded;
use super::outcome::say;
use super::vibration_arguments::IdentifyVibration;
use super::{ExitStatus, Failure, Folder, Stages};
use crate::answer::{Answer, Context, Source, Status};
use crate::fit::pool::PooledFactor;
use crate::fit::{Fit, FitOptions, Silent, fit};
use crate::present::vibration as present;
use crate::problem::body;
use crate::problem::suspension::free_decay::{Vibration, vibration};
use crate::problem::suspension::modal::{ModalSource, Swing};
use crate::problem::suspension::springs::COORDINATES;
use crate::problem::suspension::support::Support;
use crate::recording::Recording;

/// Answers of two ways that differ by more than this many times both uncertainties contradict each other.
const CONTRADICTORY: f64 = 1.5;
/// Parameters of a body.
const TEN: usize = 10;

/// The object of `--json`.
#[derive(Serialize)]
struct Object {
    schema: &'static str,
    recording: String,
    modes: Vec<present::ModeRow>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    findings: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    by_modes: Option<Answer>,
    #[serde(skip_serializing_if = "Option::is_none")]
    by_motion: Option<Answer>,
    notes: Vec<String>,
    warnings: Vec<String>,
}

/// `rigident vibration identify`
pub(super) fn run(arguments: &IdentifyVibration) -> Result<ExitCode, Failure> {
    if let Some(out) = &arguments.out {
        Folder::check(out)?;
    }
    if arguments.modes.is_some_and(|n| !(1..=12).contains(&n)) {
        return Err(Failure::input(
            "--modes: a platform has one to six, with what swings on it up to twelve",
        ));
    }
    let path = &arguments.recording;
    let stages = Stages::new(&format!("reading {}", path.display()));
    let recording = Recording::load(path, arguments.rig.as_deref()).map_err(Failure::input)?;
    if recording.rig.link.len() > 1 {
        return Err(Failure::input(format!(
            "{}: its rig file has several [[link]] tables: identify what swings by `rigident identify`, and locked postures by `rigident \
             vibration postures`",
            path.display()
        )));
    }
    let support = Support::of(&recording.rig, &recording.name).map_err(Failure::input)?;
    stages.at("modes", 0.0);
    let vibration = vibration(&recording, &support, arguments.modes).map_err(Failure::input)?;
    stages.at("body", 0.7);
    let mut warnings = recording.warnings.clone();
    let by_modes = by_modes(&recording, &support, &vibration, &mut warnings)?;
    let by_motion = match vibration.samples.imu {
        None => Some(by_motion(recording.clone(), &stages)?),
        Some(_) => None,
    };
    drop(stages);
    let mut notes = Vec::new();
    if by_motion.is_none() {
        notes.push(
            "the recording has no poses: the body is told by the modes of the IMU's readings alone"
                .to_owned(),
        );
    }
    let answers = [by_modes.as_ref().map(|(answer, _)| answer), by_motion.as_ref().map(|(answer, _)| answer)];
    let differ = present::differences(answers);
    warnings.extend(differ.iter().filter(|(_, ratio)| *ratio > CONTRADICTORY).map(|(name, ratio)| {
        format!(
            "{name} by the modes and by the motion differ by {ratio:.1} times their uncertainty: are springs linear, and is nothing loose?"
        )
    }));
    let coordinates: Vec<&'static str> = support.free.iter().map(|k| COORDINATES[*k]).collect();
    let object = Object {
        schema: "rigident/vibration/1",
        recording: recording.name.clone(),
        modes: present::mode_rows(&vibration.modes.shapes, &coordinates),
        findings: vibration.modes.findings.iter().map(ToString::to_string).collect(),
        by_modes: by_modes.as_ref().map(|(answer, _)| answer.clone()),
        by_motion: by_motion.as_ref().map(|(answer, _)| answer.clone()),
        notes,
        warnings,
    };
    finish(arguments, &object, &vibration, [by_modes, by_motion].map(|way| way.map(|(_, factor)| factor)))
}

/// The body by its modes, with the factor of everything that moves; `None` if they are not to be gone on with.
fn by_modes(
    recording: &Recording,
    support: &Support,
    found: &Vibration,
    warnings: &mut Vec<String>,
) -> Result<Option<(Answer, PooledFactor)>, Failure> {
    if let Some(why) = found.unsound(support.free.len()) {
        warnings.push(format!("no body is told by the modes: {why}"));
        return Ok(None);
    }
    let swing = Swing { shapes: found.modes.shapes.clone(), map: DMatrix::identity(TEN, TEN) };
    let Some(source) = ModalSource::new(&[swing], support, body::parameters(TEN), 0) else {
        warnings.push("no body is told by the modes: their covariance has no inverse".to_owned());
        return Ok(None);
    };
    let fit = fit(&source, &FitOptions::default(), &Silent).map_err(Failure::input)?;
    answered(recording, fit, found.samples.values.nrows()).map(Some)
}

/// The answer of a fit with the bare platform taken off, and the factor with it on.
fn answered(recording: &Recording, mut fit: Fit, rows: usize) -> Result<(Answer, PooledFactor), Failure> {
    let factor = PooledFactor::of(&fit, &recording.name);
    if let Some(table) = &recording.rig.suspension {
        take_platform_off(table, &mut fit)?;
    }
    let source = Source {
        recording: recording.name.clone(),
        recorded: recording.recorded(),
        rows: rows as u64,
        rate_hz: recording.rate_hz,
        duration_s: recording.rate_hz.map(|hz| rows as f64 / hz),
        mcu: "host".to_owned(),
    };
    let context = Context {
        body: recording.rig.body.as_ref(),
        truth: recording.rig.truth.as_ref(),
        source,
        ..Context::default()
    };
    let answer = Answer::new(&fit, context).map_err(Failure::input)?;
    Ok((answer, factor))
}

/// The body by its motion, as `rigident identify` has it.
fn by_motion(recording: Recording, stages: &Stages) -> Result<(Answer, PooledFactor), Failure> {
    let loaded = Loaded::of_body(recording, None)?;
    let mut fit = loaded.fit(None, 0, stages)?;
    let factor = loaded.factor(&fit);
    let rig = &loaded.problem.rig;
    if let Some(table) = &rig.suspension {
        take_platform_off(table, &mut fit)?;
    }
    let context = Context {
        body: rig.body.as_ref(),
        truth: rig.truth.as_ref(),
        source: loaded.origin("host"),
        notes: loaded.notes.clone(),
        warnings: loaded.warnings.clone(),
        ..Context::default()
    };
    Ok((Answer::new(&fit, context).map_err(Failure::input)?, factor))
}

fn finish(
    arguments: &IdentifyVibration,
    object: &Object,
    found: &Vibration,
    factors: [Option<PooledFactor>; 2],
) -> Result<ExitCode, Failure> {
    let json = serde_json::to_string_pretty(object)
        .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
    if arguments.json {
        say(json.as_str());
    } else {
        say(present::text(&object.modes, [object.by_modes.as_ref(), object.by_motion.as_ref()]).trim_end());
        for note in &object.notes {
            say(format_args!("note: {note}"));
        }
        for warning in object.findings.iter().chain(&object.warnings) {
            tell!("rigident: {warning}");
        }
    }
    if let Some(out) = &arguments.out {
        let folder = Folder::new(Some(out), "vibration")?;
        folder.write("result.json", json.as_bytes())?;
        for (name, factor) in ["modes", "motion"].iter().zip(factors) {
            if let Some(factor) = factor {
                folder.write(&format!("{name}.factor"), &factor.to_bytes())?;
            }
        }
        let spectrum = found.samples.spectrum().map_err(Failure::input)?;
        folder.write(
            "spectrum.svg",
            present::spectrum_svg(&spectrum, &found.samples.names, &object.modes).as_bytes(),
        )?;
        if !arguments.json {
            say(format_args!("\nFiles in {}", folder.path().display()));
        }
    }
    let answers = [&object.by_modes, &object.by_motion];
    let is_identified = |a: &Option<Answer>| a.as_ref().is_some_and(|a| a.status == Status::Identified);
    Ok(ExitStatus::of(answers.iter().any(|a| is_identified(a))).into())
}
