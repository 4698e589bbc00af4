//! `rigident vibration postures`: what locked postures tell of a tree.

use std::process::ExitCode;

use crate::commands::factor::absent;
use crate::commands::vibration::arguments::Postures;
use crate::screen::outcome::say_answer;
use crate::{ExitStatus, Failure, Stages};
use rigident::application::vibration_postures;
use rigident_io::recording::new_file::write_new_text;

/// Runs `rigident vibration postures`.
pub(crate) fn run(arguments: &Postures) -> Result<ExitCode, Failure> {
    for path in arguments.factor.iter().chain(&arguments.plot) {
        absent(path)?;
    }
    let stages = Stages::new("reading the recordings");
    let found = vibration_postures(&arguments.files, arguments.rig.as_deref(), &stages.caller())?;
    drop(stages);
    if let Some(path) = &arguments.factor {
        found.factor.write(path).map_err(Failure::input)?;
    }
    if let Some(path) = &arguments.plot {
        write_new_text(path, &found.figure()).map_err(Failure::input)?;
    }
    say_answer(&found, arguments.json)?;
    if !arguments.json {
        found.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    }
    Ok(ExitStatus::of(found.is_complete()).into())
}
