//! `rigident run`: the request is checked, the body weighed, the motion consented to, driven and recorded.

pub(crate) mod adaptive;
pub(crate) mod arguments;
pub(crate) mod at_terminal;
pub(crate) mod by_hand;
pub(crate) mod programme;
pub(crate) mod refused;

use std::process::ExitCode;
use std::time::Instant;

use crate::commands::run::arguments::Run;
use crate::commands::run::at_terminal::AtTerminal;
use crate::device::experiment::{Watcher, conclude};
use crate::device::link::open;
use crate::device::report::Outlet;
use crate::device::tracking_error::{MotionLog, TrackingError};
use crate::screen::tell::WithoutWaiting;
use crate::{Failure, Folder};
use rigident::answer::now;
use rigident::application::Experiment;
use rigident::application::driving::{
    AtStart, DriveOptions, Driven, DrivingError, Request, TraceFile, prepare, stages,
};
use rigident::application::report::provenance;
use rigident::device::platform;
use rigident::device::session::Session;
use rigident::device::words::device_notes;
use rigident::present::{Decided, Stage};

/// Runs `rigident run`.
pub(crate) fn run(arguments: &Run) -> Result<ExitCode, Failure> {
    if arguments.platform == by_hand::NONE {
        return by_hand::run(arguments);
    }
    let started = Instant::now();
    let terminal = AtTerminal { yes: arguments.yes, dry_run: arguments.dry_run };
    let mut request = Request::new(options(arguments)?, &terminal)?;
    // What is reported while something moves waits for no terminal. It ends after the platform, which waits
    // for none either.
    let mut unwaiting = None;
    let connected = platform::connect(&arguments.platform, &request.geometry);
    let mut platform = connected.map_err(DrivingError::Unmoved)?;
    // A controller on a serial port is greeted by nobody but its driver.
    let (_, mut session) = open(arguments.device.port.as_deref(), &platform::port_of(&arguments.platform))?;
    let prepared = prepare(&mut request, platform.as_mut(), &mut session, &terminal)?;
    if arguments.dry_run {
        tell!("--dry-run: everything was done but the motion; nothing was moved");
        return Ok(ExitCode::SUCCESS);
    }
    // From here on there is a trace, whatever becomes of the run.
    let folder = Folder::new(arguments.output.out.as_deref(), "run")?;
    let trace = TraceFile::create(folder.file("trace.jsonl"))?;
    let there = (&terminal as &_, &trace);
    let agreed = prepared.agreed(&request, platform.as_mut(), &mut session, there)?;
    unwaiting.replace(WithoutWaiting::begin());
    let start = agreed.approached(&request, platform.as_mut(), &mut session, there)?;
    let (settings, span) = (start.prepared().settings.clone(), start.prepared().span);
    let mut watcher = watcher(arguments, &request, &start, &session, &folder)?;
    let watching = (&terminal as &_, &mut watcher as &mut _);
    let mut driven = start.drive(&request, platform.as_mut(), &mut session, watching)?;
    watcher.end(&mut driven.take);
    // Nothing moves any more.
    drop(unwaiting);
    let take = &mut driven.take;
    trace.note("ended", &serde_json::json!(take.broken.as_deref().unwrap_or("as planned, or by the user")));
    let samples = watcher.motion.take().map(MotionLog::end).transpose().unwrap_or_else(|error| {
        take.broken.get_or_insert_with(|| error.to_string());
        None
    });
    let loaded = driven.loaded(&request)?;
    let Course { stages, same_pose, decisions, reached, tracking } = course(&request, &mut driven, samples)?;
    let experiment = Experiment {
        asked: arguments.stop.asked(&arguments.output.estimate),
        // With --adaptive it is the planner that says.
        until: settings.stop.filter(|_| !arguments.adaptive.adaptive),
        span,
        stages,
        same_pose,
        tracking: tracking.as_ref().map(TrackingError::tracking),
        motion: tracking.as_ref().map_or_else(Vec::new, TrackingError::plots),
        decisions,
        course: reached,
        warnings: std::mem::take(&mut driven.warnings),
        ..Experiment::new(loaded, "port", session.identity(), request.known())
    };
    conclude(experiment, driven.take, Outlet { started, output: &arguments.output }, &folder)
}

/// Returns the options as the application takes them.
fn options(arguments: &Run) -> Result<DriveOptions, Failure> {
    Ok(DriveOptions {
        platform: arguments.platform.clone(),
        rig: arguments.rig.clone(),
        calibration: arguments.calibration.calibration.clone(),
        load: arguments.load.typed(),
        programme: arguments.programme.typed(),
        adaptive: arguments.adaptive.adaptive,
        end: arguments.adaptive.typed(),
        slow: arguments.slow,
        warm_up_s: arguments.warm_up_s,
        stop: arguments.stop.typed(),
        span: arguments.forgetting.asked(),
        known: arguments.known.parse()?,
        asked: arguments.output.estimate.clone(),
    })
}

/// Returns what watches and records the motion.
fn watcher(
    arguments: &Run,
    request: &Request,
    start: &AtStart<'_>,
    session: &Session,
    folder: &Folder,
) -> Result<Watcher, Failure> {
    let mut comments = device_notes(session.identity());
    comments.extend(provenance(&request.rig));
    // The device's clock begins with the device: this is the only date.
    comments.push(("recorded".to_owned(), now()));
    comments.extend(start.prepared().rest.comments());
    let is_fixed = request.fixed.is_some();
    let rows = if is_fixed { (start.longest_s(request) * request.rate_hz) as usize } else { 0 };
    let mut watcher = Watcher::recording(folder.file("run.mcap"), &request.rig, &comments, rows)?;
    watcher.motion = Some(MotionLog::create(folder.file("motion.csv"), &arguments.platform)?);
    Ok(watcher)
}

/// The course of a run.
struct Course {
    stages: Vec<Stage>,
    same_pose: Option<[(f64, f64); 2]>,
    decisions: Vec<Decided>,
    reached: Option<rigident::application::Course>,
    tracking: Option<TrackingError>,
}

/// Returns the course of a run, and how the platform followed.
fn course(
    request: &Request,
    driven: &mut Driven,
    samples: Option<Vec<platform::MotionSample>>,
) -> Result<Course, Failure> {
    let (stages, same_pose) = request.fixed.as_ref().map(stages).unwrap_or_default();
    let mut course = Course { stages, same_pose, decisions: Vec::new(), reached: None, tracking: None };
    let mut commanded = request.fixed.clone();
    if let Some(decided) = driven.decisions.take() {
        (course.stages, course.decisions) = (decided.stages, decided.decisions);
        (commanded, course.reached) = (decided.program, Some(decided.came));
    }
    let trajectory = commanded.map(|program| program.trajectory()).transpose().map_err(Failure::input)?;
    course.tracking =
        trajectory.zip(samples).and_then(|(trajectory, samples)| TrackingError::of(&trajectory, &samples));
    Ok(course)
}
