use std::process::ExitCode;

use crate::commands::plan::arguments::Statics as Arguments;
use crate::screen::outcome::{say, say_in_one_line};
use crate::{ExitStatus, Failure};
use rigident::application::{StaticsOptions, statics};

/// Runs `rigident statics`.
pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let options = StaticsOptions { rig: arguments.rig.clone(), reference: arguments.reference };
    let found = statics(&arguments.recording, &options)?;
    if arguments.json {
        say_in_one_line(&found)?;
    } else {
        found.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
        say(&found);
    }
    Ok(ExitStatus::of(found.is_whole()).into())
}
