pub(crate) mod arguments;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use crate::commands::factor;
use crate::commands::identify::arguments::Identify;
use crate::device::report::{Outlet, show};
use crate::screen::outcome::{CANNOT_BE_TRUE, say_not_written};
use crate::{Failure, Folder, Stages, certificate};
use rigident::application::recorded::listed;
use rigident::application::{self, IdentifyOptions, Recorded, payload, write_loads};
use rigident::rows::tree::drive::Friction;
#[cfg(not(target_family = "wasm"))]
use rigident_io::recording::Recording;

/// Runs `rigident identify` by its words: files that a list names, and their check sums for a certificate.
pub(crate) fn of_words(mut arguments: Identify) -> Result<ExitCode, Failure> {
    arguments.recording = listed(arguments.recording);
    let (rig, tare) = (arguments.rig.as_deref(), &arguments.tare.tare);
    arguments.output.evidence = certificate::evidence(&arguments.recording, rig, tare);
    run(&arguments)
}

fn run(arguments: &Identify) -> Result<ExitCode, Failure> {
    identify(arguments, Recorded::File(arguments.recording.clone()))
}

/// Runs `rigident identify` with a recording in memory; `--rig` is then of a fixture's recordings alone.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn of_recording(arguments: &Identify, recording: Recording) -> Result<ExitCode, Failure> {
    identify(arguments, recording.into())
}

fn identify(arguments: &Identify, recording: Recorded) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    let options = options(arguments)?;
    let loads: &[PathBuf] = &arguments.payload.write_load;
    payload::check_files(loads)?;
    let stages = Stages::new(&format!("reading {}", arguments.recording.display()));
    let found = application::identify(recording, &options, &stages.caller())?;
    // What is written while the stages are shown would be mixed with them.
    drop(stages);
    if options.payload.is_some() && found.answer.payload.is_none() {
        arguments.payload.tell_refused("the recording with the payload cannot be true");
    }
    if let Some(path) = &options.write_model
        && found.model.is_none()
        && found.answer.is_contradicted()
    {
        say_not_written(path, CANNOT_BE_TRUE);
    }
    let out = arguments.output.out.as_deref();
    let write =
        |found: &application::Identified| Ok(write_loads(&found.answer, loads, &Stages::silent().caller())?);
    let outlet = Outlet { started, output: &arguments.output };
    show(found, outlet, write, || Folder::new(out, "identify").map(Some))
}

/// Returns the options as the application takes them.
fn options(arguments: &Identify) -> Result<IdentifyOptions, Failure> {
    let tree = &arguments.tree;
    Ok(IdentifyOptions {
        rig: arguments.rig.clone(),
        calibration: arguments.calibration.calibration.clone(),
        span: arguments.forgetting.asked(),
        tare: factor::fixtures(&arguments.tare),
        known: arguments.known.parse()?,
        asked: arguments.output.estimate.clone(),
        tree: tree.of.typed()?,
        friction: Friction::parse(&tree.friction).map_err(Failure::input)?,
        drives: tree.drive.clone(),
        nominal_sigma: tree.nominal_sigma,
        symmetric_sides: tree.symmetric_sides,
        write_model: tree.write_model.clone(),
        payload: arguments.payload.payload.clone(),
    })
}
