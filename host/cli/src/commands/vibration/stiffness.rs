//! `rigident vibration stiffness`: the springs by a body that is known.

use std::process::ExitCode;

use crate::commands::vibration::arguments::Stiffness;
use crate::screen::outcome::say_answer;
use crate::{ExitStatus, Failure, Stages};
use rigident::application::{StiffnessOptions, vibration_stiffness};

/// Runs `rigident vibration stiffness`.
pub(crate) fn run(arguments: &Stiffness) -> Result<ExitCode, Failure> {
    let options = StiffnessOptions {
        body: arguments.body.clone(),
        mounting: arguments.mounting.clone(),
        rig: arguments.rig.clone(),
        modes: arguments.modes,
    };
    let stages = Stages::new(&format!("reading {}", arguments.recording.display()));
    let found = vibration_stiffness(&arguments.recording, &options, &stages.caller())?;
    drop(stages);
    say_answer(&found, arguments.json)?;
    if !arguments.json {
        found.findings.iter().chain(&found.warnings).for_each(|warning| tell!("rigident: {warning}"));
    }
    Ok(ExitStatus::of(found.is_believed).into())
}
