use std::process::ExitCode;
use std::time::Instant;

use super::arguments::Replay;
use super::experiment::{Watcher, conclude};
use super::run_report::Outlet;
use super::{Failure, Folder, Stages, factor};
use rigident::application::{self, ReplayOptions};
use rigident::device::microcontroller::Microcontroller;

/// `rigident replay`
pub(super) fn run(arguments: &Replay) -> Result<ExitCode, Failure> {
    let outlet = Outlet { started: Instant::now(), output: &arguments.output };
    let options = ReplayOptions {
        rig: arguments.rig.clone(),
        calibration: arguments.calibration.calibration.clone(),
        tree: arguments.tree.typed()?,
        mcu: Microcontroller::named(&arguments.mcu),
        stop: arguments.stop.typed(),
        span: arguments.forgetting.asked(),
        tare: factor::fixtures(&arguments.tare),
        known: arguments.known.parse()?,
        asked: arguments.output.estimate.clone(),
    };
    let stages = Stages::new(&format!("reading {}", arguments.recording.display()));
    let replay = application::Replay::new(&arguments.recording, &options, &stages.caller())?;
    drop(stages);
    let connected = replay.connect()?;
    let folder = Folder::new(arguments.output.out.as_deref(), "replay")?;
    let mut watcher = Watcher::new(connected.count());
    let (experiment, take) = connected.run(&mut watcher)?;
    watcher.finish()?;
    conclude(experiment, take, outlet, &folder)
}
