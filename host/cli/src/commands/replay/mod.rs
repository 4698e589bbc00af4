pub(crate) mod arguments;

use std::process::ExitCode;
use std::time::Instant;

use crate::commands::factor;
use crate::commands::replay::arguments::Replay;
use crate::device::experiment::{Watcher, conclude};
use crate::device::report::Outlet;
use crate::{Failure, Folder, Stages};
use rigident::application::{self, ReplayOptions};
use rigident::device::microcontroller::Microcontroller;

/// Runs `rigident replay`.
pub(crate) fn run(arguments: &Replay) -> Result<ExitCode, Failure> {
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
