use std::path::Path;
use std::process::ExitCode;

use serde::Serialize;

use super::calibration_arguments::{Calibrate, CalibrateRig, CalibrateWhat};
use super::outcome::say;
use super::reference_runs::{RigErrors, read};
use super::{
    Failure, Stages, calibrate_drives, calibrate_imu, calibrate_joints, calibrate_load_cell,
    calibrate_masses, factor,
};
use rigident::fit::figures::{significant, unit_symbol, with_u95};
use rigident::reference::{Calibrated, Run, calibrate};
use rigident_fit::{COVERAGE_95, Nuisance, RowSource};
use rigident_io::recording::new_file::write_new_text;
use rigident_io::rig::RigCalibration;
use rigident_io::rig::calibration::CalibratedRig;

/// The object of `--json`.
#[derive(Serialize)]
struct Object<'a> {
    calibration: String,
    reference: &'a str,
    recordings: &'a [String],
    errors: Vec<Found>,
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    notes: &'a [String],
}

/// One error, before and after.
#[derive(Serialize)]
struct Found {
    name: String,
    group: String,
    unit: String,
    sigma_before: f64,
    value: f64,
    sigma: f64,
    u95: f64,
}

/// `rigident calibrate`
pub(super) fn run(arguments: &Calibrate) -> Result<ExitCode, Failure> {
    match &arguments.what {
        CalibrateWhat::Rig(arguments) => rig(arguments),
        CalibrateWhat::Imu(arguments) => calibrate_imu::run(arguments),
        CalibrateWhat::LoadCell(arguments) => calibrate_load_cell::run(arguments),
        CalibrateWhat::Joints(arguments) => calibrate_joints::run(arguments),
        CalibrateWhat::Drives(arguments) => calibrate_drives::run(arguments),
        CalibrateWhat::Masses(arguments) => calibrate_masses::run(arguments),
    }
}

/// `rigident calibrate rig`
fn rig(arguments: &CalibrateRig) -> Result<ExitCode, Failure> {
    factor::absent(&arguments.output)?;
    let (body, all) = read(&arguments.runs, RigErrors::Uncalibrated, "calibrate rig")?;
    let mut of: Option<CalibratedRig> = None;
    for read in &all {
        read.warnings.iter().for_each(|warning| tell!("rigident: {}: {warning}", read.name));
        let own = CalibratedRig::of(&read.problem.rig).map_err(Failure::input)?;
        if of.as_ref().is_some_and(|of| *of != own) {
            return Err(Failure::input(format!(
                "{}: its rig file is of another rig than that of {}: calibrate one rig at a time",
                read.name,
                all.first().map_or("", |first| &first.name)
            )));
        }
        of = Some(own);
    }
    let of = of.ok_or_else(|| Failure::input("there is no recording"))?;
    let stages = Stages::new("calibration");
    let runs: Vec<Run> = all.iter().map(|read| read.run()).collect::<Result<_, _>>()?;
    let fingerprints: Vec<String> =
        runs.iter().map(|run| RigCalibration::fingerprint(run.source.identity().fingerprint)).collect();
    for (k, run) in runs.iter().enumerate() {
        if fingerprints.get(k).is_some_and(|own| fingerprints.iter().take(k).any(|other| other == own)) {
            return Err(Failure::input(format!(
                "{} is given twice: its readings would count twice, without knowing more",
                run.name
            )));
        }
    }
    let found = calibrate(&runs, &|stage: &str, share: f64| stages.at(stage, share));
    drop(stages);
    let found = found.map_err(|error| Failure::input(format!("{error}. Nothing was saved")))?;
    let units: Vec<String> = found.before.iter().map(|k| k.unit.clone()).collect();
    let calibration = RigCalibration {
        name: name_of(&arguments.output),
        valid_days: arguments.valid_days,
        reference: body.name.clone(),
        recordings: all.iter().map(|read| read.name.clone()).collect(),
        fingerprints,
        assumed: body.place.assumed().into_iter().collect(),
        ..RigCalibration::of(&found.known, &units, of)
    }
    .sealed();
    write_new_text(&arguments.output, &calibration.to_toml()).map_err(Failure::input)?;
    let errors = errors(&found);
    if arguments.runs.json {
        let object = Object {
            calibration: arguments.output.display().to_string(),
            reference: &body.name,
            recordings: &calibration.recordings,
            errors,
            notes: &calibration.assumed,
        };
        say(serde_json::to_string_pretty(&object).map_err(Failure::input)?);
    } else {
        calibration.assumed.iter().for_each(|note| tell!("rigident: {note}"));
        say(text(&errors));
        say(format_args!(
            "\n{} in {}, valid for {} days. A rig file takes it by\n\n[calibration]\nfile = \"{}\"",
            rigident::fit::figures::counted(errors.len(), "error", "errors"),
            arguments.output.display(),
            calibration.valid_days,
            arguments.output.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
        ));
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the name of a calibration: that of its file, `.toml` and `.calibration` taken off.
fn name_of(path: &Path) -> String {
    let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    stem.strip_suffix(".calibration").unwrap_or(&stem).to_owned()
}

fn errors(found: &Calibrated) -> Vec<Found> {
    let of = |nuisance: &Nuisance| {
        let (value, sigma) = found.known.value(&nuisance.name).zip(found.known.sd(&nuisance.name))?;
        Some(Found {
            name: nuisance.name.clone(),
            group: nuisance.group.clone(),
            unit: nuisance.unit.clone(),
            sigma_before: nuisance.sigma,
            value,
            sigma,
            u95: COVERAGE_95 * sigma,
        })
    };
    found.before.iter().filter_map(of).collect()
}

/// Returns the table: each error with its uncertainty, and what was known of it before.
fn text(errors: &[Found]) -> String {
    let rows: Vec<[String; 3]> = errors
        .iter()
        .map(|e| {
            let unit = if e.unit == "1" { "" } else { &e.unit };
            let before = format!("{} {}", significant(COVERAGE_95 * e.sigma_before, 2), unit_symbol(unit));
            [e.name.clone(), with_u95(e.value, e.u95, unit), format!("± {}", before.trim_end())]
        })
        .collect();
    let width = |k: usize| rows.iter().filter_map(|row| row.get(k)).map(|cell| cell.chars().count()).max();
    let (first, second) = (width(0).unwrap_or(0), width(1).unwrap_or(0));
    let line = |[a, b, c]: &[String; 3]| format!(" {a:<first$}  {b:<second$}  {c}");
    let head = ["error", "now, ± U95", "before"].map(str::to_owned);
    std::iter::once(&head).chain(&rows).map(line).collect::<Vec<_>>().join("\n")
}
