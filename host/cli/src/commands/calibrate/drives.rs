//! `rigident calibrate drives`: gains of drives from recordings of motor currents.

use std::fmt::Write as _;
use std::process::ExitCode;

use serde::Serialize;

use crate::commands::calibrate::arguments::CalibrateDrives;
use crate::commands::factor;
use crate::screen::outcome::say;
use crate::{ExitStatus, Failure, Stages};
use rigident::application::{DriveGain, DriveGainOptions, DriveGains, Tree, drive_gains};
use rigident::fit::figures::{NOT_IDENTIFIED, with_u95};
use rigident::rows::tree::drive::Friction;
use rigident_io::recording::new_file::write_new_text;

/// The object of `--json`.
#[derive(Serialize)]
struct Object<'a> {
    schema: &'static str,
    status: &'static str,
    drives: Vec<Drive<'a>>,
    /// The joint whose gain ratios are to.
    #[serde(skip_serializing_if = "Option::is_none")]
    ratios_to: Option<&'a str>,
    rounds: usize,
    notes: &'a [String],
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Drive<'a> {
    joint: &'a str,
    column: &'a str,
    /// N m (N) per unit of the column; not there where it is not identified.
    #[serde(skip_serializing_if = "Option::is_none")]
    gain: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gain_u95: Option<f64>,
    unit: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    ratio: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ratio_u95: Option<f64>,
}

/// Runs `rigident calibrate drives`.
pub(crate) fn run(arguments: &CalibrateDrives) -> Result<ExitCode, Failure> {
    if let Some(path) = &arguments.output {
        factor::absent(path)?;
    }
    let options = DriveGainOptions {
        rig: arguments.rig.clone(),
        tree: Tree { model: Some(arguments.model.clone()), changes: arguments.changes.typed()? },
        friction: Friction::parse(&arguments.friction).map_err(Failure::input)?,
        drives: arguments.drive.clone(),
        loaded: arguments.loaded.clone().zip(arguments.payload.clone()),
        known: arguments.known.parse()?,
        nominal_sigma: arguments.nominal_sigma,
    };
    let stages = Stages::new("reading the model");
    let found = drive_gains(&arguments.recordings, &options, &stages.caller())?;
    drop(stages);
    let warnings = warnings(arguments, &found);
    if let Some(path) = arguments.output.as_ref().filter(|_| found.drives.iter().any(|d| d.is_identified)) {
        write_new_text(path, &found.rig.to_toml()).map_err(Failure::input)?;
    }
    if arguments.json {
        let object = Object {
            schema: "rigident/drive-gains/1",
            status: if found.is_complete() { "identified" } else { "not_identified" },
            drives: found.drives.iter().map(drive).collect(),
            ratios_to: found.reference.and_then(|to| found.drives.get(to)).map(|to| to.joint.as_str()),
            rounds: found.rounds,
            notes: &found.notes,
            warnings,
        };
        say(serde_json::to_string_pretty(&object).map_err(Failure::input)?);
    } else {
        say(words(&found).trim_end());
        found.notes.iter().for_each(|note| tell!("rigident: {note}"));
        warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
        if let Some(path) = arguments.output.as_ref().filter(|path| path.exists()) {
            say(format_args!("\nRig file in {}.", path.display()));
        }
    }
    Ok(ExitStatus::of(found.is_complete()).into())
}

fn unit(drive: &DriveGain) -> String {
    if drive.unit.is_empty() { "SI/unit".to_owned() } else { format!("N m/{}", drive.unit) }
}

fn drive(drive: &DriveGain) -> Drive<'_> {
    Drive {
        joint: &drive.joint,
        column: &drive.column,
        gain: drive.is_identified.then_some(drive.gain),
        gain_u95: drive.is_identified.then_some(drive.u95),
        unit: unit(drive),
        ratio: drive.ratio.map(|ratio| ratio.0),
        ratio_u95: drive.ratio.map(|ratio| ratio.1),
    }
}

fn warnings(arguments: &CalibrateDrives, found: &DriveGains) -> Vec<String> {
    let mut warnings = found.warnings.clone();
    if found.is_complete() {
        if arguments.nominal_sigma.is_some() {
            warnings.push(
                "the size of all gains rests on the model's masses, trusted as said by --nominal-sigma; a \
                 load that is known tells it by itself"
                    .to_owned(),
            );
        }
        return warnings;
    }
    let has_size = arguments.loaded.is_some() || arguments.nominal_sigma.is_some();
    if found.reference.is_some() && found.drives.iter().all(|drive| !drive.is_identified) && !has_size {
        warnings.push(
            "the currents tell the ratios of the gains and not how large they are: record a load \
             that is known (--loaded, --payload, --known mass_kg=…), or trust the model's masses \
             (--nominal-sigma 0.1)"
                .to_owned(),
        );
    }
    let open =
        found.drives.iter().filter(|drive| !drive.is_identified && (has_size || drive.ratio.is_none()));
    let open: Vec<&str> = open.map(|drive| drive.joint.as_str()).collect();
    if has_size && !open.is_empty() {
        let more = match arguments.nominal_sigma {
            Some(_) => "record a load that is known",
            None => "state more of the load, or take a heavier one",
        };
        warnings.push(format!(
            "the gains of {} are known to more than a tenth only: move them so that they carry the weight, \
             {more}",
            open.join(", ")
        ));
    }
    warnings
}

/// Returns the table of the gains.
fn words(found: &DriveGains) -> String {
    let width = found.drives.iter().map(|drive| drive.joint.chars().count()).max().unwrap_or(5).max(5);
    let mut out = "Gains of the drives: effort = gain × column\n\n".to_owned();
    let reference = found.reference.and_then(|to| found.drives.get(to)).map(|to| to.joint.as_str());
    let _ =
        writeln!(out, "  {:<width$}  {:<26}  ratio to {}", "joint", "gain ± U95", reference.unwrap_or("–"));
    for drive in &found.drives {
        let gain = match drive.is_identified {
            true => with_u95(drive.gain, drive.u95, &unit(drive)),
            false => NOT_IDENTIFIED.to_owned(),
        };
        let ratio = match drive.ratio {
            Some((value, u95)) => with_u95(value, u95, ""),
            None if reference == Some(drive.joint.as_str()) => "1".to_owned(),
            None => NOT_IDENTIFIED.to_owned(),
        };
        let _ = writeln!(out, "  {:<width$}  {gain:<26}  {ratio}", drive.joint);
    }
    out
}
