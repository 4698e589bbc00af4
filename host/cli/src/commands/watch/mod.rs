//! `rigident watch`: a recording to the firmware over its link; it tells what changes of one link.

pub(crate) mod arguments;

use std::process::ExitCode;

use serde_json::json;

use crate::commands::watch::arguments::Watch;
use crate::screen::outcome::say;
use crate::{ExitStatus, Failure, Stages};
use rigident::application::watch::{Change, PARAMETERS, WatchStatus, WatchedLink};
use rigident::application::{self, WatchOptions};
use rigident::device::microcontroller::Microcontroller;

/// Runs `rigident watch`.
pub(crate) fn run(arguments: &Watch) -> Result<ExitCode, Failure> {
    let options = WatchOptions {
        link: arguments.link.clone(),
        tree: arguments.tree.typed()?,
        rig: arguments.rig.clone(),
        mcu: Microcontroller::named(&arguments.mcu),
        baud: arguments.baud,
        false_alarms_per_hour: arguments.false_alarms_per_hour,
        settle_s: arguments.settle_s,
    };
    let stages = Stages::new(&format!("reading {}", arguments.recording.display()));
    let mut noted = |note: &str| tell!("rigident: {note}");
    let mut found = |change: &Change| {
        if !arguments.json {
            say(text(change));
        }
    };
    let watched =
        application::watch(&arguments.recording, &options, &mut noted, &mut found, &stages.caller())?;
    drop(stages);
    watched.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    if arguments.json {
        say(json!(watched));
    } else if watched.broken.is_none() {
        say(summary(&watched));
    }
    match &watched.broken {
        Some(broken) => Err(ended(&watched, broken)),
        None => Ok(ExitStatus::of(watched.is_whole).into()),
    }
}

/// Says that a watch ended early, and what is left of it.
fn ended(watched: &WatchedLink, broken: &str) -> Failure {
    let found = watched.changes.len();
    Failure::link(format!(
        "the watch ended after {} of {} frames: {broken}\n{found} {} found until then, as listed above; \
         nothing is known of what came after",
        watched.frames.sent,
        watched.all_frames,
        if found == 1 { "change was" } else { "changes were" },
    ))
}

/// Describes a change. One that was not measured to the end has no size.
fn text(change: &Change) -> String {
    let Some(size) = &change.size else {
        return format!(
            "change {}: found at {:.3} s, {:.1} times the limit",
            change.change, change.found_s, change.times_the_limit
        );
    };
    let [from, to] = change.between_s;
    let mut said =
        format!("change {}: at {:.3} s, between {from:.3} and {to:.3} s", change.change, change.at_s);
    for (name, unit) in PARAMETERS {
        said += &match size.iter().find(|own| own.name == name) {
            Some(own) => format!("\n  {name:5} {:+.4} ± {:.4} {unit}", f64::from(own.change), own.u95),
            None => format!("\n  {name:5} not determined by the motion"),
        };
    }
    said
}

fn summary(watched: &WatchedLink) -> String {
    let settled = match watched.status {
        WatchStatus::NotSettled => {
            "the recording ended before the watch had settled: nothing could be found (--settle-s)".to_owned()
        }
        _ => format!("errors of the model make the limit {:.1} times as large", watched.excess),
    };
    format!(
        "{}: {} {} in {:.1} s of {} frames; {settled}",
        watched.link,
        watched.counted,
        if watched.counted == 1 { "change" } else { "changes" },
        watched.watched_s,
        watched.frames.given
    )
}
