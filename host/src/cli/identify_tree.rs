use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use super::arguments::Identify;
use super::model_arguments::TreeOptions;
use super::outcome::say;
use super::recorded::is_rig_file;
use super::{Failure, Folder, held};
use crate::formats::recording::{Recording, rig_path};
use crate::formats::result::{ParameterState, ResultSource, Status};
use crate::formats::rig::RigFile;

use crate::models::{self, Model};
use crate::trees::drive::Term;
use crate::trees::nearest::{Full, nearest};
use crate::trees::prepare::{Wishes, prepare};
use crate::trees::result::{self as tree_result, Answer};
use crate::trees::{answer, identify};

/// `rigident identify` of a tree of links; `None` if the recording is one of a single body.
pub(super) fn run(arguments: &Identify, started: Instant) -> Result<Option<ExitCode>, Failure> {
    let options = &arguments.tree;
    let rig = rig_of(arguments);
    let several = rig.as_ref().is_some_and(|rig| rig.link.len() > 1);
    if options.model.is_none() && !several {
        return refuse_tree_options(options).map(|()| None);
    }
    refuse_others(arguments, rig.as_ref())?;
    let trust = options.nominal_sigma;
    if !trust.is_finite() || trust <= 0.0 {
        return Err(Failure::input(format!("--nominal-sigma {trust}: must be finite and greater than zero")));
    }
    let written = options.write_model.as_deref();
    if let Some(path) = written {
        models::write::check_target(path).map_err(Failure::input)?;
    }
    let (mut model, source) = match &options.model {
        Some(name) => {
            let (model, is_person) = super::model::read(name, &options.changes)?;
            (model, (!is_person).then(|| Path::new(name).to_owned()))
        }
        None => {
            super::model::refuse_a_person(&options.changes)?;
            let tables = rig.map(|rig| rig.link).unwrap_or_default();
            let name = arguments.recording.display().to_string();
            let mut model = models::rig_links::from_tables(&tables, &name).map_err(Failure::input)?;
            model.name =
                arguments.recording.file_stem().map_or(name, |stem| stem.to_string_lossy().into_owned());
            (model, None)
        }
    };
    let recording =
        Recording::load(&arguments.recording, arguments.rig.as_deref()).map_err(Failure::input)?;
    // Where the recording has them, joints are locked there.
    let mut changes = options.changes.clone();
    let mut told = held::lock(&mut model, &std::mem::take(&mut changes.lock), &recording)?;
    super::model::change(&mut model, &changes)?;
    told.extend(changes.tool.iter().map(|words| of_a_tool(words)));
    if let Some(path) = written {
        told.extend(models::write::remarks(&model, source.as_deref(), path, &options.changes.lock));
    }
    let friction =
        options.friction.iter().map(|w| Term::parse(w)).collect::<Result<_, _>>().map_err(Failure::input)?;
    let wishes = Wishes { friction, drives: options.drive.clone() };
    let ready = prepare(&recording, &model, &wishes).map_err(Failure::input)?;
    let found = identify(&ready.input).map_err(Failure::input)?;
    let states = answer::states(&ready.input, &found);
    let asked = tree_result::asked(&found.names, &arguments.output.estimate).map_err(Failure::input)?;
    let (full, without_full) = full_parameters(&model, &found, options)?;
    let folder = Folder::new(arguments.output.out.as_deref(), "identify")?;
    let missing = asked.iter().filter(|j| !matches!(states[**j], ParameterState::Identified(_))).count();
    let status = match missing {
        0 => Status::Identified,
        m if m == asked.len() => Status::NotIdentified,
        _ => Status::PartlyIdentified,
    };
    let mut warnings: Vec<String> = recording.warnings.clone();
    warnings.extend(model.findings.iter().map(ToString::to_string));
    warnings.extend(told);
    warnings.extend(ready.notes.iter().cloned());
    warnings.extend(tree_result::warnings(&ready.input, &found));
    warnings.extend(without_full);
    let answer = Answer {
        input: &ready.input,
        reasons: answer::reasons(&ready.input, &found, &states, &ready.idle),
        states,
        found: &found,
        full: full.as_ref(),
        trust,
        symmetric: options.symmetric_sides,
        status,
        source: ResultSource {
            recording: recording.name.clone(),
            rows: recording.rows(),
            rate_hz: (!recording.is_static).then_some(ready.input.rate_hz),
            mcu: "host".to_owned(),
            memory: None,
        },
        warnings,
    };
    let object = answer.object(started.elapsed().as_secs_f64());
    let text = serde_json::to_string_pretty(&object)
        .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
    if arguments.output.json {
        say(text.as_str());
    } else {
        say(answer.text().trim_end());
    }
    folder.write("result.json", text.as_bytes())?;
    let page = folder.write("report.html", answer.page().as_bytes())?;
    if let (Some(path), Some(full)) = (written, &full) {
        let identified = models::write::with_parameters(
            &model,
            full.links.iter().map(|link| (link.name.as_str(), link.parameters)),
        );
        models::write::write(&identified, source.as_deref(), path).map_err(Failure::input)?;
    }
    if !arguments.output.json {
        let also = written.map_or_else(String::new, |path| format!("; the model is {}", path.display()));
        say(format_args!(
            "\nFiles in {}; open {} in a browser{also}",
            folder.path().display(),
            page.display()
        ));
    }
    Ok(Some(if status == Status::Identified { ExitCode::SUCCESS } else { ExitCode::from(1) }))
}

/// What a tool changes here.
fn of_a_tool(words: &str) -> String {
    let link = words.split('@').next().unwrap_or(words);
    format!(
        "--tool {words} changes nothing of the answer: what {link} holds is one body with it, and {link}'s base parameters are \
         those of both. It has no nominal model, so that it is not among the full parameters and not written: they count it to \
         {link}. Identify without the tool, too, and take the difference"
    )
}

/// The rig file that the recording has; one that cannot be read is another's to complain of.
fn rig_of(arguments: &Identify) -> Option<RigFile> {
    let path = &arguments.recording;
    let rig = match &arguments.rig {
        Some(rig) => rig.clone(),
        None if is_rig_file(path) => path.clone(),
        None => rig_path(path),
    };
    let beside = RigFile::load(&rig).ok();
    if beside.is_some() || path.is_dir() {
        return beside;
    }
    // A recording may carry its rig file.
    let is_mcap = crate::formats::recording::extension(path) == "mcap";
    is_mcap.then(|| Recording::load(path, None).ok().map(|r| r.rig)).flatten()
}

/// Full parameters, where there is a nominal model, or why there are none; where they are asked for there must be one.
fn full_parameters(
    model: &Model,
    found: &crate::trees::TreeIdentification,
    options: &TreeOptions,
) -> Result<(Option<Full>, Option<String>), Failure> {
    let asked_for = options.write_model.is_some() || options.symmetric_sides;
    let without = model.welded().links.iter().all(|link| link.nominal.is_none());
    if without && !asked_for {
        return Ok((None, None));
    }
    match nearest(model, found, options.nominal_sigma, options.symmetric_sides) {
        Ok(full) => Ok((Some(full), None)),
        Err(error) if asked_for => Err(Failure::input(error)),
        Err(error) => Ok((None, Some(format!("no full parameters: {error}")))),
    }
}

fn refuse_tree_options(options: &TreeOptions) -> Result<(), Failure> {
    let given = [
        ("--friction", !options.friction.is_empty()),
        ("--drive", !options.drive.is_empty()),
        ("--symmetric-sides", options.symmetric_sides),
        ("--write-model", options.write_model.is_some()),
        ("--lock", !options.changes.lock.is_empty()),
        ("--spherical", !options.changes.spherical.is_empty()),
        ("--tool", !options.changes.tool.is_empty()),
        ("--nominal-sigma", options.nominal_sigma != 1.0),
        ("--height-m (as --mass-kg, --sex, --segment)", options.changes.describe_a_person()),
    ];
    match given.iter().find(|(_, given)| *given) {
        None => Ok(()),
        Some((option, _)) => Err(Failure::input(format!(
            "{option} is for trees of links: say which by --model, or by [[link]] tables in the rig file"
        ))),
    }
}

fn refuse_others(arguments: &Identify, rig: Option<&RigFile>) -> Result<(), Failure> {
    let refuse =
        |what: &str| Err(Failure::input(format!("{what}: for a single body only, not for a tree of links")));
    if !arguments.known.known.is_empty() || !arguments.known.symmetry.is_empty() {
        return refuse("--known and --symmetry");
    }
    if !arguments.tare.tare.is_empty() {
        return refuse("--tare");
    }
    if arguments.remember.forget.is_some() || arguments.remember.window.is_some() {
        return refuse("--forget and --window");
    }
    let streams = rig.is_some_and(|rig| !rig.stream.is_empty());
    if streams || is_rig_file(&arguments.recording) || arguments.recording.is_dir() {
        return refuse("several files with clocks of their own ([[stream]])");
    }
    Ok(())
}
