//! `rigident watch`: a recording to the firmware over its link; it tells what changes of one link.

use std::process::ExitCode;

use rigident_shared::wire::{ChangeReport, ErrorCode, SettingName};
use serde_json::{Value, json};

use super::options::microcontroller::Image;
use super::outcome::say;
use super::watch_arguments::Watch;
use super::{ExitStatus, Failure, Stages, recorded, simulated};
use rigident::application::tree::{change_as_recorded, tree_of};
use rigident::device::link::{BAUD, Client, LinkError, SerialTransport, Transport};
use rigident::device::session::streamed::{Pace, Watched, line_need};
use rigident::device::session::tree::complaints;
use rigident::device::session::watched::{WatchOptions, WatchedRobot};
use rigident::device::session::{Session, SessionError};
use rigident::rows::tree::Input;
use rigident::rows::tree::ProblemOptions;
use rigident::rows::tree::prepare::prepare;
use rigident_io::recording::Recording;

/// Names and units of a link's parameters.
const PARAMETERS: [(&str, &str); 10] = [
    ("mass", "kg"),
    ("mcx", "kg m"),
    ("mcy", "kg m"),
    ("mcz", "kg m"),
    ("Ixx", "kg m²"),
    ("Iyy", "kg m²"),
    ("Izz", "kg m²"),
    ("Iyz", "kg m²"),
    ("Ixz", "kg m²"),
    ("Ixy", "kg m²"),
];
/// The advice about an image without the feature.
const WITHOUT_WATCH: &str = "this device runs an image without the feature `watch`, as the standard one is: `cargo xtask flash --features watch` puts the \
                             other onto a board, and `cargo xtask firmware` builds that of the emulated board beside the standard one";
/// Beyond this multiple of the limit of noise a change must be three times as large, which is reported.
const BLIND: u32 = 10;
/// Of the line's rate frames may take this much.
const LINE_SHARE: f64 = 0.95;
/// Coverage factor of a 95 % uncertainty.
const COVERAGE: f64 = 1.96;

/// `rigident watch`
pub(super) fn run(arguments: &Watch) -> Result<ExitCode, Failure> {
    let (path, rig) = (&arguments.recording, arguments.rig.as_deref());
    let rate = arguments.false_alarms_per_hour;
    if !rate.is_finite() || rate <= 0.0 || rate > 60.0 {
        return Err(Failure::input(format!(
            "--false-alarms-per-hour {rate}: give a number above 0, at most 60"
        )));
    }
    if !(1.0..=3600.0).contains(&arguments.settle_s) {
        return Err(Failure::input(format!("--settle-s {}: give 1 to 3600 s", arguments.settle_s)));
    }
    recorded::refuse_streams(path, rig, "watch")?;
    let tree = arguments.tree.typed()?;
    let stages = Stages::new(&format!("reading {}", path.display()));
    let Some((mut model, _)) = tree_of(path, rig, &tree)? else {
        return Err(Failure::input(
            "the firmware watches a robot whose description it is given: --model FILE",
        ));
    };
    let mut recording = Recording::load(path, rig).map_err(Failure::input)?;
    recording.leave_out_spikes();
    let notes = change_as_recorded(&mut model, &tree.changes, &recording, &stages.caller())?;
    let prepared = prepare(&recording, &model, &ProblemOptions::default()).map_err(Failure::input)?;
    let options =
        WatchOptions { false_alarms_per_hour: arguments.false_alarms_per_hour, settle_s: arguments.settle_s };
    let robot = WatchedRobot::new(&prepared.input, &arguments.link, &options).map_err(Failure::input)?;
    for note in notes.iter().chain(&prepared.notes).chain(&prepared.warnings) {
        tell!("rigident: {note}");
    }
    stages.at("frames to the firmware", 0.0);
    let (rate_hz, start_s) = (prepared.input.rate_hz, start_s(&prepared.input));
    let (transport, pace) = device(arguments, &robot, rate_hz)?;
    let mut session = Session::open(Client::new(transport)).map_err(Failure::link)?;
    let mut told = |change: &ChangeReport| {
        if !arguments.json {
            say(text(change, start_s, rate_hz));
        }
    };
    let watched = session.watch_robot(&robot, pace, &mut told).map_err(refused)?;
    drop(stages);
    concluded(arguments, &watched, &robot, &prepared.input)
}

/// Says what is to be said at the end of a watch.
fn concluded(
    arguments: &Watch,
    watched: &Watched,
    robot: &WatchedRobot,
    input: &Input,
) -> Result<ExitCode, Failure> {
    let names: Vec<String> = input.model.links.iter().map(|link| link.name.clone()).collect();
    // What was lost on the way is missing in the series, too.
    let mut frames = watched.counters.frames;
    frames.missing = frames.missing.saturating_sub(watched.counters.watch.stream.lost);
    let mut complaints = complaints(&frames, &names);
    complaints.extend(of_the_link(watched));
    let blind = blind(watched);
    let fine = watched.counters.watch.settled && !watched.interrupted && blind.is_none();
    complaints.extend(blind);
    for complaint in &complaints {
        tell!("rigident: {complaint}");
    }
    if arguments.json {
        say(object(watched, &arguments.link, &complaints, start_s(input), input.rate_hz));
    } else if watched.broken.is_none() {
        say(summary(watched, &arguments.link, input.rate_hz));
    }
    match &watched.broken {
        Some(broken) => Err(ended(watched, broken, robot.frames.len())),
        None => Ok(ExitStatus::of(fine).into()),
    }
}

/// Time of the first frame, s.
fn start_s(input: &Input) -> f64 {
    input.frames.first().map_or(0.0, |frame| frame.time_ns as f64 * 1e-9)
}

/// Opens the firmware that watches: a simulated one takes frames as fast as it can, one on a port when they are due.
///
/// # Errors
/// No such device, or a line that is too slow for the robot's frames.
fn device(
    arguments: &Watch,
    robot: &WatchedRobot,
    rate_hz: f64,
) -> Result<(Box<dyn Transport>, Pace), Failure> {
    let (mcu, asked) = (&arguments.mcu, arguments.baud);
    if let Some((_, transport)) = simulated::named(mcu, Image::Watch)? {
        if let Some(baud) = asked {
            return Err(Failure::input(format!(
                "--baud {baud}: {mcu} has no line with a rate; leave it out"
            )));
        }
        return Ok((transport, Pace::AsTaken));
    }
    let port = SerialTransport::open(mcu).map_err(Failure::link)?;
    let need = line_need(&robot.frames, rate_hz);
    let baud = asked.unwrap_or(BAUD);
    if port.has_rate() && need > LINE_SHARE * f64::from(baud) {
        return Err(Failure::input(format!(
            "{mcu}: {rate_hz:.0} frames a second of {} links and {} sensors of forces are {need:.0} baud, and the line carries {baud}, of which a twentieth is for \
             the rest: give it a higher rate (--baud, up to 3000000), record fewer frames a second (60 at least), or weld links that do not move",
            robot.links.len(),
            robot.feet(),
        )));
    }
    Ok((Box::new(port), Pace::RealTime { rate_hz, baud: asked }))
}

/// Returns what became of frames on the way.
fn of_the_link(watched: &Watched) -> Vec<String> {
    let (stream, counters) = (&watched.counters.watch.stream, &watched.counters);
    let lost = watched.lost();
    let told = [
        (
            lost,
            "were lost on the way to the device: check the cable, and that nothing else keeps this computer busy",
        ),
        (stream.repeated, "came twice, and were taken once"),
        (stream.late, "came after a later one, and were left out"),
        (stream.unasked, "came while the device did not watch"),
    ];
    let mut said: Vec<String> =
        told.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} frames {what}")).collect();
    if counters.overruns > 0 {
        said.push(format!("{} times the device had no room for what came over its line", counters.overruns));
    }
    said
}

/// Says that a watch ended early, and what is left of it.
fn ended(watched: &Watched, broken: &SessionError, frames: usize) -> Failure {
    let found = watched.changes.iter().filter(|change| change.size.is_none()).count();
    Failure::link(format!(
        "the watch ended after {} of {frames} frames: {broken}\n{found} {} found until then, as told above; nothing is known of what came after",
        watched.sent,
        if found == 1 { "change was" } else { "changes were" },
    ))
}

/// Returns what to say of a limit that few changes exceed.
fn blind(watched: &Watched) -> Option<String> {
    let times = watched.counters.watch.excess_percent / 100;
    (times > BLIND).then(|| {
        format!(
            "the limit is {times} times that of noise, so only a change that is larger by the root of it is found: the model does not fit the recording, or the link \
             changed while the watch settled; identify the model anew, or begin where nothing changes"
        )
    })
}

fn refused(error: SessionError) -> Failure {
    match error {
        SessionError::Link(LinkError::Refused { code: ErrorCode::NotBuiltIn, .. }) => {
            Failure::link(WITHOUT_WATCH)
        }
        SessionError::Link(LinkError::Refused { code: ErrorCode::BadSetting(name), .. }) => {
            Failure::input(match name {
                SettingName::LineRate => {
                    "--baud: the device's line does not go up to that rate; take a lower one".to_owned()
                }
                SettingName::Link(link) => {
                    format!("the firmware does not take link {link} of the model: a number is none")
                }
                other => format!("the firmware does not take what was told of {other:?}"),
            })
        }
        other => Failure::link(other),
    }
}

/// Of a change that was not measured to the end there is no size.
fn text(change: &ChangeReport, start_s: f64, rate_hz: f64) -> String {
    let at = |number: u32| start_s + f64::from(number) / rate_hz;
    let Some(size) = &change.size else {
        return format!(
            "change {}: found at {:.3} s, {:.1} times the limit",
            change.change,
            at(change.found),
            change.ratio
        );
    };
    let [from, to] = change.between.map(at);
    let mut said =
        format!("change {}: at {:.3} s, between {from:.3} and {to:.3} s", change.change, at(change.at));
    for ((name, unit), (value, sd)) in PARAMETERS.iter().zip(size.change.iter().zip(&size.standard_deviation))
    {
        let (value, u95) = (f64::from(*value), COVERAGE * f64::from(*sd));
        if !u95.is_finite() {
            said += &format!("\n  {name:5} not told by the motion");
            continue;
        }
        said += &format!("\n  {name:5} {value:+.4} ± {u95:.4} {unit}");
    }
    said
}

fn summary(watched: &Watched, link: &str, rate_hz: f64) -> String {
    let frames = watched.counters.frames;
    let report = watched.counters.watch;
    let settled = if report.settled {
        format!(
            "errors of the model make the limit {:.1} times as large",
            f64::from(report.excess_percent) / 100.0
        )
    } else {
        "the recording ended before the watch had settled: nothing could be told (--settle-s)".to_owned()
    };
    format!(
        "{link}: {} {} in {:.1} s of {} frames; {settled}",
        report.changes,
        if report.changes == 1 { "change" } else { "changes" },
        f64::from(frames.absorbed) / rate_hz,
        frames.frames
    )
}

fn object(watched: &Watched, link: &str, complaints: &[String], start_s: f64, rate_hz: f64) -> Value {
    let at = |number: u32| start_s + f64::from(number) / rate_hz;
    let report = watched.counters.watch;
    let frames = watched.counters.frames;
    let one = |change: &ChangeReport| {
        let last = watched.changes.iter().rfind(|other| other.change == change.change).unwrap_or(change);
        let size = last.size.map(|size| {
            let all = PARAMETERS.iter().zip(size.change.iter().zip(&size.standard_deviation));
            let told = all.filter(|(_, (_, sd))| sd.is_finite());
            let entry = |((name, unit), (value, sd)): (&(&str, &str), (&f32, &f32))| {
                json!({ "name": name, "unit": unit, "change": value, "u95": COVERAGE * f64::from(*sd) })
            };
            told.map(entry).collect::<Vec<_>>()
        });
        json!({
            "change": change.change,
            "found_s": at(change.found),
            "at_s": at(last.at),
            "between_s": last.between.map(at),
            "times_the_limit": change.ratio,
            "size": size,
        })
    };
    let found = watched.changes.iter().filter(|change| change.size.is_none());
    json!({
        "status": match &watched.broken {
            Some(_) => "broken",
            None if report.settled => "watched",
            None => "not settled",
        },
        "link": link,
        "changes": found.map(one).collect::<Vec<_>>(),
        "excess": f64::from(report.excess_percent) / 100.0,
        "frames": {
            "sent": watched.sent,
            "given": frames.frames,
            "taken": frames.absorbed,
            "missing": frames.missing,
            "lost": watched.lost(),
            "repeated": report.stream.repeated,
            "late": report.stream.late,
            "unasked": report.stream.unasked,
            "overruns": watched.counters.overruns,
        },
        "warnings": complaints,
    })
}
