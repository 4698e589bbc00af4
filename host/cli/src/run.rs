use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hexapod::{BodySet, Geometry, MotionProgram};

use super::adaptive::Directing;
use super::arguments::Run;
use super::confirm::{self, Agreed};
use super::consent::{self, Consent};
use super::experiment::{Experiment, Watcher, device_notes};
use super::link::{configured, device_settings, of_sensors, open};
use super::links_on_device::{check_asked, device_parameters};
use super::options::calibration;
use super::options::forgetting::RowsOf;
use super::refused::refuse_for_trees;
use super::tell::WithoutWaiting;
use super::trace::TraceFile;
use super::tracking_error::{MotionLog, TrackingError};
use super::zeroing::{self, warm_up, weigh, zero, zero_second};
use super::{Failure, Folder, by_hand, guards, programme};
use rigident::answer::now;
use rigident::application::report::provenance;
use rigident::application::{Loaded, calibrate};
use rigident::device::platform::check::Summary;
use rigident::device::platform::{self, Platform, PlatformError, check};
use rigident::device::session::tree::device_tree;
use rigident::device::session::{INTERRUPTED, Session, SessionError, settings, sound, two_links};
use rigident::plan::ranges::{self, RangePeaks};
use rigident::plan::{carried, machine};
use rigident::rows::named_model::rig_links::from_tables;
use rigident_fit::Parameter;
use rigident_io::rig::RigFile;
use rigident_model::Model;

/// `rigident run`
pub(super) fn run(arguments: &Run) -> Result<ExitCode, Failure> {
    if arguments.platform == by_hand::NONE {
        return by_hand::run(arguments);
    }
    let started = Instant::now();
    let known = arguments.known.parse()?;
    let mut rig = RigFile::load(&arguments.rig).map_err(Failure::input)?;
    arguments.load.put_into(&mut rig)?;
    let calibrated = arguments.calibration.calibration.as_deref();
    calibrate(&mut rig, calibrated)?;
    let links = links_of(arguments, &rig)?;
    if links.is_some() {
        calibration::refuse_for_trees(calibrated)?;
    }
    let parameters = match &links {
        Some((_, parameters)) => parameters.clone(),
        None => Loaded::of_readings("run", &rig, Vec::new(), Some(1.0), false).source().parameters().to_vec(),
    };
    check_asked(&parameters, &known, &arguments.output)?;
    let rate_hz = rig.recording.rate_hz.unwrap_or(1000.0);
    let geometry = machine::geometry_or_thesis(&rig)
        .map_err(|e| Failure::input(format!("{}: {e}\nNothing was moved.", arguments.rig.display())))?;
    let described = machine::is_described(&rig);
    if described && geometry.has_joints() {
        programme::tell_collisions(&geometry);
    }
    if !described && !platform::checks_itself(&arguments.platform) {
        return Err(Failure::input(format!(
            "{} does not say which machine is at {}: its [platform] must give base_joints_m, plate_joints_m and leg_length_m, \
             or travel_m and travel_rad where joints are not published, so that its limits can be checked before anything moves.\nNothing was moved.",
            arguments.rig.display(),
            arguments.platform
        )));
    }
    let planned =
        if arguments.adaptive.adaptive { None } else { Some(arguments.programme.planned(&geometry)?) };
    let (fixed, carries) = planned.map_or((None, None), |planned| (Some(planned.program), planned.carries));
    arguments.adaptive.check()?;
    check_slow(arguments.slow)?;
    let fixed = fixed.map(|program| arguments.slow.map_or(program.clone(), |share| program.slowed(share)));
    zeroing::bound(&rig)?;
    // What is reported while something moves waits for no terminal. It ends after the platform, which waits
    // for none either.
    let mut unwaiting = None;
    let mut platform = platform::connect(&arguments.platform, &geometry).map_err(unmoved)?;
    // A controller on a serial port is greeted by nobody but its driver.
    let (_, mut session) = open(arguments.device.port.as_deref(), &platform::port_of(&arguments.platform))?;
    let timing = of_sensors(rate_hz);
    // Any noise does while nothing is absorbed.
    let mut standing = settings(&rig, &timing, Some([1.0; 6]), None).map_err(Failure::input)?;
    // What cannot be asked for is said before anything moves.
    arguments.stop.put_into(&mut standing, &parameters)?;
    let span = arguments.forgetting.span(&RowsOf::moving(rate_hz))?;
    configured(&mut session, &standing)?;
    // Nothing moves on a guess of what the plate carries: it is weighed.
    let body = weigh(&zeroing::look(&mut session, &rig)?, &rig)?;
    if let (Some(carries), Some(body)) = (&carries, &body) {
        zeroing::check_carries(carries, &rig, body)?;
    }
    // Until the noise is known, to see whether anything can be done at all.
    let directing = arguments.adaptive.directing(&rig, &geometry, &standing, body.clone())?;
    let about = About { arguments, geometry: &geometry, described, fixed: fixed.as_ref() };
    let summary = about.checked(platform.as_mut(), &rig, body.as_ref(), directing.as_ref())?;
    if let Some(program) = &fixed {
        tell!("{}", within_ranges(program, &rig, body.as_ref())?.to_string().trim_end());
        platform.load(program).map_err(unmoved)?;
    }
    about.consent(&summary, &rig, platform.found(), None).show();
    if !arguments.dry_run {
        confirm::can_be_asked(arguments.yes)?;
    }

    let mut warnings = Vec::new();
    warm_up(&mut session, &rig, arguments.warm_up_s, &mut warnings)?;
    let from = platform.expects();
    let rest = zero(&mut session, &mut rig, &mut warnings)?;
    let stands = platform.stands().map_err(unmoved)?;
    zeroing::check_attitude(&rest, &rig, stands.as_ref(), &mut warnings)?;
    if links.is_some() {
        zero_second(&mut session, &mut rig, &timing, &rest)?;
    }
    let mut settings = rest.settings(&rig, &timing, span)?;
    arguments.stop.put_into(&mut settings, &parameters)?;
    configured(&mut session, &settings)?;

    // It may have been changed since: what is driven is checked with what is carried now.
    let body = weigh(&rest, &rig)?;
    let mut directing = arguments.adaptive.directing(&rig, &geometry, &settings, body.clone())?;
    let summary = about.checked(platform.as_mut(), &rig, body.as_ref(), directing.as_ref())?;
    if let Some(program) = &fixed {
        within_ranges(program, &rig, body.as_ref())?;
    }
    guards::watch(&mut session, &rig, arguments.adaptive.axes())?;
    let consent = about.consent(&summary, &rig, Vec::new(), Some(consent::guards(&session)));
    warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    consent.show();
    if arguments.dry_run {
        tell!("--dry-run: everything was done but the motion; nothing was moved");
        return Ok(ExitCode::SUCCESS);
    }
    // From here on there is a trace, whatever becomes of the run.
    let folder = Folder::new(arguments.output.out.as_deref(), "run")?;
    let trace = TraceFile::create(folder.file("trace.jsonl"))?;
    trace.note("shown", &serde_json::json!(consent.to_string()));
    trace.note("program", &serde_json::to_value(&fixed).map_err(Failure::input)?);
    platform.trace(trace.of_the_line());
    let agreed = confirm::agree(arguments.yes)?;
    if agreed == Agreed::AtTerminal {
        zeroing::check_untouched(&rest, &zeroing::look(&mut session, &rig)?)?;
    }
    trace.note("consent", &serde_json::json!({ "by": agreed.words(), "at": now() }));
    confirm::count_down()?;
    let (mut stages, mut same_pose) = (Vec::new(), None);
    unwaiting.replace(WithoutWaiting::begin());
    if let Some(program) = &fixed {
        (stages, same_pose) = programme::stages(program);
        tell!("to the first pose");
        approach(platform.as_mut(), &mut session, &trace)?;
    }
    let longest_s = match (&directing, &fixed) {
        (Some(directing), _) => directing.at_most_s(),
        (None, program) => program
            .as_ref()
            .map_or(0.0, MotionProgram::duration_s)
            .min(arguments.adaptive.at_most_s.unwrap_or(f64::INFINITY)),
    };
    let mut comments = device_notes(session.identity());
    comments.extend(provenance(&rig));
    // The device's clock begins with the device: this is the only date.
    comments.push(("recorded".to_owned(), now()));
    comments.extend(rest.comments());
    let mut watcher = Watcher::recording(
        folder.file("run.mcap"),
        &rig,
        &comments,
        if directing.is_some() { 0 } else { (longest_s * rate_hz) as usize },
    )?;
    watcher.motion = Some(MotionLog::create(folder.file("motion.csv"), &arguments.platform)?);
    tell!("the experiment takes {}{longest_s:.0} s", if directing.is_some() { "at most " } else { "" });
    session.at_most_s = arguments.adaptive.at_most_s;
    let mut take = match &mut directing {
        Some(directing) => session.follow_decided(platform.as_mut(), directing, &mut watcher),
        None => {
            let program = fixed.as_ref().ok_or_else(|| Failure::input("there is no motion program"))?;
            session.follow(platform.as_mut(), program, &mut watcher)
        }
    }
    .map_err(Failure::link)?;
    watcher.end(&mut take);
    if let (Some(home), Some(at)) = (&from, platform.expects())
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
    // Nothing moves any more.
    drop(unwaiting);
    trace.note("ended", &serde_json::json!(take.broken.as_deref().unwrap_or("as planned, or by the user")));
    let samples = watcher.motion.take().map(MotionLog::end).transpose().unwrap_or_else(|error| {
        take.broken.get_or_insert_with(|| error.to_string());
        None
    });
    let (mut decisions, mut commanded, mut came) = (Vec::new(), fixed, None);
    if let Some(directing) = directing {
        let concluded = directing.concluded();
        (stages, decisions, commanded) = (concluded.stages, concluded.decisions, concluded.program);
        warnings.extend(concluded.warnings);
        came = Some(concluded.came);
    }
    let trajectory = commanded.map(|program| program.trajectory()).transpose().map_err(Failure::input)?;
    let tracking_error =
        trajectory.zip(samples).and_then(|(trajectory, samples)| TrackingError::of(&trajectory, &samples));
    let mut read = match &links {
        Some(_) => two_links::recording("run", &rig, rate_hz, &take.links),
        None => sound::recording("run", &rig, rate_hz, &take.readings),
    };
    warnings.extend(sound::judge(&mut read, &mut take));
    let loaded = match &links {
        Some((model, _)) => Loaded::of_links(&read, model)?,
        None => Loaded::of_readings("run", &rig, std::mem::take(&mut take.readings), Some(rate_hz), false),
    };
    Experiment {
        started,
        output: &arguments.output,
        stop: &arguments.stop,
        loaded,
        mcu: "port",
        identity: session.identity(),
        known: &known,
        tare: None,
        // With --adaptive it is the planner that says.
        until: settings.stop.filter(|_| !arguments.adaptive.adaptive),
        span,
        parameter_truth: None,
        stages,
        same_pose,
        tracking_error,
        decisions,
        came,
        notes: Vec::new(),
        warnings,
    }
    .conclude(take, &folder)
}

/// Returns the tree of a rig file with several links, if the device takes it from sensors, with its parameters; `None` if it is
/// of one body.
fn links_of(arguments: &Run, rig: &RigFile) -> Result<Option<(Model, Vec<Parameter>)>, Failure> {
    if rig.link.len() < 2 {
        return Ok(None);
    }
    refuse_for_trees(&[&arguments.forgetting, &arguments.adaptive])?;
    let model = from_tables(&rig.link, &arguments.rig.display().to_string()).map_err(Failure::input)?;
    let rate_hz = rig.recording.rate_hz.unwrap_or(1000.0);
    let timing = of_sensors(rate_hz);
    // Whether it fits at all, whatever the noise is.
    let settings = device_settings(rig, &timing, Some([1.0; 6]))?;
    let (_, parameters) = device_tree(&model).map_err(Failure::input)?;
    let offset = settings.load_cell.known_offset_n_nm.is_none();
    let parameters = device_parameters(&model, &parameters, offset);
    Ok(Some((model, parameters)))
}

/// # Errors
/// Bad input: no share of a speed.
fn check_slow(slow: Option<f64>) -> Result<(), Failure> {
    match slow.filter(|share| !(0.01..=1.0).contains(share)) {
        Some(share) => Err(Failure::input(format!(
            "--slow {share}: a share of the program's speed, from 0.01 to 1, as 0.1"
        ))),
        None => Ok(()),
    }
}

/// The request and the machine.
struct About<'a> {
    arguments: &'a Run,
    geometry: &'a Geometry,
    /// Whether the rig file says which machine it is.
    described: bool,
    fixed: Option<&'a MotionProgram>,
}

impl About<'_> {
    /// Checks everything that will be driven against all limits: the way to the start, the program, the way
    /// home.
    ///
    /// # Errors
    /// A limit that is violated. Nothing was moved.
    fn checked(
        &self,
        platform: &mut dyn Platform,
        rig: &RigFile,
        body: Option<&BodySet>,
        directing: Option<&Directing>,
    ) -> Result<Summary, Failure> {
        let load = body.map(|body| carried::load(rig, body)).transpose().map_err(Failure::input)?;
        platform.carries(load.clone());
        let mut summary = Summary::default();
        if let Some(program) = self.fixed.cloned().or_else(|| directing.map(Directing::everything)) {
            let way = platform.way(&program).map_err(unmoved)?;
            let home = platform.way_home(&program).map_err(unmoved)?;
            let [way_s, home_s] =
                [&way, &home].map(|way| way.as_ref().map_or(0.0, MotionProgram::duration_s));
            let driven = with_ways(way, program, home);
            summary = check::check(&driven, self.geometry, load.as_ref())
                .map_err(|error| beyond(error, self.arguments))?;
            (summary.way_s, summary.home_s) = (way_s, home_s);
        }
        if let Some(directing) = directing {
            summary.duration_s = directing.at_most_s() + summary.way_s;
        }
        (summary.from, summary.assumed) = (platform.expects(), !self.described);
        Ok(summary)
    }

    fn consent<'b>(
        &'b self,
        summary: &'b Summary,
        rig: &'b RigFile,
        found: Vec<String>,
        guards: Option<[bool; 2]>,
    ) -> Consent<'b> {
        let (address, slow) = (self.arguments.platform.as_str(), self.arguments.slow);
        Consent { summary, address, rig, slow, found, guards }
    }
}

/// Puts the way to its start before a program, and the way home behind it.
fn with_ways(
    way: Option<MotionProgram>,
    program: MotionProgram,
    home: Option<MotionProgram>,
) -> MotionProgram {
    let start = way.as_ref().filter(|way| !way.segments.is_empty()).map_or(program.start, |way| way.start);
    let parts = way.into_iter().chain([program]).chain(home);
    MotionProgram { start, segments: parts.flat_map(|part| part.segments).collect() }
}

/// Holds a program against the ranges of the sensors.
///
/// # Errors
/// Bad input: a range that is not enough. Nothing was moved.
fn within_ranges(
    program: &MotionProgram,
    rig: &RigFile,
    body: Option<&BodySet>,
) -> Result<RangePeaks, Failure> {
    let trajectory = program.trajectory().map_err(Failure::input)?;
    ranges::peaks(&trajectory, rig, body).map_err(|e| Failure::input(format!("{e}.\nNothing was moved.")))
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

/// A program that the machine cannot do; the built-in one can be replaced.
fn beyond(error: PlatformError, arguments: &Run) -> Failure {
    let built_in = arguments.programme.plan.is_none() && !arguments.adaptive.adaptive;
    let advice = if built_in {
        "\nIt is the built-in experiment: make one for this machine by `rigident plan motion --rig`, and give it by --plan."
    } else {
        ""
    };
    Failure::input(format!("{error}{advice}\nNothing was moved."))
}

/// A platform that was asked for nothing yet.
fn unmoved(error: PlatformError) -> Failure {
    let said = format!("{error}\nNothing was moved.");
    match error {
        PlatformError::Address { .. } | PlatformError::Motion(_) | PlatformError::TooLong { .. } => {
            Failure::input(said)
        }
        _ => Failure::link(said),
    }
}
