use std::process::ExitCode;
use std::sync::atomic::Ordering;

use hexapod::BodyParameters;

use crate::commands::factor::absent;
use crate::commands::plan::arguments::{MotionObjective, PlanCompare, PlanMotion};
use crate::kept::Stop;
use crate::options::test_body::DemoBody;
use crate::screen::outcome::{say, say_in_one_line};
use crate::{ExitStatus, Failure, Stages};
use rigident::application::{MotionOptions, compare_motions, plan_motion};
use rigident::plan::motion::Objective;
use rigident_io::recording::new_file::write_new_text;

/// Runs `rigident plan motion`.
pub(crate) fn run(arguments: &PlanMotion) -> Result<ExitCode, Failure> {
    // Said now rather than after the work.
    for path in [&arguments.out, &arguments.plot].into_iter().flatten() {
        absent(path)?;
    }
    let stop = Stop::of_this_command();
    let stages = Stages::new("motion");
    let planned = plan_motion(&options(arguments), &stop, &stages.caller())?;
    drop(stages);
    let stopped = stop.load(Ordering::Relaxed);
    planned.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    if let Some(path) = &arguments.out {
        planned.file().write(path).map_err(Failure::input)?;
        tell!("{}", path.display());
    }
    if let Some(path) = &arguments.plot {
        write_new_text(path, &planned.plot()?).map_err(Failure::input)?;
        tell!("{}", path.display());
    }
    if arguments.json {
        say_in_one_line(&planned.object())?;
    } else {
        say(planned.text());
    }
    Ok(ended(stopped, "motion"))
}

/// Returns the options as the application takes them.
fn options(arguments: &PlanMotion) -> MotionOptions {
    let body = arguments.body.map(|body| match body {
        DemoBody::Vertical => (BodyParameters::thesis_vertical(), "vertical"),
        DemoBody::Horizontal => (BodyParameters::thesis_horizontal(), "horizontal"),
    });
    MotionOptions {
        rig: arguments.rig.clone(),
        objective: match arguments.objective {
            MotionObjective::DOptimal => Objective::DOptimal,
            MotionObjective::Spheres => Objective::Spheres,
            MotionObjective::Rpy => Objective::RollPitchYaw,
            MotionObjective::Multisine => Objective::Multisine,
        },
        duration_s: arguments.duration_s,
        body: body.map(|(body, way)| (body, format!("the thesis' test body with plates, {way}"))),
        poses: !arguments.no_poses,
        highest_hz: arguments.highest_hz,
        reserve: arguments.reserve,
        stroke_m: arguments.stroke_m,
    }
}

/// Returns the exit status of a search; one that Ctrl-C has ended is partly done.
pub(crate) fn ended(stopped: bool, what: &str) -> ExitCode {
    if stopped {
        tell!("rigident: stopped by Ctrl-C: the best {what} found by then, there may be better ones");
        return ExitStatus::NotIdentified.into();
    }
    ExitCode::SUCCESS
}

/// Runs `rigident plan compare`.
pub(crate) fn compare(arguments: &PlanCompare) -> Result<ExitCode, Failure> {
    let stop = Stop::of_this_command();
    let stages = Stages::new("motions");
    let of = (arguments.rig.as_deref(), arguments.stroke_m, arguments.duration_s);
    let compared = compare_motions(of, &stop, &stages.caller())?;
    drop(stages);
    compared.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    if arguments.json {
        say_in_one_line(&compared.object())?;
    } else {
        say(compared.text());
    }
    Ok(ended(stop.load(Ordering::Relaxed), "motions"))
}
