//! `rigident import --look`: what is understood of files, and what a user is still to say, as an object;
//! nothing is written.

use std::path::Path;
use std::process::ExitCode;

use serde_json::{Value, json};

use crate::Failure;
use crate::commands::import;
use crate::commands::import::arguments::Import;
use crate::screen::outcome::say;
use rigident::application::recorded::is_rig_file;
use rigident::application::see_streams;
use rigident_io::recording::import::{
    Choices, Columns, FileColumn, Proposed, Undecided, Understood, rig_text, understand,
};
use rigident_io::recording::{Recording, rig_path};

/// A file that is understood to the end: its columns, and what they read.
type Decided = (Understood, Columns, Recording);

/// Runs `rigident import --look`.
pub(crate) fn run(arguments: &Import) -> Result<ExitCode, Failure> {
    let choices = import::choices(arguments)?;
    let files = match arguments.files.as_slice() {
        [rig] if is_rig_file(rig) => vec![json!(see_streams(rig)?)],
        files => {
            let looks = files.iter().map(|path| look(path, arguments, &choices));
            let (seen, decided): (Vec<_>, Vec<_>) = looks.collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
            let decided: Option<Vec<Decided>> = decided.into_iter().collect();
            let joint = decided.filter(|all| all.len() > 1).map(|all| joint_rig(all, arguments, &choices));
            if let Some(rig) = joint.transpose()? {
                say(format_args!("{:#}", json!({ "files": seen, "rig": rig })));
                return Ok(ExitCode::SUCCESS);
            }
            seen
        }
    };
    say(format_args!("{:#}", json!({ "files": files })));
    Ok(ExitCode::SUCCESS)
}

/// Returns the text of the rig file that makes one recording of several files, each with its own clock.
fn joint_rig(all: Vec<Decided>, arguments: &Import, choices: &Choices) -> Result<String, Failure> {
    let files: Vec<Understood> = all.iter().map(|(file, ..)| file.clone()).collect();
    choices.check(&files).map_err(Failure::input)?;
    let proposals: Vec<Proposed<'_>> = all.iter().map(|(file, columns, _)| (file, columns.clone())).collect();
    let sign = import::sign(arguments, &proposals, false)?;
    let recordings: Vec<Option<Recording>> =
        all.iter().map(|(.., recording)| Some(recording.clone())).collect();
    Ok(rig_text(&proposals, &recordings, sign, choices.decimal))
}

/// Examines a file: by the rig file beside it, or by what its columns may be. Of several files each choice of
/// a column is about those that have one of that name.
///
/// # Errors
/// Bad input: it cannot be read, or holds no table.
fn look(path: &Path, arguments: &Import, choices: &Choices) -> Result<(Value, Option<Decided>), Failure> {
    let name = path.file_name().map(|name| name.to_string_lossy());
    let is_alone = arguments.files.len() == 1;
    if is_alone && rig_path(path).exists() {
        let recording = Recording::load(path, None)?;
        let seen = json!({
            "file": name,
            "rig_file": rig_path(path).file_name().map(|name| name.to_string_lossy()),
            "recording": recording.overview(),
            "warnings": recording.warnings,
        });
        return Ok((seen, None));
    }
    let file = match understand(path) {
        Ok(file) => file,
        // A bag, or a format of motion capture, is understood as it is or not at all.
        Err(error) => match Recording::load(path, None) {
            Ok(recording) => {
                let seen = json!({
                    "file": name, "recording": recording.overview(), "warnings": recording.warnings,
                });
                return Ok((seen, None));
            }
            Err(_) => return Err(error.into()),
        },
    };
    if is_alone {
        choices.check(std::slice::from_ref(&file)).map_err(Failure::input)?;
    }
    let mut found = understood(&file);
    let columns = match file.decided(choices) {
        Ok(columns) => columns,
        Err(error) => {
            found["error"] = json!(error.to_string());
            if let Undecided::Units(names) = error {
                found["missing_units"] = json!(names);
            }
            return Ok((found, None));
        }
    };
    for column in found["columns"].as_array_mut().into_iter().flatten() {
        let known = columns.iter().find(|(_, (own, _))| column["name"].as_str() == Some(own));
        if let Some((known, (_, unit))) = known {
            column["column"] = json!(known);
            if let Some(unit) = unit {
                column["unit"] = json!(unit);
            }
        }
    }
    let proposals: [Proposed<'_>; 1] = [(&file, columns)];
    let sign = import::sign(arguments, &proposals, false)?;
    let [(_, columns)] = &proposals;
    match file.read_as(columns, sign, choices.decimal) {
        Ok(recording) => {
            found["recording"] = json!(recording.overview());
            found["warnings"] = json!(recording.warnings);
            let read = [Some(recording)];
            found["rig"] = json!(rig_text(&proposals, &read, sign, choices.decimal));
            let ([(_, columns)], [recording]) = (proposals, read);
            let decided = recording.map(|recording| (file.clone(), columns, recording));
            Ok((found, decided))
        }
        Err(error) => {
            found["error"] = json!(Failure::from(error).to_string());
            Ok((found, None))
        }
    }
}

/// Returns how a file is written, and its columns.
fn understood(file: &Understood) -> Value {
    let written: serde_json::Map<String, Value> =
        file.written.iter().map(|(key, value)| ((*key).to_owned(), json!(value))).collect();
    let column = |column: &FileColumn| {
        json!({
            "name": column.name,
            "unit": column.unit,
            "column": column.meaning.as_ref().map(|meaning| &meaning.known),
            "is_clock": column.is_clock,
            "cells": column.cells,
        })
    };
    json!({
        "file": file.file,
        "written": written,
        "header_line": file.header_line,
        "columns": file.columns.iter().map(column).collect::<Vec<_>>(),
    })
}
