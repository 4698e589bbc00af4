use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use super::arguments::Identify;
use super::model_arguments::{ModelChanges, TreeModel, TreeOptions};
use super::recorded::is_rig_file;
use super::refused::refuse_for_trees;
use super::tree_outcome::{Fullness, TreeEnding};
use super::{Failure, Folder, Stages, held};
use crate::answer::result::ResultSource;
use crate::model::{self, Model};
use crate::recording::{Recording, rig_path};
use crate::rig::RigFile;
use crate::trees::drive::Term;
use crate::trees::identify_watched;
use crate::trees::prepare::{Wishes, prepare};

/// `rigident identify` of a tree of links; `None` if the recording is one of a single body.
pub(super) fn run(arguments: &Identify, started: Instant) -> Result<Option<ExitCode>, Failure> {
    let options = &arguments.tree;
    let Some((mut model, model_file)) = tree_of(&arguments.recording, arguments.rig.as_deref(), &options.of)?
    else {
        return refuse_tree_options(options).map(|()| None);
    };
    refuse_others(arguments)?;
    let trust = options.nominal_sigma;
    if !trust.is_finite() || trust <= 0.0 {
        return Err(Failure::input(format!("--nominal-sigma {trust}: must be finite and greater than zero")));
    }
    let written = options.write_model.as_deref();
    if let Some(path) = written {
        model::write::check_target(path).map_err(Failure::input)?;
    }
    let stages = Stages::new(&format!("reading {}", arguments.recording.display()));
    let mut recording =
        Recording::load(&arguments.recording, arguments.rig.as_deref()).map_err(Failure::input)?;
    recording.leave_out_spikes();
    let mut warnings = recording.warnings.clone();
    warnings.extend(change_as_recorded(&mut model, &options.of.changes, &recording)?);
    if let Some(path) = written {
        let locked = &options.of.changes.lock;
        warnings.extend(model::remarks::remarks(&model, model_file.as_deref(), path, locked));
    }
    let friction =
        options.friction.iter().map(|w| Term::parse(w)).collect::<Result<_, _>>().map_err(Failure::input)?;
    let wishes = Wishes { friction, drives: options.drive.clone() };
    stages.at("frames of the recording", 0.0);
    let ready = prepare(&recording, &model, &wishes).map_err(Failure::input)?;
    let found =
        identify_watched(&ready.input, &|stage, share| stages.at(stage, share)).map_err(Failure::input)?;
    // The rest writes.
    drop(stages);
    let source = ResultSource {
        recording: recording.name.clone(),
        rows: recording.rows(),
        rate_hz: (!recording.is_static).then_some(ready.input.rate_hz),
        mcu: "host".to_owned(),
        memory: None,
    };
    let ending = TreeEnding {
        started,
        output: &arguments.output,
        model: &model,
        ready: &ready,
        found: &found,
        fullness: Fullness {
            trust,
            symmetric: options.symmetric_sides,
            write_model: written,
            source: model_file.as_deref(),
        },
        source,
        truth: None,
        followed: None,
        warnings,
        broken: None,
    };
    ending.conclude(|| Folder::new(arguments.output.out.as_deref(), "identify")).map(Some)
}

/// The tree that a recording is of, as its source has it, and the robot description that it was read from: by --model, or
/// the `[[link]]` tables of its rig file if there are several. `None` if it is of a single body.
///
/// # Errors
/// Bad input: the tree is none.
pub(super) fn tree_of(
    recording: &Path,
    rig: Option<&Path>,
    options: &TreeModel,
) -> Result<Option<(Model, Option<PathBuf>)>, Failure> {
    if let Some(name) = &options.model {
        let (model, is_person) = super::model::read(name, &options.changes)?;
        return Ok(Some((model, (!is_person).then(|| Path::new(name).to_owned()))));
    }
    let Some(rig) = rig_of(recording, rig).filter(|rig| rig.link.len() > 1) else { return Ok(None) };
    super::model::refuse_a_person(&options.changes)?;
    let name = recording.display().to_string();
    let mut model = model::rig_links::from_tables(&rig.link, &name).map_err(Failure::input)?;
    model.name = recording.file_stem().map_or(name, |stem| stem.to_string_lossy().into_owned());
    Ok(Some((model, None)))
}

/// Changes a tree as the options say, joints being locked where the recording has them; what is to be told.
///
/// # Errors
/// Bad input: no such joint or link, or a joint to be locked moves.
pub(super) fn change_as_recorded(
    model: &mut Model,
    changes: &ModelChanges,
    recording: &Recording,
) -> Result<Vec<String>, Failure> {
    let mut changes = changes.clone();
    let mut told = held::lock(model, &std::mem::take(&mut changes.lock), recording)?;
    held::meet(model, &std::mem::take(&mut changes.spherical), recording)?;
    super::model::change(model, &changes)?;
    told.extend(changes.tool.iter().map(|words| of_a_tool(words)));
    Ok(told)
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
fn rig_of(path: &Path, rig: Option<&Path>) -> Option<RigFile> {
    let rig = match rig {
        Some(rig) => rig.to_owned(),
        None if is_rig_file(path) => path.to_owned(),
        None => rig_path(path),
    };
    let beside = RigFile::load(&rig).ok();
    if beside.is_some() || path.is_dir() {
        return beside;
    }
    // A recording may carry its rig file.
    let is_mcap = crate::recording::extension(path) == "mcap";
    is_mcap.then(|| Recording::load(path, None).ok().map(|r| r.rig)).flatten()
}

fn refuse_tree_options(options: &TreeOptions) -> Result<(), Failure> {
    let mut given = vec![
        ("--friction", !options.friction.is_empty()),
        ("--drive", !options.drive.is_empty()),
        ("--symmetric-sides", options.symmetric_sides),
        ("--write-model", options.write_model.is_some()),
        ("--nominal-sigma", options.nominal_sigma != 1.0),
    ];
    given.extend(options.of.changed());
    refuse_without_tree(&given)
}

/// Refuses a tree's options where nothing says which tree.
///
/// # Errors
/// Bad input, with the option's name.
pub(super) fn refuse_without_tree(given: &[(&str, bool)]) -> Result<(), Failure> {
    match given.iter().find(|(_, given)| *given) {
        None => Ok(()),
        Some((option, _)) => Err(Failure::input(format!(
            "{option} is for trees of links: say which by --model, or by [[link]] tables in the rig file"
        ))),
    }
}

fn refuse_others(arguments: &Identify) -> Result<(), Failure> {
    refuse_for_trees(&[&arguments.known, &arguments.tare, &arguments.remember])?;
    let path = &arguments.recording;
    let streams = rig_of(path, arguments.rig.as_deref()).is_some_and(|rig| !rig.stream.is_empty());
    if streams || is_rig_file(path) || path.is_dir() {
        return Err(Failure::input(
            "several files with clocks of their own ([[stream]]): for a single body only, not for a tree of links",
        ));
    }
    Ok(())
}
