//! `rigident live`: sensors that people own feed the firmware, and the answer grows.

use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use rigident_shared::wire::{Source, StopRule};

use super::arguments::Live;
use super::experiment::{Watcher, device_notes};
use super::link::configured;
use super::links_on_device::check_asked;
use super::live_streams::{Asked, Came, Streams};
use super::next_move::NextMove;
use super::options::microcontroller::Image;
use super::options::stop_criterion::not_reached;
use super::run_report::{Outlet, finish};
use super::{Failure, Folder, Stages, replay};
use rigident::answer::now;
use rigident::application::loaded::PLOT_POINTS;
use rigident::application::recorded::STREAMS;
use rigident::application::report::provenance;
use rigident::application::{Loaded, Report, Tree, calibrate};
use rigident::device::link::Client;
use rigident::device::session::{DeviceTiming, INTERRUPTED, Session, settings, state_imu_noise};
use rigident::rows::body::imu_noise::white_imu_noise;
use rigident::rows::body::prepare::Prepared;
use rigident::rows::tree::ProblemOptions;
use rigident_io::recording::columns::Group;
use rigident_io::recording::new_file::write_new_text;
use rigident_io::rig::RigFile;
use rigident_io::sources::feed::Feeds;
use rigident_io::sources::url::{Scheme, SourceUrl};
use rigident_io::sources::{self, Role, SourceError};

/// The first check, by which rates, clocks and noise are known, s.
const LOOK_S: f64 = 3.0;
/// Readings are sent this often.
const EVERY: Duration = Duration::from_millis(50);

/// `rigident live`
pub(super) fn run(arguments: &Live) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    let known = arguments.known.parse()?;
    let rig = rig_of(arguments)?;
    let none_yet = Loaded::of_readings("live", &rig, Vec::new(), Some(1000.0), false);
    check_asked(none_yet.source().parameters(), &known, &arguments.output)?;
    arguments.stop.check(none_yet.source().parameters())?;
    let asked = asked(arguments)?;
    let mut opened = Vec::new();
    for one in &asked {
        opened.push(sources::open(&one.url, &one.roles, &rig).map_err(refused)?);
    }
    if !opened.iter().any(|source| source.groups().contains(&Group::Accel(0))) {
        return Err(Failure::input(
            "no accelerometer is among the sources: add --imu ADDRESS; of --pose the attitude takes the place of a gyro, and no \
             more\nNothing was recorded.",
        ));
    }
    apart(&asked, &opened)?;
    let mut streams = Streams::new(asked, Feeds::new(opened), &rig);
    let folder = Folder::new(arguments.output.out.as_deref(), "live")?;
    streams.record(&folder)?;
    tell!("recording into {}; Ctrl-C ends it and keeps everything", folder.path().display());
    let fed = look(&mut streams).and_then(|prepared| {
        // Who joined too late for a rate was informed by the check.
        let rate_hz = streams.growing().rate_hz().unwrap_or(1.0);
        feed(arguments, &rig, (&prepared, rate_hz), &mut streams, &folder)
    });
    let closed = streams.close().err();
    let listing = folder.file(STREAMS);
    write_new_text(&listing, &streams.listing(&rig).to_toml()).map_err(Failure::input)?;
    let place = folder.path().display();
    let mut fed = fed.map_err(|failure| failure.after(&format!("What was recorded is in {place}.")))?;
    if let Some(closed) = closed {
        fed.broken.get_or_insert(closed);
    }
    answer(arguments, started, fed, &streams, (&listing, &folder))
}

/// The result of the device's part.
struct Fed {
    /// Why it ended, if something broke.
    broken: Option<String>,
    until: Option<StopRule>,
    device: Vec<(String, String)>,
}

/// The answer of the recorded streams.
fn answer(
    arguments: &Live,
    started: Instant,
    fed: Fed,
    streams: &Streams,
    (listing, folder): (&Path, &Folder),
) -> Result<ExitCode, Failure> {
    let known = arguments.known.parse()?;
    let place = folder.path().display();
    let kept = |failure: Failure| match &fed.broken {
        Some(broken) => Failure::link(format!(
            "{broken}\nWhat was recorded is in {place}, and does not make an answer: {failure}"
        )),
        None => failure.after(&format!("What was recorded is in {place}.")),
    };
    let stages = Stages::new("estimate");
    let calibrated = arguments.calibration.calibration.as_deref();
    let options = ProblemOptions::default();
    let loaded = Loaded::read(listing, None, calibrated, &Tree::default(), &options, &stages.caller())
        .map_err(|e| kept(e.into()))?;
    let mut found = loaded.fit(None, PLOT_POINTS, &stages.caller()).map_err(|e| kept(e.into()))?;
    drop(stages);
    let factor = loaded.factor(&found);
    known.apply(&mut found).map_err(|e| kept(Failure::input(e)))?;
    let mut report = Report::of_recording(&loaded, "host");
    report.asked = arguments.stop.asked(&arguments.output.estimate);
    report.factor = Some(factor);
    report.provenance = fed.device.into_iter().chain(streams.provenance()).chain(report.provenance).collect();
    report.warnings.extend(streams.told());
    let wider = |stop: &StopRule| {
        (0..found.parameters.len())
            .any(|j| stop.u95(j).is_some_and(|u95| found.estimate.u95(j) > f64::from(u95)))
    };
    report.warnings.extend(fed.until.filter(wider).map(|stop| not_reached(&stop, &found)));
    report.notes.push(
        "the answer is of the recorded streams, with the uncertainty of their clocks; what the device estimated while it ran took the \
         clocks by the arrivals"
            .to_owned(),
    );
    report.error = fed.broken;
    let outlet = Outlet { started, output: &arguments.output };
    finish(report, found, outlet, || Ok(Some(folder.clone())))
}

/// Reads the rig file, if there is one; it must be of one body in motion.
fn rig_of(arguments: &Live) -> Result<RigFile, Failure> {
    let mut rig = match &arguments.rig {
        Some(path) => RigFile::load(path).map_err(Failure::input)?,
        None => RigFile::default(),
    };
    let what = if rig.link.len() > 1 {
        Some("several [[link]]: live takes one body; record the streams and identify them")
    } else if rig.suspension.is_some() {
        Some("[suspension]: record the decay, and identify it by `rigident vibration identify`")
    } else if rig.recording.is_static {
        Some("static = true: live takes a body that moves")
    } else if !rig.stream.is_empty() {
        Some("[[stream]]: the sources are given by --wrench, --imu and --pose")
    } else {
        None
    };
    if let (Some(what), Some(path)) = (what, &arguments.rig) {
        return Err(Failure::input(format!("{} has {what}", path.display())));
    }
    calibrate(&mut rig, arguments.calibration.calibration.as_deref())?;
    if let Some(seconds) = arguments.at_most_s.filter(|s| !(s.is_finite() && *s > 0.0)) {
        return Err(Failure::input(format!("--at-most-s {seconds}: a positive number of seconds")));
    }
    Ok(rig)
}

/// Returns the sources, one for each address.
fn asked(arguments: &Live) -> Result<Vec<Asked>, Failure> {
    let given = [
        (Role::Wrench, Some(&arguments.wrench)),
        (Role::Imu, arguments.imu.as_ref()),
        (Role::Pose, arguments.pose.as_ref()),
    ];
    let mut asked: Vec<Asked> = Vec::new();
    for (role, text) in given.into_iter().filter_map(|(role, text)| Some((role, text?))) {
        let url: SourceUrl =
            text.parse().map_err(|e: SourceError| Failure::input(format!("--{role} {e}")))?;
        // A bridge takes any number of clients, each with a topic.
        let shares = |other: &&mut Asked| other.url.same_place(&url) && url.scheme != Scheme::WebSocket;
        match asked.iter_mut().find(shares) {
            Some(other) if other.url == url => other.roles.push(role),
            Some(other) => {
                return Err(Failure::input(format!(
                    "{}{} and --{role} {url} are one line with two settings: give the same address for both",
                    other.roles.first().map_or_else(String::new, |role| format!("--{role} ")),
                    other.url
                )));
            }
            None => asked.push(Asked { url, roles: vec![role] }),
        }
    }
    Ok(asked)
}

/// Refuses two sources that bring the same.
fn apart(asked: &[Asked], opened: &[Box<dyn sources::Source>]) -> Result<(), Failure> {
    for (k, source) in opened.iter().enumerate() {
        for (other, before) in opened.iter().enumerate().take(k) {
            let Some(both) = source.groups().iter().find(|group| before.groups().contains(group)) else {
                continue;
            };
            let place = |k: usize| asked.get(k).map(|asked| asked.url.to_string()).unwrap_or_default();
            return Err(Failure::input(format!(
                "{} and {} both bring {}: give the columns that are not to be used other names, by ?columns=\nNothing was recorded.",
                place(other),
                place(k),
                both.names().join(", ")
            )));
        }
    }
    Ok(())
}

fn refused(error: SourceError) -> Failure {
    match error {
        SourceError::Url { .. } => Failure::input(error),
        _ => Failure::link(format!("{error}\nNothing was recorded.")),
    }
}

/// Takes in the first seconds, chooses the time base by them, and checks them as a recording is checked.
fn look(streams: &mut Streams) -> Result<Prepared, Failure> {
    let stages = Stages::new("first look at the sources");
    let begun = Instant::now();
    while begun.elapsed().as_secs_f64() < LOOK_S {
        stages.at("first look at the sources", begun.elapsed().as_secs_f64() / LOOK_S);
        let came = streams.take(EVERY).map_err(Failure::link)?;
        if INTERRUPTED.load(Ordering::Relaxed) {
            return Err(Failure::interrupted("stopped during the first look at the sources"));
        }
        if came == Came::End {
            break;
        }
    }
    streams.begin().map_err(Failure::input)?;
    streams.growing().begin().map_err(Failure::input)
}

/// Feeds the device until something ends it.
fn feed(
    arguments: &Live,
    rig: &RigFile,
    (prepared, rate_hz): (&Prepared, f64),
    streams: &mut Streams,
    folder: &Folder,
) -> Result<Fed, Failure> {
    let timing = DeviceTiming { rate_hz, is_static: false, source: Source::Injected, host_timeout_ms: 0 };
    let mut told = prepared.rig.clone();
    let readings = prepared.input.readings.clone();
    let first = Loaded::of_readings("live", &told, readings, Some(rate_hz), false);
    // Single precision bears no less.
    told.load_cell.noise_n_nm = Some(replay::device_sigma(&first, None, &mut Vec::new())?);
    let mut settings = settings(&told, &timing, None, None).map_err(Failure::input)?;
    arguments.stop.put_into(&mut settings, first.source().parameters())?;
    state_imu_noise(&mut settings, &white_imu_noise(prepared.rig.imu.first(), &prepared.input.readings));
    drop(first);
    let (_, transport) = replay::device(&arguments.mcu, Image::Standard)?;
    let mut session = Session::open(Client::new(transport)).map_err(Failure::link)?;
    configured(&mut session, &settings)?;
    let device = device_notes(session.identity());

    let mut comments = device.clone();
    comments.extend(provenance(rig));
    comments.extend(streams.provenance());
    comments.push(("recorded".to_owned(), now()));
    let recorded = RigFile { recording: prepared.rig.recording.clone(), ..rig.clone() };
    let expected = arguments.at_most_s.map_or(0, |s| ((LOOK_S + s) * rate_hz) as usize);
    let mut watcher = Watcher::recording(folder.file("live.mcap"), &recorded, &comments, expected)?;
    let asked = arguments.stop.asked(&arguments.output.estimate);
    watcher.next_move = Some(NextMove::new(&told, rate_hz, &asked));
    let mut feeding = session.begin_feeding().map_err(Failure::link)?;
    let begun = Instant::now();
    let broken = loop {
        let came = streams.take(EVERY);
        let readings = match streams.growing().readings() {
            Ok(readings) => readings,
            Err(why) => break Some(why.to_string()),
        };
        if !session.feed(&mut feeding, &readings, &mut watcher) {
            break None;
        }
        match came {
            Ok(Came::Samples) => {}
            Ok(Came::End) => break None,
            Err(why) => break Some(why),
        }
        let over = arguments.at_most_s.is_some_and(|most_s| begun.elapsed().as_secs_f64() >= most_s);
        if over || INTERRUPTED.load(Ordering::Relaxed) {
            break None;
        }
    };
    watcher.next_move = None;
    let mut take = session.end_feeding(feeding, &mut watcher);
    watcher.end(&mut take);
    Ok(Fed { broken: broken.or(take.broken), until: settings.stop, device })
}
