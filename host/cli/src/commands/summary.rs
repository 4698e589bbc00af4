use std::process::ExitCode;

use crate::commands::predict::arguments::Summary as Arguments;
use crate::screen::outcome::{say, say_in_one_line};
use crate::{ExitStatus, Failure};
use rigident::application::summary;
use rigident::present::repeated::text;

/// Runs `rigident summary`.
pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let found = summary(&arguments.results)?;
    for name in &found.left_out {
        tell!("rigident: {name}: its numbers are not to be used; it is left out");
    }
    for name in &found.given_twice {
        tell!("rigident: {name}: all its numbers are those of a result before it; one run is counted once");
    }
    let summed = &found.summary;
    if arguments.json {
        say_in_one_line(&found)?;
    } else {
        say(text(summed));
    }
    Ok(ExitStatus::of(summed.surprising.is_empty() && !summed.quantities.is_empty()).into())
}
