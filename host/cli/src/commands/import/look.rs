//! `rigident import --look`: what is understood of files, and what a user is still to say, as an object;
//! nothing is written.

use std::path::Path;
use std::process::ExitCode;

use serde_json::{Value, json};

use crate::Failure;
use crate::commands::import;
use crate::commands::import::arguments::Import;
use crate::screen::outcome::say;
use rigident_io::recording::columns::TIME;
use rigident_io::recording::import::{
    Choices, FileColumn, Proposed, Undecided, Understood, rig_text, understand,
};
use rigident_io::recording::{Recording, rig_path};

/// `rigident import --look`
pub(crate) fn run(arguments: &Import) -> Result<ExitCode, Failure> {
    let choices = import::choices(arguments)?;
    let files = arguments.files.iter().map(|path| look(path, arguments, &choices));
    let files = files.collect::<Result<Vec<_>, _>>()?;
    say(format_args!("{:#}", json!({ "files": files })));
    Ok(ExitCode::SUCCESS)
}

/// Examines a file: by the rig file beside it, or by what its columns may be.
///
/// # Errors
/// Bad input: it cannot be read, or holds no table.
fn look(path: &Path, arguments: &Import, choices: &Choices) -> Result<Value, Failure> {
    if rig_path(path).exists() {
        let recording = Recording::load(path, None)?;
        return Ok(json!({
            "file": path.file_name().map(|name| name.to_string_lossy()),
            "rig_file": rig_path(path).file_name().map(|name| name.to_string_lossy()),
            "recording": recording.overview(),
            "warnings": recording.warnings,
        }));
    }
    let file = match understand(path) {
        Ok(file) => file,
        // A bag, or a format of motion capture, is understood as it is or not at all.
        Err(error) => match Recording::load(path, None) {
            Ok(recording) => {
                return Ok(json!({
                    "file": path.file_name().map(|name| name.to_string_lossy()),
                    "recording": recording.overview(),
                    "warnings": recording.warnings,
                }));
            }
            Err(_) => return Err(error.into()),
        },
    };
    choices.check(std::slice::from_ref(&file)).map_err(Failure::input)?;
    let mut found = understood(&file);
    let columns = match file.proposal(choices) {
        Ok(columns) if columns.keys().any(|known| known != TIME) => columns,
        Ok(_) => {
            found["error"] = json!("none of its columns is known by its name: say which is which");
            return Ok(found);
        }
        Err(Undecided::Units(names)) => {
            found["error"] = json!(format!("the unit of {} is written nowhere", names.join(", ")));
            found["missing_units"] = json!(names);
            return Ok(found);
        }
        Err(error) => {
            found["error"] = json!(error.to_string());
            return Ok(found);
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
    match file.read_as(&proposals[0].1, sign, choices.decimal) {
        Ok(recording) => {
            found["recording"] = json!(recording.overview());
            found["warnings"] = json!(recording.warnings);
            found["rig"] = json!(rig_text(&proposals, &[Some(recording)], sign, choices.decimal));
        }
        Err(error) => found["error"] = json!(Failure::from(error).to_string()),
    }
    Ok(found)
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
