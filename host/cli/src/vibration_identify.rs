//! `rigident vibration identify`: the modes, and the body by them and by the motion.

use std::process::ExitCode;

use nalgebra::Vector3;
use serde::Serialize;

use super::outcome::say;
use super::vibration_arguments::IdentifyVibration;
use super::{ExitStatus, Failure, Folder, Stages};
use rigident::answer::{Answer, Context, Source, Status};
use rigident::application::Loaded;
use rigident::application::bare_platform::take_platform_off;
use rigident::present::modes_page::{self, Scene};
use rigident::present::vibration as present;
use rigident::vibration::suspension::bare::{is_stated, massless};
use rigident::vibration::suspension::by_modes::{Refused, by_modes};
use rigident::vibration::suspension::free_decay::{Vibration, vibration};
use rigident::vibration::suspension::mount::Mount;
use rigident::vibration::suspension::springs::COORDINATES;
use rigident::vibration::suspension::support::Support;
use rigident_fit::Fit;
use rigident_fit::pool::PooledFactor;
use rigident_io::recording::Recording;
use rigident_io::rig::RigFile;

/// Answers of two ways that differ by more than this many times both uncertainties contradict each other.
const CONTRADICTORY: f64 = 1.5;

/// The object of `--json`.
#[derive(Serialize)]
struct Object {
    schema: &'static str,
    recording: String,
    modes: Vec<present::ModeRow>,
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
    drop(stages);
    let folder = arguments.out.as_ref().map(|out| Folder::new(Some(out), "vibration")).transpose()?;
    identify(recording, arguments.modes, folder.as_ref(), arguments.json)
}

/// Identifies one body on springs, and writes and shows what is found.
pub(super) fn identify(
    recording: Recording,
    modes: Option<usize>,
    folder: Option<&Folder>,
    json: bool,
) -> Result<ExitCode, Failure> {
    let support = Support::of(&recording.rig, &recording.name).map_err(Failure::input)?;
    let stages = Stages::new("modes");
    let vibration = vibration(&recording, &support, modes).map_err(Failure::input)?;
    stages.at("body", 0.7);
    let mut warnings = recording.warnings.clone();
    let rows = vibration.samples.values.nrows();
    let by_modes = match by_modes(&support, &vibration) {
        Ok(fit) => Ok(answered(&recording, fit, rows)?),
        Err(why) => Err(why),
    };
    let by_motion = match (vibration.samples.is_of_imu(), &by_modes) {
        (true, _) => None,
        // What springs are not, they are for the motion neither.
        (false, Err(Refused::Springs(_))) => None,
        (false, _) => by_motion(recording.clone(), &stages)
            .map_err(|why| warnings.push(format!("no body by the motion: {why}")))
            .ok(),
    };
    match &by_modes {
        Ok(_) => {}
        Err(Refused::Springs(why)) => {
            warnings.insert(0, format!("no body, neither by the modes nor by the motion: {why}"))
        }
        Err(Refused::Modes(why)) => warnings.insert(0, format!("no body by the modes: {why}")),
    }
    let mut by_modes = by_modes.ok();
    if let (Some(modes), Some(motion)) = (&mut by_modes, &by_motion) {
        modes.of_the_readings_of(motion);
    }
    drop(stages);
    let mut notes: Vec<String> = recording.rig.suspension.as_ref().and_then(massless).into_iter().collect();
    if vibration.samples.left_out > 0 {
        notes.push(format!(
            "{} rows before or after a gap in time are not in the modes",
            vibration.samples.left_out
        ));
    }
    if vibration.samples.filled_in > 0 {
        notes.push(format!(
            "{} samples that are missing in gaps are filled in by the modes of the others",
            vibration.samples.filled_in
        ));
    }
    if vibration.samples.is_of_imu() {
        notes.push(
            "the recording has no poses: the body is told by the modes of the IMU's readings alone"
                .to_owned(),
        );
    }
    let answers = [&by_modes, &by_motion].map(|way| way.as_ref().map(|found| &found.answer));
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
        by_modes: answers[0].cloned(),
        by_motion: answers[1].cloned(),
        notes,
        warnings,
    };
    finish((folder, json, &recording.rig), &object, &vibration, [("modes", by_modes), ("motion", by_motion)])
}

/// The result of one way.
struct Found {
    /// With the bare platform taken off.
    answer: Answer,
    /// With it on.
    factor: PooledFactor,
    /// Of the body alone, where the platform is known.
    body: Option<PooledFactor>,
}

impl Found {
    /// Says that its factors are of the same readings as another's: merged they would count the same noise twice.
    fn of_the_readings_of(&mut self, other: &Self) {
        let fingerprint = other.factor.sources.first().map(|source| source.fingerprint);
        for factor in std::iter::once(&mut self.factor).chain(&mut self.body) {
            factor.sources.iter_mut().zip(fingerprint).for_each(|(source, own)| source.fingerprint = own);
        }
    }
}

/// The factor of the body alone: other rigs have no such platform.
fn of_body(fit: &Fit, name: &str) -> Option<PooledFactor> {
    fit.solved.as_ref()?;
    Some(PooledFactor::of(fit, name).only(|parameter| parameter.kind.is_inertial()))
}

/// The answer of a fit with the bare platform taken off.
fn answered(recording: &Recording, mut fit: Fit, rows: usize) -> Result<Found, Failure> {
    let factor = PooledFactor::of(&fit, &recording.name);
    let body = without_platform(&recording.rig, &mut fit, &recording.name)?;
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
    Ok(Found { answer, factor, body })
}

/// Takes the platform off, and returns the factor of the body alone if there was one.
fn without_platform(rig: &RigFile, fit: &mut Fit, name: &str) -> Result<Option<PooledFactor>, Failure> {
    let Some(table) = rig.suspension.as_ref().filter(|table| is_stated(table)) else {
        return Ok(None);
    };
    take_platform_off(table, fit).map_err(Failure::input)?;
    Ok(of_body(fit, name))
}

/// The body by its motion, as `rigident identify` has it.
fn by_motion(recording: Recording, stages: &Stages) -> Result<Found, Failure> {
    let loaded = Loaded::of_body(recording, None, &stages.caller())?;
    let mut fit = loaded.fit(None, 0, &stages.caller())?;
    let factor = loaded.factor(&fit);
    let rig = &loaded.problem.rig;
    let body = without_platform(rig, &mut fit, &loaded.problem.name)?;
    let context = Context {
        body: rig.body.as_ref(),
        truth: rig.truth.as_ref(),
        source: loaded.origin("host"),
        notes: loaded.notes.clone(),
        warnings: loaded.warnings.clone(),
        findings: loaded.problem.findings.clone(),
        ..Context::default()
    };
    Ok(Found { answer: Answer::new(&fit, context).map_err(Failure::input)?, factor, body })
}

/// Returns the body on the springs, with the centre of mass of the first answer that has one.
fn scene(rig: &RigFile, answers: [Option<&Answer>; 2]) -> Scene {
    let table = rig.suspension.clone().unwrap_or_default();
    let mount = Mount::of(&table);
    let at = Vector3::from(table.at_m);
    let com = answers.iter().flatten().find_map(|answer| answer.com_m);
    Scene {
        anchors_m: table.spring.iter().map(|spring| spring.at_m).collect(),
        at_m: table.at_m,
        com_m: com.map(|com| (at + mount.arm + mount.rotation * Vector3::from(com)).into()),
    }
}

fn finish(
    (folder, json, rig): (Option<&Folder>, bool, &RigFile),
    object: &Object,
    vibration: &Vibration,
    ways: [(&str, Option<Found>); 2],
) -> Result<ExitCode, Failure> {
    let text = serde_json::to_string_pretty(object)
        .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
    if json {
        say(text.as_str());
    } else {
        say(present::text(&object.modes, [object.by_modes.as_ref(), object.by_motion.as_ref()]).trim_end());
        for note in &object.notes {
            say(format_args!("note: {note}"));
        }
        for warning in object.warnings.iter().chain(&object.findings) {
            tell!("rigident: {warning}");
        }
        for (way, answer) in [("modes", &object.by_modes), ("motion", &object.by_motion)] {
            for warning in answer.iter().flat_map(|answer| &answer.warnings) {
                tell!("rigident: by the {way}: {warning}");
            }
        }
    }
    if let Some(folder) = folder {
        folder.write_text("result.json", &text)?;
        for (name, found) in ways {
            let Some(found) = found else { continue };
            folder.write(&format!("{name}.factor"), &found.factor.to_bytes())?;
            if let Some(body) = found.body {
                folder.write(&format!("{name}.body.factor"), &body.to_bytes())?;
            }
        }
        let spectrum = vibration.samples.spectrum().map_err(Failure::input)?;
        let spectrum = present::spectrum_svg(&spectrum, &vibration.samples.names, &object.modes);
        folder.write("spectrum.svg", spectrum.as_bytes())?;
        let answers = [object.by_modes.as_ref(), object.by_motion.as_ref()];
        let text = present::text(&object.modes, answers);
        let said: Vec<&str> = object.warnings.iter().chain(&object.findings).map(String::as_str).collect();
        let scene = scene(rig, answers);
        let page = modes_page::page(&object.recording, &object.modes, &scene, &spectrum, (&said, &text));
        folder.write_text("modes.html", &page)?;
        if !json {
            say(format_args!("\nFiles in {}", folder.path().display()));
        }
    }
    let answers = [&object.by_modes, &object.by_motion];
    let is_identified = |a: &Option<Answer>| a.as_ref().is_some_and(|a| a.status == Status::Identified);
    Ok(ExitStatus::of(answers.iter().any(|a| is_identified(a))).into())
}
