//! `rigident run`: the request is checked, the body weighed, the motion consented to, driven and recorded.

pub(crate) mod adaptive;
pub(crate) mod arguments;
pub(crate) mod by_hand;
pub(crate) mod consent;
pub(crate) mod guards;
pub(crate) mod programme;
pub(crate) mod refused;
pub(crate) mod trace;
pub(crate) mod zeroing;

mod request;

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hexapod::Pose;

use crate::commands::run::adaptive::{Concluded, Directing};
use crate::commands::run::arguments::Run;
use crate::screen::confirm;
use crate::screen::confirm::Agreed;

use crate::commands::run::trace::TraceFile;
use crate::commands::run::zeroing::{Rest, warm_up, weigh, zero, zero_second};
use crate::device::experiment::{Watcher, conclude};
use crate::device::link::{configured, of_sensors, open};
use crate::device::report::Outlet;
use crate::device::tracking_error::{MotionLog, TrackingError};
use crate::options::forgetting::RowsOf;
use crate::screen::tell::WithoutWaiting;
use crate::{Failure, Folder};
use request::Request;
use rigident::answer::now;
use rigident::application::report::provenance;
use rigident::application::{Experiment, Loaded};
use rigident::device::calibrated_board::another_board;
use rigident::device::platform::{self, Platform, PlatformError, check};
use rigident::device::session::{INTERRUPTED, Session, SessionError, Take, settings, sound, two_links};
use rigident::device::words::device_notes;
use rigident_shared::forgetting::Span;
use rigident_shared::wire::Settings;

/// Runs `rigident run`.
pub(crate) fn run(arguments: &Run) -> Result<ExitCode, Failure> {
    if arguments.platform == by_hand::NONE {
        return by_hand::run(arguments);
    }
    let started = Instant::now();
    let mut request = Request::new(arguments)?;
    // What is reported while something moves waits for no terminal. It ends after the platform, which waits
    // for none either.
    let mut unwaiting = None;
    let mut platform = platform::connect(&arguments.platform, &request.geometry).map_err(unmoved)?;
    // A controller on a serial port is greeted by nobody but its driver.
    let (_, mut session) = open(arguments.device.port.as_deref(), &platform::port_of(&arguments.platform))?;
    let (span, stood) = first_look(&request, platform.as_mut(), &mut session)?;
    let mut warnings = Vec::from_iter(another_board(&request.rig, session.identity()));
    warm_up(&mut session, &request.rig, arguments.warm_up_s, &mut warnings)?;
    let from = platform.expects();
    let ready = Ready::new(&mut request, platform.as_mut(), &mut session, span, stood, &mut warnings)?;
    if arguments.dry_run {
        tell!("--dry-run: everything was done but the motion; nothing was moved");
        return Ok(ExitCode::SUCCESS);
    }
    // From here on there is a trace, whatever becomes of the run.
    let folder = Folder::new(arguments.output.out.as_deref(), "run")?;
    let trace = TraceFile::create(folder.file("trace.jsonl"))?;
    agreed(&request, &ready, platform.as_mut(), &mut session, &trace)?;
    unwaiting.replace(WithoutWaiting::begin());
    let Ready { rest, settings, mut directing, .. } = ready;
    let mut driven =
        driven(&request, &rest, directing.as_mut(), platform.as_mut(), &mut session, &folder, &trace)?;
    left(platform.as_mut(), from.as_ref(), &driven.take, &mut warnings);
    // Nothing moves any more.
    drop(unwaiting);
    let take = &mut driven.take;
    trace.note("ended", &serde_json::json!(take.broken.as_deref().unwrap_or("as planned, or by the user")));
    let samples = driven.motion.map(MotionLog::end).transpose().unwrap_or_else(|error| {
        take.broken.get_or_insert_with(|| error.to_string());
        None
    });
    let (mut stages, same_pose) = request.fixed.as_ref().map(programme::stages).unwrap_or_default();
    let (mut decisions, mut commanded, mut reached) = (Vec::new(), request.fixed.clone(), None);
    if let Some(concluded) = directing.map(Directing::concluded) {
        let Concluded { came, warnings: own, .. } = concluded;
        (stages, decisions, commanded) = (concluded.stages, concluded.decisions, concluded.program);
        warnings.extend(own);
        reached = Some(came);
    }
    let trajectory = commanded.map(|program| program.trajectory()).transpose().map_err(Failure::input)?;
    let tracking_error =
        trajectory.zip(samples).and_then(|(trajectory, samples)| TrackingError::of(&trajectory, &samples));
    let loaded = loaded(&request, take, &mut warnings)?;
    let experiment = Experiment {
        asked: arguments.stop.asked(&arguments.output.estimate),
        // With --adaptive it is the planner that says.
        until: settings.stop.filter(|_| !arguments.adaptive.adaptive),
        span,
        stages,
        same_pose,
        tracking: tracking_error.as_ref().map(TrackingError::tracking),
        motion: tracking_error.as_ref().map_or_else(Vec::new, TrackingError::plots),
        decisions,
        course: reached,
        warnings,
        ..Experiment::new(loaded, "port", session.identity(), &request.known)
    };
    conclude(experiment, driven.take, Outlet { started, output: &arguments.output }, &folder)
}

/// Asks the device for what it can do, weighs what the plate carries, and shows what would be driven.
///
/// # Errors
/// Bad input, a device that cannot do it, a limit that would be exceeded. Nothing was moved.
fn first_look(
    request: &Request,
    platform: &mut dyn Platform,
    session: &mut Session,
) -> Result<(Option<Span<f64>>, Option<Pose>), Failure> {
    let (arguments, rig) = (request.arguments, &request.rig);
    // Any noise does while nothing is absorbed.
    let mut standing =
        settings(rig, &of_sensors(request.rate_hz), Some([1.0; 6]), None).map_err(Failure::input)?;
    // What cannot be asked for is said before anything moves.
    arguments.stop.put_into(&mut standing, &request.parameters)?;
    let span = arguments.forgetting.span(&RowsOf::moving(request.rate_hz))?;
    configured(session, &standing)?;
    // Nothing moves on a guess of what the plate carries: it is weighed.
    let body = weigh(&zeroing::look(session, rig)?, rig)?;
    if let (Some(carries), Some(body)) = (&request.carries, &body) {
        zeroing::check_carries(carries, rig, body)?;
    }
    // Until the noise is known, to see whether anything can be done at all.
    let directing = arguments.adaptive.directing(rig, &request.geometry, &standing, body.clone())?;
    let summary = request.checked(platform, body.as_ref(), directing.as_ref())?;
    if let (Some(program), Some(peaks)) = (&request.fixed, request.within_ranges(body.as_ref())?) {
        tell!("{}", peaks.to_string().trim_end());
        platform.load(program).map_err(unmoved)?;
    }
    let mut consent = request.consent(&summary, request.cell_stopped(body.as_ref())?);
    consent.found = platform.found();
    consent.show();
    if !arguments.dry_run {
        confirm::can_be_asked(arguments.yes)?;
    }
    Ok((span, platform.stands().map_err(unmoved)?))
}

/// Everything but the motion is done.
struct Ready {
    rest: Rest,
    settings: Settings,
    directing: Option<Directing>,
    /// The consented motion, as it was shown.
    shown: String,
    /// The plate's pose then, as far as the platform knows.
    stands: Option<Pose>,
}

impl Ready {
    /// Zeroes the sensors, configures the device, weighs again and shows what is consented to.
    ///
    /// # Errors
    /// A plate that is not where it should be, a limit that would be exceeded, a link that broke. Nothing was
    /// moved.
    fn new(
        request: &mut Request,
        platform: &mut dyn Platform,
        session: &mut Session,
        span: Option<Span<f64>>,
        stood: Option<Pose>,
        warnings: &mut Vec<String>,
    ) -> Result<Self, Failure> {
        let timing = of_sensors(request.rate_hz);
        let rest = zero(session, &mut request.rig, warnings)?;
        let stands = platform.stands().map_err(unmoved)?;
        let attitude = zeroing::check_attitude(&rest, &request.rig, stands.as_ref(), warnings)?;
        if request.links.is_some() {
            zero_second(session, &mut request.rig, &timing, &rest)?;
        }
        let (arguments, rig) = (request.arguments, &request.rig);
        let mut settings = rest.settings(rig, &timing, span)?;
        arguments.stop.put_into(&mut settings, &request.parameters)?;
        configured(session, &settings)?;
        // It may have been changed since: what is driven is checked with what is carried now.
        let body = weigh(&rest, rig)?;
        let directing = arguments.adaptive.directing(rig, &request.geometry, &settings, body.clone())?;
        let summary = request.checked(platform, body.as_ref(), directing.as_ref())?;
        request.within_ranges(body.as_ref())?;
        guards::watch(session, rig, arguments.adaptive.axes())?;
        let mut consent = request.consent(&summary, request.cell_stopped(body.as_ref())?);
        (consent.guards, consent.attitude) = (Some(consent::guards(session)), Some(attitude));
        consent.moved = stood.zip(stands).filter(|(a, b)| !platform::near(a, b)).map(|(a, b)| [a, b]);
        warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
        consent.show();
        let shown = consent.to_string();
        Ok(Self { rest, settings, directing, shown, stands })
    }
}

/// Asks for consent, and counts down.
///
/// # Errors
/// Consent was not given, or the rig was touched meanwhile. Nothing was moved.
fn agreed(
    request: &Request,
    ready: &Ready,
    platform: &mut dyn Platform,
    session: &mut Session,
    trace: &TraceFile,
) -> Result<(), Failure> {
    trace.note("shown", &serde_json::json!(ready.shown));
    trace.note("program", &serde_json::to_value(&request.fixed).map_err(Failure::input)?);
    platform.trace(trace.of_the_line());
    let agreed = confirm::agree(request.arguments.yes)?;
    if agreed == Agreed::AtTerminal {
        zeroing::check_untouched(&ready.rest, &zeroing::look(session, &request.rig)?)?;
    }
    trace.note("consent", &serde_json::json!({ "by": agreed.words(), "at": now() }));
    confirm::count_down()?;
    let now = platform.stands().map_err(unmoved)?;
    match ready.stands.zip(now).filter(|(shown, now)| !platform::near(shown, now)) {
        Some((shown, now)) => Err(Failure::link(format!(
            "the plate was at {} when its way was shown, and is at {}: another program, or its own \
             panel, has moved it. Run again.\n\
             Nothing was moved.",
            check::words(&shown),
            check::words(&now)
        ))),
        None => Ok(()),
    }
}

/// The recording of a motion.
struct Driven {
    take: Take,
    motion: Option<MotionLog>,
}

/// Drives the platform and records.
///
/// # Errors
/// The way to the first pose was not finished, a file cannot be written, or the link broke at once.
fn driven(
    request: &Request,
    rest: &Rest,
    directing: Option<&mut Directing>,
    platform: &mut dyn Platform,
    session: &mut Session,
    folder: &Folder,
    trace: &TraceFile,
) -> Result<Driven, Failure> {
    let (arguments, rig) = (request.arguments, &request.rig);
    if request.fixed.is_some() {
        tell!("to the first pose");
        approach(platform, session, trace)?;
    }
    let longest_s = request.longest_s(directing.as_deref());
    let mut comments = device_notes(session.identity());
    comments.extend(provenance(rig));
    // The device's clock begins with the device: this is the only date.
    comments.push(("recorded".to_owned(), now()));
    comments.extend(rest.comments());
    let rows = if directing.is_some() { 0 } else { (longest_s * request.rate_hz) as usize };
    let mut watcher = Watcher::recording(folder.file("run.mcap"), rig, &comments, rows)?;
    watcher.motion = Some(MotionLog::create(folder.file("motion.csv"), &arguments.platform)?);
    tell!("the experiment takes {}{longest_s:.0} s", if directing.is_some() { "at most " } else { "" });
    session.at_most_s = arguments.adaptive.at_most_s;
    let mut take = match directing {
        Some(directing) => session.follow_decided(platform, directing, &mut watcher),
        None => {
            let program = request.fixed.as_ref();
            let program = program.ok_or_else(|| Failure::input("there is no motion program"))?;
            session.follow(platform, program, &mut watcher)
        }
    }
    .map_err(Failure::link)?;
    watcher.end(&mut take);
    Ok(Driven { take, motion: watcher.motion.take() })
}

/// Leaves the platform, and warns of how it was left.
fn left(platform: &mut dyn Platform, from: Option<&Pose>, take: &Take, warnings: &mut Vec<String>) {
    if let (Some(home), Some(at)) = (from, platform.expects())
        && (take.broken.is_some() || take.interrupted)
        && check::words(&at) != check::words(home)
    {
        warnings.push(format!(
            "the plate was left at {}; the next run over this address begins at home: bring it there first",
            check::words(&at)
        ));
    }
    match platform.release() {
        Ok(left) => warnings.extend(left),
        Err(error) => {
            warnings.push(format!("the platform's controller could not be left as it was found: {error}"));
        }
    }
}

/// Returns the recording as the application takes it.
///
/// # Errors
/// Readings that make no rows.
fn loaded(request: &Request, take: &mut Take, warnings: &mut Vec<String>) -> Result<Loaded, Failure> {
    let (rig, rate_hz) = (&request.rig, request.rate_hz);
    let mut read = match &request.links {
        Some(_) => two_links::recording("run", rig, rate_hz, &take.links),
        None => sound::recording("run", rig, rate_hz, &take.readings),
    };
    warnings.extend(sound::judge(&mut read, take));
    Ok(match &request.links {
        Some((model, _)) => Loaded::of_links(&read, model)?,
        None => Loaded::of_readings("run", rig, std::mem::take(&mut take.readings), Some(rate_hz), false),
    })
}

/// Brings the plate to the first pose. The device is heard meanwhile: nobody may keep it waiting.
fn approach(platform: &mut dyn Platform, session: &mut Session, trace: &TraceFile) -> Result<(), Failure> {
    let (near, mut why) = (AtomicBool::new(false), None);
    session.watches(true);
    let go_on = || ![&INTERRUPTED, &near].iter().any(|stop| stop.load(Ordering::Relaxed));
    let approached = std::thread::scope(|scope| {
        let moving = scope.spawn(|| platform.approach(&go_on));
        while !moving.is_finished() {
            match session.watch(0.1, &mut Watcher::new(0)) {
                Ok(_) if go_on() => continue,
                Err(error @ (SessionError::NearRange { .. } | SessionError::Unheard(_))) => {
                    near.store(true, Ordering::Relaxed);
                    why = Some(error);
                }
                // What else is wrong with the device is found out by the experiment itself.
                _ => {}
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        moving.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    });
    session.watches(false);
    let kept = format!("what went over the line to the platform is in {}", trace.path().display());
    match (approached, why) {
        (_, Some(error)) => Err(Failure::link(format!(
            "on the way to the first pose: {error}.\nThe platform was stopped; nothing was recorded, {kept}."
        ))),
        (Ok(()), None) => Ok(()),
        (Err(PlatformError::Interrupted), None) => Err(Failure::interrupted(format!(
            "stopped on the way to the first pose; nothing was recorded, {kept}"
        ))),
        (Err(other), None) => Err(Failure::link(format!("{other}\nNothing was recorded; {kept}."))),
    }
}

/// Returns the failure of a platform that was not asked for anything yet.
fn unmoved(error: PlatformError) -> Failure {
    let said = format!("{error}\nNothing was moved.");
    match error {
        PlatformError::Address { .. } | PlatformError::Motion(_) | PlatformError::TooLong { .. } => {
            Failure::input(said)
        }
        _ => Failure::link(said),
    }
}
