use std::process::ExitCode;
use std::sync::atomic::Ordering;

use crate::commands::factor::absent;
use crate::commands::plan::arguments::{PlanPoses, PoseObjective as Asked};
use crate::commands::plan::motion::ended;
use crate::kept::Stop;
use crate::screen::outcome::{say, say_in_one_line};
use crate::{Failure, Stages};
use rigident::application::{PoseObjective, PoseOptions, plan_poses};

/// Runs `rigident plan poses`.
pub(crate) fn run(arguments: &PlanPoses) -> Result<ExitCode, Failure> {
    // Said now rather than after the work.
    arguments.out.as_deref().map_or(Ok(()), absent)?;
    let stop = Stop::of_this_command();
    let stages = Stages::new("poses");
    let planned = plan_poses(&options(arguments), &stop, &stages.caller())?;
    drop(stages);
    let stopped = stop.load(Ordering::Relaxed);
    planned.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    if let Some(path) = &arguments.out {
        let (file, [duration_s, rest_s]) = planned.file()?;
        file.write(path).map_err(Failure::input)?;
        tell!("{}: {duration_s:.1} s, {rest_s:.1} s of them at rest", path.display());
    }
    if arguments.json {
        say_in_one_line(&planned.object())?;
    } else {
        say(planned.text());
    }
    Ok(ended(stopped, "poses"))
}

/// Returns the options as the application takes them.
fn options(arguments: &PlanPoses) -> PoseOptions {
    PoseOptions {
        rig: arguments.rig.clone(),
        n: arguments.n,
        angles_deg: arguments.angles.as_ref().map(|angles| angles.0.clone()),
        stroke_m: arguments.stroke_m,
        margin: arguments.margin,
        objective: match arguments.objective {
            Asked::Condition => PoseObjective::Condition,
            Asked::Determinant => PoseObjective::Determinant,
            Asked::WorstUncertainty => PoseObjective::WorstUncertainty,
        },
        hold_s: arguments.hold_s,
    }
}
