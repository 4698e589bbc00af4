use std::process::ExitCode;

use crate::commands::calibrate::arguments::Verify;
use crate::commands::calibrate::options;
use crate::screen::outcome::{say, say_object};
use crate::{ExitStatus, Failure, Stages};
use rigident::application::{ReferenceOptions, ReferenceRuns};

/// Runs `rigident verify`.
pub(crate) fn run(arguments: &Verify) -> Result<ExitCode, Failure> {
    let calibration = arguments.calibration.calibration.clone();
    let options = ReferenceOptions { calibration, ..options(&arguments.runs, "verify")? };
    let stages = Stages::new("reading the recordings");
    let read = ReferenceRuns::read(&arguments.runs.recordings, &options, &stages.caller())?;
    let found = read.verify(&stages.caller())?;
    drop(stages);
    if arguments.runs.json {
        say_object(&found)?;
    } else {
        found.notes.iter().for_each(|note| tell!("rigident: {note}"));
        for recording in &found.recordings {
            let name = &recording.recording;
            recording.warnings.iter().for_each(|warning| tell!("rigident: {name}: {warning}"));
            say(recording.text(&found.reference));
        }
    }
    Ok(ExitStatus::of(found.passed).into())
}
