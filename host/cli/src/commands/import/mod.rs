pub(crate) mod arguments;
pub(crate) mod look;

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde_json::{Value, json};

use crate::Failure;
use crate::commands::import::arguments::{Decimal, Import, Sign};
use crate::screen::outcome::say;
use crate::screen::question::answered;
use rigident::device::session::INTERRUPTED;
use rigident_io::recording::import::{self, Choices, Columns, Proposed, Undecided, Understood, understand};
use rigident_io::recording::new_file::write_new_text;
use rigident_io::recording::{Recording, rig_path};
use rigident_io::rig::{DecimalMark, RigFile, Unit, WrenchSign};

/// Runs `rigident import`.
pub(crate) fn run(arguments: &Import) -> Result<ExitCode, Failure> {
    let to = target(arguments)?;
    if to.symlink_metadata().is_ok() {
        return Err(Failure::input(format!(
            "{} is there already, and nothing is overwritten: move it away, or give another name by --to",
            to.display()
        )));
    }
    let files = arguments.files.iter().map(|path| understand(path)).collect::<Result<Vec<_>, _>>()?;
    if !arguments.json {
        files.iter().for_each(show);
    }
    let is_asked = std::io::stdin().is_terminal() && !arguments.json && !arguments.yes;
    let mut choices = choices(arguments)?;
    let mut proposals = Vec::new();
    for file in &files {
        proposals.push((file, decided(file, &mut choices, is_asked)?));
    }
    choices.check(&files).map_err(Failure::input)?;
    let sign = sign(arguments, &proposals, is_asked)?;
    let mut recordings = Vec::new();
    for (file, columns) in &proposals {
        let read = file.read_as(columns, sign, choices.decimal).map_err(Failure::from);
        let is_part = files.len() > 1;
        let read = read.map_err(|error| if is_part { error } else { error.after("nothing was written") });
        recordings.push(Some(read?));
    }
    let text = import::rig_text(&proposals, &recordings, sign, choices.decimal);
    // It is read as any other will be.
    RigFile::parse(&text)?;
    write_new_text(&to, &text)?;
    if arguments.json {
        say(object(&to, &proposals, &recordings));
    } else {
        proposals
            .iter()
            .zip(&recordings)
            .for_each(|(proposal, recording)| show_proposed(proposal, recording.as_ref()));
        let has_imu = recordings.iter().flatten().any(|recording| !recording.imus.is_empty());
        let place = if has_imu { ", and write the IMU's place and axes, which no file says" } else { "" };
        say(format_args!("{}: written; look through it{place}", to.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the rig file to write.
fn target(arguments: &Import) -> Result<PathBuf, Failure> {
    let folder = |path: &Path| path.parent().map(Path::to_owned).unwrap_or_default();
    match (&arguments.to, arguments.files.as_slice()) {
        (None, [one]) => Ok(rig_path(one)),
        (None, _) => Err(Failure::input(
            "several files are one recording by a rig file of its own name: give it by --to",
        )),
        (Some(to), files) => {
            if !to.to_string_lossy().ends_with(".rig.toml") {
                return Err(Failure::input(format!(
                    "--to {}: the name of a rig file ends in .rig.toml",
                    to.display()
                )));
            }
            let other = files.iter().find(|file| files.len() > 1 && folder(file) != folder(to));
            match other {
                Some(file) => Err(Failure::input(format!(
                    "{} is in another folder than {}: a rig file names the files beside it",
                    file.display(),
                    to.display()
                ))),
                None => Ok(to.clone()),
            }
        }
    }
}

/// Returns what the options say.
pub(crate) fn choices(arguments: &Import) -> Result<Choices, Failure> {
    let decimal = arguments.decimal.map(|mark| match mark {
        Decimal::Point => DecimalMark::Point,
        Decimal::Comma => DecimalMark::Comma,
    });
    Choices::read(&arguments.column, &arguments.unit, decimal).map_err(Failure::input)
}

/// Returns where the known columns are, with answers to what the file does not say.
fn decided(file: &Understood, choices: &mut Choices, is_asked: bool) -> Result<Columns, Failure> {
    loop {
        let missing = match file.decided(choices) {
            Ok(found) => return Ok(found),
            Err(error @ (Undecided::NoneKnown | Undecided::Twice { .. })) => {
                return Err(Failure::input(format!(
                    "{}: {error} by --column, as in --column fx_n=NAME:N",
                    file.file
                )));
            }
            Err(Undecided::Units(names)) => names,
            Err(error @ Undecided::TimeForm { .. }) => {
                return Err(Failure::input(format!("{}: {error}", file.file)));
            }
            Err(error @ Undecided::NoColumn(_)) => return Err(Failure::input(error)),
        };
        if !is_asked {
            return Err(Failure::input(format!(
                "{}: the unit of {} is written nowhere: give it by --unit, as in --unit \"{}={}\"",
                file.file,
                missing.join(", "),
                missing.first().map_or("Fx", String::as_str),
                missing.first().map_or("N", |name| Undecided::example(name))
            )));
        }
        for name in missing {
            let unit = ask(&format!("Unit of {name:?}? "))?;
            if Unit::parse(&unit).is_none() {
                return Err(Failure::input(format!(
                    "{unit:?} is no unit that is known (docs/formats.md has them)"
                )));
            }
            choices.units.insert(name, unit);
        }
    }
}

/// Returns whose sign the wrench has.
pub(crate) fn sign(
    arguments: &Import,
    proposals: &[Proposed<'_>],
    is_asked: bool,
) -> Result<WrenchSign, Failure> {
    let has_wrench = proposals.iter().any(|(_, columns)| columns.contains_key("fz_n"));
    match arguments.sign {
        Some(Sign::OnBody) => Ok(WrenchSign::OnBody),
        Some(Sign::OnSensor) => Ok(WrenchSign::OnSensor),
        None if has_wrench && is_asked => {
            let answer = ask(
                "Is the wrench that of the sensor on the body (at rest the force points up), or the reaction \
                 (down)?\n\
                 on_body or on_sensor [on_body]: ",
            )?;
            match answer.as_str() {
                "" | "on_body" => Ok(WrenchSign::OnBody),
                "on_sensor" => Ok(WrenchSign::OnSensor),
                other => Err(Failure::input(format!("{other:?} is neither on_body nor on_sensor"))),
            }
        }
        None => Ok(WrenchSign::OnBody),
    }
}

fn ask(question: &str) -> Result<String, Failure> {
    eprint!("{question}");
    // A terminal that cannot be written to cannot be read from either.
    let _ = std::io::stderr().flush();
    let read = || {
        let mut answer = String::new();
        std::io::stdin().read_line(&mut answer).map(|_| answer)
    };
    match answered(read, &INTERRUPTED)? {
        Some(answer) => Ok(answer.trim().to_owned()),
        None => Err(Failure::interrupted("stopped; nothing was written")),
    }
}

/// Shows how a file is written.
fn show(file: &Understood) {
    let how: Vec<String> = file.written.iter().map(|(key, value)| format!("{key}: {value}")).collect();
    let mut text = format!("{}: {}", file.file, how.join("; "));
    if let Some(line) = file.header_line {
        text += &format!("; header in line {line}");
    }
    for column in &file.columns {
        let own = column.unit.as_deref().filter(|unit| !column.name.contains(unit));
        let unit = own.map_or_else(String::new, |unit| format!(" [{unit}]"));
        text += &format!("\n  {}{unit}: {} …", column.name, column.cells.join(", "));
    }
    say(text);
}

/// Shows what a file's columns are taken for.
fn show_proposed((file, columns): &Proposed<'_>, recording: Option<&Recording>) {
    let mut text = format!("{}:", file.file);
    for (known, (name, unit)) in columns {
        let unit = unit.as_deref().map_or_else(String::new, |unit| format!(" in {unit}"));
        text += &format!("\n  {known} = {name:?}{unit}");
    }
    for joint in file.joints() {
        let effort = joint.effort.map_or_else(String::new, |effort| format!(", effort {effort:?}"));
        text += &format!("\n  joint {} = {:?}{effort}", joint.name, joint.position);
    }
    if let Some(recording) = recording {
        let rate = recording.rate_hz.map_or_else(String::new, |rate| format!(", {rate:.6} rows per second"));
        text += &format!("\n  {} rows{rate}", recording.rows());
        recording.warnings.iter().for_each(|warning| text += &format!("\n  {warning}"));
    }
    say(text);
}

/// Returns what `--json` prints.
fn object(to: &Path, proposals: &[Proposed<'_>], recordings: &[Option<Recording>]) -> Value {
    let files = proposals.iter().zip(recordings).map(|((file, columns), recording)| {
        let written: serde_json::Map<String, Value> =
            file.written.iter().map(|(key, value)| ((*key).to_owned(), json!(value))).collect();
        let known = |name: &str| columns.iter().find(|(_, (own, _))| own == name);
        let of = |column: &import::FileColumn| {
            let known = known(&column.name);
            json!({
                "name": column.name,
                "unit": known.and_then(|(_, (_, unit))| unit.clone()).or_else(|| column.unit.clone()),
                "column": known.map(|(known, _)| known),
                "cells": column.cells,
            })
        };
        json!({
            "file": file.file,
            "written": written,
            "header_line": file.header_line,
            "columns": file.columns.iter().map(of).collect::<Vec<_>>(),
            "rows": recording.as_ref().map(Recording::rows),
            "rate_hz": recording.as_ref().and_then(|recording| recording.rate_hz),
            "warnings": recording.as_ref().map(|recording| recording.warnings.clone()),
        })
    });
    json!({ "rig": to.display().to_string(), "files": files.collect::<Vec<_>>() })
}
