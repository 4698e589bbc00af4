//! `rigident run --platform none`: the device's own sensors, and a body that is moved by hand, by a robot, by
//! anything.

use std::process::ExitCode;
use std::time::Instant;

use hexapod::{Geometry, MotionProgram};

use crate::commands::run::arguments::Run;
use crate::commands::run::at_terminal::AtTerminal;
use crate::device::experiment::{Watcher, conclude};
use crate::device::link::{configured, of_sensors, open};
use crate::device::report::Outlet;
use crate::options::forgetting::RowsOf;
use crate::{Failure, Folder};
use rigident::answer::now;
use rigident::application::device::check_asked;
use rigident::application::driving::{warm_up, zero};
use rigident::application::report::provenance;
use rigident::application::{Experiment, Loaded, NextMove, calibrate};
use rigident::device::calibrated_board::another_board;
use rigident::device::platform::ByHand;
use rigident::device::session::{settings, sound};
use rigident::device::words::device_notes;
use rigident_io::rig::RigFile;

/// The address of no platform.
pub(crate) const NONE: &str = "none";

/// Runs `rigident run --platform none`.
pub(crate) fn run(arguments: &Run) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    let known = arguments.known.parse()?;
    let mut rig = RigFile::load(&arguments.rig).map_err(Failure::input)?;
    refuse_programmes(arguments, &rig)?;
    arguments.load.put_into(&mut rig)?;
    calibrate(&mut rig, arguments.calibration.calibration.as_deref())?;
    let rate_hz = rig.recording.rate_hz.unwrap_or(1000.0);
    let parameters =
        Loaded::of_readings("run", &rig, Vec::new(), Some(rate_hz), false).source().parameters().to_vec();
    check_asked(&parameters, &known, &arguments.output.estimate)?;
    arguments.adaptive.check()?;
    let timing = of_sensors(rate_hz);
    // Any noise does while nothing is absorbed.
    let mut standing = settings(&rig, &timing, Some([1.0; 6]), None).map_err(Failure::input)?;
    arguments.stop.put_into(&mut standing, &parameters)?;
    let span = arguments.forgetting.span(&RowsOf::moving(rate_hz))?;
    let (_, mut session) = open(arguments.device.port.as_deref(), &[])?;
    configured(&mut session, &standing)?;

    let mut warnings = Vec::from_iter(another_board(&rig, session.identity()));
    tell!("hold the body still");
    let terminal = AtTerminal { yes: arguments.yes, dry_run: arguments.dry_run };
    warm_up(&mut session, &rig, arguments.warm_up_s, &mut warnings, &terminal)?;
    let rest = zero(&mut session, &mut rig, &mut warnings, &terminal)?;
    let mut settings = rest.settings(&rig, &timing, span)?;
    arguments.stop.put_into(&mut settings, &parameters)?;
    configured(&mut session, &settings)?;

    let folder = Folder::new(arguments.output.out.as_deref(), "run")?;
    let mut comments = device_notes(session.identity());
    comments.extend(provenance(&rig));
    comments.push(("recorded".to_owned(), now()));
    comments.extend(rest.comments());
    let expected = arguments.adaptive.at_most_s.map_or(0, |s| (s * rate_hz) as usize);
    let mut watcher = Watcher::recording(folder.file("run.mcap"), &rig, &comments, expected)?;
    let mut completed = rig.clone();
    completed.load_cell.noise_n_nm.get_or_insert(rest.sigma);
    let asked = arguments.stop.asked(&arguments.output.estimate);
    watcher.next_move = Some(NextMove::new(&completed, rate_hz, &asked));
    tell!("move the body now: the next move is shown as the readings come; Ctrl-C ends and keeps everything");
    session.at_most_s = arguments.adaptive.at_most_s;
    let nothing = MotionProgram { start: Geometry::thesis().home(), segments: Vec::new() };
    let mut take =
        session.follow_unchecked(&mut ByHand::default(), &nothing, &mut watcher).map_err(Failure::link)?;
    watcher.next_move = None;
    watcher.end(&mut take);
    // Nobody but the user says when a motion by hand is over.
    (take.interrupted, take.cut_short) = (false, false);
    if let Some(broken) = &mut take.broken {
        *broken = broken.replace("\nThe platform is at rest.", "");
    }
    let mut read = sound::recording("run", &rig, rate_hz, &take.readings);
    warnings.extend(sound::judge(&mut read, &mut take));
    let readings = std::mem::take(&mut take.readings);
    let loaded = Loaded::of_readings("run", &rig, readings, Some(rate_hz), false);
    let experiment = Experiment {
        asked,
        until: settings.stop,
        span,
        warnings,
        ..Experiment::new(loaded, "port", session.identity(), &known)
    };
    conclude(experiment, take, Outlet { started, output: &arguments.output }, &folder)
}

/// Refuses what only a platform can do.
fn refuse_programmes(arguments: &Run, rig: &RigFile) -> Result<(), Failure> {
    let said = if arguments.programme.plan.is_some() {
        "--plan: nothing is here that could drive it; name the platform"
    } else if arguments.adaptive.adaptive {
        "--adaptive decides for a platform; without one the next move is shown to whoever moves the body"
    } else if rig.link.len() > 1 {
        "several [[link]] are run on a platform; by hand it is one body"
    } else {
        return Ok(());
    };
    Err(Failure::input(format!("--platform none and {said}")))
}
