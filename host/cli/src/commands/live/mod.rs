//! `rigident live`: sensors that people own feed the firmware, and the answer grows.

pub(crate) mod arguments;

use std::process::ExitCode;
use std::time::Instant;

use crate::commands::live::arguments::Live;
use crate::device::experiment::Watcher;
use crate::device::report::{Outlet, show};
use crate::{Failure, Folder, Stages};
use rigident::application::live::Fed;
use rigident::application::recorded::STREAMS;
use rigident::application::{self, Error, LiveOptions, NextMove};
use rigident::device::microcontroller::Microcontroller;
use rigident_io::recording::new_file::write_new_text;

/// Runs `rigident live`.
pub(crate) fn run(arguments: &Live) -> Result<ExitCode, Failure> {
    let outlet = Outlet { started: Instant::now(), output: &arguments.output };
    let options = LiveOptions {
        wrench: arguments.wrench.clone(),
        imu: arguments.imu.clone(),
        pose: arguments.pose.clone(),
        rig: arguments.rig.clone(),
        calibration: arguments.calibration.calibration.clone(),
        mcu: Microcontroller::named(&arguments.mcu),
        at_most_s: arguments.at_most_s,
        stop: arguments.stop.typed(),
        known: arguments.known.parse()?,
        asked: arguments.output.estimate.clone(),
    };
    let mut live = application::Live::open(&options)?;
    let folder = Folder::new(arguments.output.out.as_deref(), "live")?;
    live.record(folder.path())?;
    tell!("recording into {}; Ctrl-C ends it and keeps everything", folder.path().display());
    let place = format!("What was recorded is in {}", folder.path().display());
    let fed = fed(&mut live, arguments, &folder);
    let (listing, closed) = live.close();
    let path = folder.file(STREAMS);
    write_new_text(&path, &listing.to_toml()).map_err(Failure::input)?;
    let mut fed = fed.map_err(|failure| failure.after(&format!("{place}.")))?;
    if let Some(closed) = closed {
        fed.broken.get_or_insert(closed);
    }
    let stages = Stages::new("estimate");
    let identified = live.answer(&path, fed, &stages.caller()).map_err(|error| unanswered(error, &place))?;
    drop(stages);
    show(identified, outlet, |_| Ok(Vec::new()), || Ok(Some(folder.clone())))
}

/// Feeds the device, and records what it is given.
fn fed(live: &mut application::Live<'_>, arguments: &Live, folder: &Folder) -> Result<Fed, Failure> {
    let stages = Stages::new("first look at the sources");
    let looked = live.look(&stages.caller())?;
    let feed = live.connect(&looked, &stages.caller())?;
    drop(stages);
    let mut watcher =
        Watcher::recording(folder.file("live.mcap"), &feed.recorded, &feed.comments, feed.expected)?;
    let asked = arguments.stop.asked(&arguments.output.estimate);
    watcher.next_move = Some(NextMove::new(&feed.with_noise, feed.rate_hz, &asked));
    let mut fed = live.feed(feed, &mut watcher)?;
    watcher.next_move = None;
    if let Err(failure) = watcher.finish() {
        fed.broken.get_or_insert_with(|| failure.to_string());
    }
    Ok(fed)
}

/// Says why there is no answer, and where what was recorded is.
fn unanswered(error: Error, place: &str) -> Failure {
    match error {
        Error::Unanswered { broken: Some(broken), error } => {
            let error = Failure::from(*error);
            Failure::link(format!("{broken}\n{place}, and does not make an answer: {error}"))
        }
        Error::Unanswered { broken: None, error } => Failure::from(*error).after(&format!("{place}.")),
        other => other.into(),
    }
}
