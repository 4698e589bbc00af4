pub(crate) mod arguments;
pub(crate) mod drives;
pub(crate) mod imu;
pub(crate) mod joints;
pub(crate) mod load_cell;
pub(crate) mod masses;

use std::path::Path;
use std::process::ExitCode;

use serde::Serialize;

use crate::commands::calibrate::arguments::{Calibrate, CalibrateRig, CalibrateWhat, ReferenceRuns};
use crate::commands::factor;
use crate::screen::outcome::{say, say_object};
use crate::{Failure, Stages};
use rigident::application::recorded::{named, refuse_several};
use rigident::application::reference::{RigError, RigErrors};
use rigident::application::{self, ReferenceOptions};
use rigident::fit::figures::{significant, unit_symbol, with_u95};
use rigident_fit::COVERAGE_95;
use rigident_io::recording::new_file::write_new_text;

/// The object of `--json`.
#[derive(Serialize)]
struct Object<'a> {
    calibration: String,
    #[serde(flatten)]
    found: &'a RigErrors,
}

/// Runs `rigident calibrate`.
pub(crate) fn run(arguments: &Calibrate) -> Result<ExitCode, Failure> {
    match &arguments.what {
        CalibrateWhat::Rig(arguments) => rig(arguments),
        CalibrateWhat::Imu(arguments) => imu::run(arguments),
        CalibrateWhat::LoadCell(arguments) => load_cell::run(arguments),
        CalibrateWhat::Joints(arguments) => joints::run(arguments),
        CalibrateWhat::Drives(arguments) => drives::run(arguments),
        CalibrateWhat::Masses(arguments) => masses::run(arguments),
    }
}

/// Runs `rigident calibrate rig`.
fn rig(arguments: &CalibrateRig) -> Result<ExitCode, Failure> {
    factor::absent(&arguments.output)?;
    let options = ReferenceOptions { is_uncalibrated: true, ..options(&arguments.runs, "calibrate rig")? };
    let stages = Stages::new("reading the recordings");
    let read = application::ReferenceRuns::read(&arguments.runs.recordings, &options, &stages.caller())?;
    drop(stages);
    for run in &read.runs {
        run.warnings.iter().for_each(|warning| tell!("rigident: {}: {warning}", run.name));
    }
    let stages = Stages::new("calibration");
    let found = read.calibrate(&stages.caller())?;
    drop(stages);
    let calibration = found.calibration(&name_of(&arguments.output), arguments.valid_days);
    write_new_text(&arguments.output, &calibration.to_toml()).map_err(Failure::input)?;
    if arguments.runs.json {
        say_object(&Object { calibration: arguments.output.display().to_string(), found: &found })?;
    } else {
        found.notes.iter().for_each(|note| tell!("rigident: {note}"));
        say(text(&found.errors));
        say(format_args!(
            "\n{} in {}, valid for {} days. A rig file takes it by\n\n[calibration]\nfile = \"{}\"",
            rigident::fit::figures::counted(found.errors.len(), "error", "errors"),
            arguments.output.display(),
            calibration.valid_days,
            arguments.output.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
        ));
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns how recordings of a reference are read; `command` is named where several files of one recording
/// are refused.
pub(crate) fn options(runs: &ReferenceRuns, command: &'static str) -> Result<ReferenceOptions, Failure> {
    for path in &runs.recordings {
        refuse_several(&named(path.clone()), runs.rig.as_deref(), command)?;
    }
    Ok(ReferenceOptions {
        reference: runs.reference.clone(),
        mounting: runs.mounting.clone(),
        rig: runs.rig.clone(),
        tare: factor::fixtures(&runs.tare),
        ..ReferenceOptions::default()
    })
}

/// Returns the name of a calibration: that of its file, `.toml` and `.calibration` taken off.
fn name_of(path: &Path) -> String {
    let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    stem.strip_suffix(".calibration").unwrap_or(&stem).to_owned()
}

/// Returns the table: each error with its uncertainty, and what was known of it before.
fn text(errors: &[RigError]) -> String {
    let row = |e: &RigError| {
        let unit = if e.unit == "1" { "" } else { &e.unit };
        let before = format!("± {} {}", significant(COVERAGE_95 * e.sigma_before, 2), unit_symbol(unit));
        [e.name.clone(), with_u95(e.value, e.u95, unit), before.trim_end().to_owned()]
    };
    let rows: Vec<[String; 3]> = errors.iter().map(row).collect();
    let width = |k: usize| rows.iter().map(|row| row[k].chars().count()).max().unwrap_or(0);
    let (first, second) = (width(0), width(1));
    let line = |[a, b, c]: &[String; 3]| format!(" {a:<first$}  {b:<second$}  {c}");
    let head = ["error", "now, ± U95", "before"].map(str::to_owned);
    std::iter::once(&head).chain(&rows).map(line).collect::<Vec<_>>().join("\n")
}
