use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use serde::Serialize;

use crate::commands::factor::absent;
use crate::commands::plan::arguments::PlanExcitation;
use crate::commands::plan::motion::ended;
use crate::kept::Stop;
use crate::options::trees::RowsWord;
use crate::screen::outcome::say;
use crate::{Failure, Progress};
use rigident::application::tree::{change, read};
use rigident::fit::figures::significant;
use rigident::plan::excitation::boxes::{BoxFile, Boxes, boxes};
use rigident::plan::excitation::collisions::Apart;
use rigident::plan::excitation::files::{FileJoint, csv, joint_trajectory, joints};
use rigident::plan::excitation::information::Measured;
use rigident::plan::excitation::limits::{GivenLimits, JointLimits, Shares, by_joint};
use rigident::plan::excitation::{Excitation, Stage, Task, clear_start, movable, plan};
use rigident::rows::tree::drive::{Drive, Friction};
use rigident_files::MOST_OF_TEXT;
use rigident_io::recording::new_file::write_new_text;
use rigident_model::Model;
use rigident_model::base::Rows;
use rigident_model::check::shapes;
use rigident_model::passive::Passive;

/// Share of the largest effort that the noise of one reading is taken for where nothing is said.
const NOISE: f64 = 0.01;
/// Points of a JointTrajectory in the shortest period.
const POINTS: f64 = 20.0;

/// The object of `--json`.
#[derive(Serialize)]
struct Object<'a> {
    model: &'a str,
    duration_s: f64,
    bandwidth_hz: f64,
    harmonics: usize,
    joints: Vec<JointObject<'a>>,
    held: Vec<HeldObject<'a>>,
    condition_number: f64,
    condition_number_before: f64,
    /// Geometric mean of the uncertainties over those of the random trajectory.
    #[serde(skip_serializing_if = "Option::is_none")]
    u95_over_before: Option<f64>,
    parameters: Vec<ParameterObject<'a>>,
    not_identified: Vec<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    nearest: Option<NearestObject<'a>>,
    clearance_m: f64,
    pairs_left_out: &'a [[String; 2]],
    boxes_about_joints: &'a [String],
}

#[derive(Serialize)]
struct JointObject<'a> {
    name: &'a str,
    start: f64,
    positions: [f64; 2],
    rate: f64,
    acceleration: f64,
    effort: f64,
    effort_noise: f64,
    range_share: f64,
    speed_share: f64,
    effort_share: f64,
}

#[derive(Serialize)]
struct HeldObject<'a> {
    name: &'a str,
    at: f64,
}

#[derive(Serialize)]
struct ParameterObject<'a> {
    name: &'a str,
    unit: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    u95: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    u95_before: Option<f64>,
}

#[derive(Serialize)]
struct NearestObject<'a> {
    between: &'a [String; 2],
    distance_m: f64,
    time_s: f64,
}

/// The input of the planning, and what files need beside it.
struct Prepared {
    task: Task,
    /// Every joint of one freedom, held ones too.
    file_joints: Vec<FileJoint>,
    /// Joints that are held, and where.
    held: Vec<(String, f64)>,
    boxes: Boxes,
}

/// Runs `rigident plan excitation`.
pub(crate) fn run(arguments: &PlanExcitation) -> Result<ExitCode, Failure> {
    for path in &arguments.out {
        absent(path)?;
        ending(path)?;
    }
    let points_hz = arguments.points_hz.unwrap_or(POINTS * arguments.bandwidth_hz);
    if !(points_hz > 0.0 && points_hz * arguments.duration_s <= 1e6) {
        return Err(Failure::input(format!(
            "--points-hz {points_hz}: more than 0, and a million points at most"
        )));
    }
    let prepared = prepare(arguments)?;
    let stop = Stop::of_this_command();
    let mut progress = Progress::new();
    let planned = plan(&prepared.task, &stop, |stage| progress.show(|| words(stage)));
    progress.finish();
    let planned = planned.map_err(Failure::input)?;
    for path in &arguments.out {
        let text = match ending(path)? {
            Ending::Csv => csv(&planned.series, &prepared.file_joints, arguments.rate_hz),
            Ending::Yaml => joint_trajectory(&planned.series, &prepared.file_joints, points_hz),
        };
        write_new_text(path, &text).map_err(Failure::input)?;
        tell!("{}", path.display());
    }
    if arguments.json {
        say(serde_json::to_string(&object(&prepared, &planned)).map_err(Failure::input)?);
    } else {
        say(text(&prepared, &planned));
    }
    Ok(ended(stop.load(Ordering::Relaxed), "trajectory"))
}

fn words(stage: Stage) -> String {
    match stage {
        Stage::Search(ended, of, best) if best.is_finite() => {
            format!("{ended} of {of} searches ended, best log det {best:.1}")
        }
        Stage::Search(ended, of, _) => format!("{ended} of {of} searches ended"),
        Stage::Limits => "limits on a finer grid".to_owned(),
        Stage::Prediction => "prediction".to_owned(),
    }
}

/// Kinds of files.
enum Ending {
    Csv,
    Yaml,
}

fn ending(path: &Path) -> Result<Ending, Failure> {
    match path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("csv") => Ok(Ending::Csv),
        Some("yaml" | "yml") => Ok(Ending::Yaml),
        _ => Err(Failure::input(format!(
            "-o {}: the ending says what is written, .csv or .yaml (trajectory_msgs/msg/JointTrajectory)",
            path.display()
        ))),
    }
}

fn prepare(arguments: &PlanExcitation) -> Result<Prepared, Failure> {
    let name = &arguments.model.model;
    let changes = arguments.model.changes.typed()?;
    let (whole, is_person) = read(name, &changes)?;
    if is_person {
        return Err(Failure::input(format!(
            "{name} is a person, whose joints no controller drives: give the model of a robot"
        )));
    }
    let mut robot = whole.clone();
    change(&mut robot, &changes)?;
    let shares = shares(arguments)?;
    let given = GivenLimits {
        range: arguments.range.clone(),
        speed: arguments.speed.clone(),
        effort: arguments.effort.clone(),
        acceleration: arguments.acceleration.clone(),
    };
    let mut held = locked(&whole, arguments)?;
    let others = hold(&mut robot, arguments, &mut held)?;
    let mut bodies = movable(&robot).map_err(Failure::input)?;
    give_passive(&mut bodies, arguments)?;
    let limits = given.of(&bodies, shares).map_err(Failure::input)?;
    let names: Vec<&str> = limits.iter().map(|limits| limits.name.as_str()).collect();
    let starts = by_joint("--start", &arguments.start, &whole, &names).map_err(Failure::input)?;
    let start =
        limits.iter().zip(&starts).map(|(limits, given)| given.unwrap_or_else(|| limits.start())).collect();
    let file = match &arguments.boxes {
        None => BoxFile::default(),
        Some(path) => {
            let text = rigident_files::read_text(path)
                .map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
            BoxFile::parse(&text, &path.display().to_string(), &robot).map_err(Failure::input)?
        }
    };
    let boxes = if arguments.no_collisions { Boxes::default() } else { round(&robot, arguments, &file)? };
    tell_findings(&robot, &boxes, others);
    let moving: Vec<String> = limits.iter().map(|limits| limits.name.clone()).collect();
    let mut task = Task {
        measured: measured(arguments, &bodies, &limits)?,
        limits,
        start,
        is_start_given: !arguments.start.is_empty(),
        duration_s: arguments.duration_s,
        bandwidth_hz: arguments.bandwidth_hz,
        boxes: boxes.all.clone(),
        skipped: file.skip_pairs,
        apart: Apart { clearance_m: arguments.clearance_m, floor_m: arguments.floor_m },
        seed: arguments.seed,
        restarts: arguments.restarts,
        model: bodies,
    };
    let start = clear_start(&task).map_err(Failure::input)?;
    if start != task.start {
        tell!(
            "rigident: the zero pose touches the floor: it starts in a pose nearby that does not (--start)"
        );
        task.start = start;
    }
    let commanded = commanded(arguments, &held)?;
    Ok(Prepared { file_joints: joints(&whole, &moving, &held, &commanded), task, held, boxes })
}

/// Gives the joints the rotors and the friction that options say, which their efforts need.
fn give_passive(bodies: &mut Model, arguments: &PlanExcitation) -> Result<(), Failure> {
    type Place = fn(&mut Passive) -> &mut f64;
    let options: [(&str, &[String], Place); 3] = [
        ("--rotor", &arguments.rotor, |own| &mut own.armature),
        ("--viscous", &arguments.viscous, |own| &mut own.damping),
        ("--coulomb", &arguments.coulomb, |own| &mut own.friction),
    ];
    for (option, words, place) in options {
        let names: Vec<&str> = bodies.links.iter().skip(1).map(|link| link.joint_name.as_str()).collect();
        let given = by_joint(option, words, bodies, &names).map_err(Failure::input)?;
        if let Some(value) = given.iter().flatten().find(|value| **value < 0.0) {
            return Err(Failure::input(format!("{option} {value}: zero or more")));
        }
        for (link, value) in bodies.links.iter_mut().skip(1).zip(given) {
            if let Some(value) = value {
                *place(&mut link.passive[0]) = value;
            }
        }
        let asked = option.trim_start_matches('-');
        let is_asked = arguments.friction.iter().any(|list| list.contains(asked));
        if is_asked && bodies.links.iter().all(|link| *place(&mut link.passive[0].clone()) == 0.0) {
            tell!(
                "rigident: efforts are those of a model without {asked}, and --friction asks for it: limits \
                 of effort may be passed; give {option} [JOINT=]VALUE"
            );
        }
    }
    Ok(())
}

/// Returns the joints that do not move and are in a message for the controller: all that --joints holds, and
/// those of --hold.
fn commanded(arguments: &PlanExcitation, held: &[(String, f64)]) -> Result<Vec<String>, Failure> {
    let name = |words: &str| words.split_once('=').map_or(words, |(name, _)| name).trim().to_owned();
    let locked: Vec<String> = arguments.model.changes.lock.iter().map(|words| name(words)).collect();
    if let Some(name) = arguments.hold.iter().find(|name| !locked.contains(name)) {
        return Err(Failure::input(format!("--hold {name}: it is not among the joints of --lock")));
    }
    let names = held.iter().map(|(name, _)| name);
    Ok(names.filter(|name| !locked.contains(name) || arguments.hold.contains(name)).cloned().collect())
}

/// Returns the joints that --lock names, and their positions.
fn locked(whole: &Model, arguments: &PlanExcitation) -> Result<Vec<(String, f64)>, Failure> {
    let own = arguments.model.changes.lock.iter().map(|words| whole.locked(words));
    let own = own.collect::<Result<Vec<_>, _>>().map_err(Failure::input)?;
    Ok(own.into_iter().map(|(name, at)| (name.to_owned(), at.unwrap_or(0.0))).collect())
}

/// Locks the joints that --joints does not name at their start, and adds them to those that are held; returns
/// how many.
fn hold(
    robot: &mut Model,
    arguments: &PlanExcitation,
    held: &mut Vec<(String, f64)>,
) -> Result<usize, Failure> {
    let wanted: Vec<&str> = arguments.joints.iter().map(|name| name.trim()).collect();
    if wanted.is_empty() {
        return Ok(0);
    }
    let movable: Vec<(String, [f64; 2])> = robot
        .welded()
        .links
        .iter()
        .skip(1)
        .map(|link| {
            (link.joint_name.clone(), link.limits.position.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]))
        })
        .collect();
    if let Some(name) = wanted.iter().find(|name| movable.iter().all(|(own, _)| own != *name)) {
        let names: Vec<&str> = movable.iter().map(|(own, _)| own.as_str()).collect();
        return Err(Failure::input(format!(
            "--joints {name}: there is no such joint that moves; there are {}",
            names.join(", ")
        )));
    }
    let others: Vec<&(String, [f64; 2])> =
        movable.iter().filter(|(own, _)| !wanted.contains(&own.as_str())).collect();
    let names: Vec<&str> = others.iter().map(|(own, _)| own.as_str()).collect();
    let starts = by_joint("--start", &arguments.start, robot, &names).map_err(Failure::input)?;
    let places: Vec<(String, f64)> = others
        .iter()
        .zip(starts)
        .map(|((name, [low, high]), given)| {
            (name.clone(), given.unwrap_or_else(|| 0.0_f64.clamp(*low, *high)))
        })
        .collect();
    let locks: Vec<String> = places.iter().map(|(name, at)| format!("{name}={at}")).collect();
    robot.lock(&locks).map_err(Failure::input)?;
    held.extend(places);
    Ok(others.len())
}

fn shares(arguments: &PlanExcitation) -> Result<Shares, Failure> {
    let share = |option: &str, value: f64| {
        if value > 0.0 && value <= 1.0 {
            Ok(value)
        } else {
            Err(Failure::input(format!("{option} {value}: more than 0, and 1 at most")))
        }
    };
    let lengths = [
        ("--clearance-m", Some(arguments.clearance_m), 0.0),
        ("--box-radius-m", arguments.box_radius_m, 0.0),
        ("--floor-m", arguments.floor_m, f64::NEG_INFINITY),
    ];
    for (option, value, least) in lengths {
        if let Some(value) = value.filter(|value| !value.is_finite() || *value < least) {
            return Err(Failure::input(format!("{option} {value}: a length in m")));
        }
    }
    Ok(Shares {
        range: share("--range-share", arguments.range_share)?,
        speed: share("--speed-share", arguments.speed_share)?,
        effort: share("--effort-share", arguments.effort_share)?,
    })
}

/// Returns the boxes round the links.
fn round(robot: &Model, arguments: &PlanExcitation, file: &BoxFile) -> Result<Boxes, Failure> {
    let path = Path::new(&arguments.model.model);
    let text = rigident_files::read(path, MOST_OF_TEXT)
        .map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
    let is_rig = path.extension().is_some_and(|ending| ending == "toml");
    let shapes = if is_rig { BTreeMap::new() } else { shapes::boxes(&String::from_utf8_lossy(&text), path) };
    Ok(boxes(robot, &shapes, file, arguments.box_radius_m))
}

fn tell_findings(robot: &Model, boxes: &Boxes, held: usize) {
    for finding in &robot.findings {
        tell!("rigident: {finding}");
    }
    if held > 0 {
        tell!("rigident: {held} joints are held still: `identify` wants them with --lock");
    }
    if !boxes.guessed.is_empty() {
        tell!(
            "rigident: the shapes of {} are not known: their boxes are made about joints, {} mm thick \
             (--boxes, --box-radius-m)",
            boxes.guessed.join(", "),
            significant(2e3 * boxes.radius_m, 3)
        );
    }
}

fn measured(arguments: &PlanExcitation, bodies: &Model, limits: &[JointLimits]) -> Result<Measured, Failure> {
    let names: Vec<&str> = limits.iter().map(|limits| limits.name.as_str()).collect();
    let noise =
        by_joint("--effort-noise", &arguments.effort_noise, bodies, &names).map_err(Failure::input)?;
    let effort_noise: Vec<f64> =
        noise.iter().zip(limits).map(|(given, limits)| given.unwrap_or(NOISE * limits.effort)).collect();
    let wrench: Vec<f64> =
        arguments.wrench_noise.split(',').filter_map(|word| word.trim().parse().ok()).collect();
    let &[force, moment] = wrench.as_slice() else {
        return Err(Failure::input(format!(
            "--wrench-noise {}: write it as N,NM, for example 1,0.1",
            arguments.wrench_noise
        )));
    };
    if let Some(sigma) =
        effort_noise.iter().chain(&wrench).find(|sigma| !(sigma.is_finite() && **sigma > 0.0))
    {
        return Err(Failure::input(format!(
            "--effort-noise or --wrench-noise {sigma}: a standard deviation is above zero"
        )));
    }
    let friction = Friction::parse(&arguments.friction).map_err(Failure::input)?;
    let names: Vec<String> = names.into_iter().map(str::to_owned).collect();
    friction.check(&Drive::of_joints(&names, &bodies.tree(), &friction)).map_err(Failure::input)?;
    let rows = match arguments.rows {
        None | Some(RowsWord::Joint) => Rows::Joint,
        Some(RowsWord::Base) => Rows::Base,
        Some(RowsWord::Both) => Rows::Both,
    };
    if rows == Rows::Base && !friction.is_empty() {
        return Err(Failure::input(
            "--rows base does not see friction in the joints: leave --friction out, or say --rows both",
        ));
    }
    let wrench_noise = [force, force, force, moment, moment, moment];
    Ok(Measured { rows, effort_noise, wrench_noise, rate_hz: arguments.rate_hz, friction })
}

fn object<'a>(prepared: &'a Prepared, planned: &'a Excitation) -> Object<'a> {
    let task = &prepared.task;
    let of_joints = task.limits.iter().zip(&planned.used.joints).enumerate();
    let parameters = planned.after.parameters.iter().zip(&planned.before.parameters);
    Object {
        model: &task.model.name,
        duration_s: task.duration_s,
        bandwidth_hz: task.bandwidth_hz,
        harmonics: planned.harmonics,
        joints: of_joints
            .map(|(j, (limits, used))| JointObject {
                name: &limits.name,
                start: task.start[j],
                positions: used.positions,
                rate: used.rate,
                acceleration: used.acceleration,
                effort: used.effort,
                effort_noise: task.measured.effort_noise[j],
                range_share: used.shares[0],
                speed_share: used.shares[1],
                effort_share: used.shares[2],
            })
            .collect(),
        held: prepared.held.iter().map(|(name, at)| HeldObject { name, at: *at }).collect(),
        condition_number: planned.after.condition_number,
        condition_number_before: planned.before.condition_number,
        u95_over_before: planned.after.over(&planned.before),
        parameters: parameters
            .map(|(after, before)| ParameterObject {
                name: &after.name,
                unit: &after.unit,
                u95: after.u95,
                u95_before: before.u95,
            })
            .collect(),
        not_identified: planned.after.open(),
        nearest: planned.used.nearest.as_ref().map(|(nearest, time_s)| NearestObject {
            between: &nearest.between,
            distance_m: nearest.distance_m,
            time_s: *time_s,
        }),
        clearance_m: task.apart.clearance_m,
        pairs_left_out: &planned.left_out,
        boxes_about_joints: &prepared.boxes.guessed,
    }
}

fn text(prepared: &Prepared, planned: &Excitation) -> String {
    let task = &prepared.task;
    let mut out = format!(
        "{}: {} joints, {} s, {} harmonics up to {} Hz, at rest at both ends.\n\n  share of the limit \
         used            range    rate  effort     starts at",
        task.model.name,
        task.limits.len(),
        task.duration_s,
        planned.harmonics,
        task.bandwidth_hz
    );
    for (j, (limits, used)) in task.limits.iter().zip(&planned.used.joints).enumerate() {
        let [range, rate, effort] = used.shares.map(|share| 100.0 * share);
        let unit = if limits.slides { "m" } else { "rad" };
        out += &format!(
            "\n  {:<32} {range:>5.1} % {rate:>5.1} % {effort:>5.1} %  {:>8.3} {unit}",
            limits.name, task.start[j]
        );
    }
    let allowed = task.limits.first().map_or_else(Shares::default, |limits| limits.shares);
    out += &format!(
        "\n  {:<32} {:>5.1} % {:>5.1} % {:>5.1} %\n\nRange and rate hold at every instant, efforts of the \
         nominal model and distances every {} ms.",
        "allowed",
        100.0 * allowed.range,
        100.0 * allowed.speed,
        100.0 * allowed.effort,
        significant(1e3 * planned.used.step_s, 2)
    );
    match &planned.used.nearest {
        Some((nearest, time_s)) => {
            let [a, b] = &nearest.between;
            out += &format!(
                "\nNearest to each other are {a} and {b} at t = {time_s:.2} s, {:.1} mm at least; {} pairs \
                 of boxes were looked at.",
                1e3 * nearest.distance_m,
                planned.pairs
            );
        }
        None => out += "\nCollisions were not looked at.",
    }
    if !planned.left_out.is_empty() {
        let pairs: Vec<String> = planned.left_out.iter().map(|[a, b]| format!("{a}–{b}")).collect();
        out += &format!(
            "\nNot looked at, as their boxes touch in the zero or start pose: {}. Watch them, or give \
             smaller boxes (--boxes).",
            pairs.join(", ")
        );
    }
    out + &predicted_text(task, planned)
}

/// Returns in words how well the trajectory will identify the parameters.
fn predicted_text(task: &Task, planned: &Excitation) -> String {
    let (before, after) = (&planned.before, &planned.after);
    let noise = &task.measured.effort_noise;
    let [least, most] = [
        noise.iter().fold(f64::INFINITY, |least, v| v.min(least)),
        noise.iter().fold(0.0_f64, |most, v| v.max(most)),
    ];
    let mut out = format!(
        "\n\nPredicted at {} readings/s, efforts with noise of {} to {} (1 σ), against one random trajectory \
         as large as limits allow (the best of many random ones is nearer):\n  condition number {:.1} \
         instead of {:.1}",
        task.measured.rate_hz,
        significant(least, 3),
        significant(most, 3),
        after.condition_number,
        before.condition_number
    );
    if let Some(ratio) = after.over(before) {
        out += &format!("; U95 {ratio:.2} times as large, in the geometric mean");
    }
    let cell = |u95: Option<f64>| u95.map_or_else(|| "not identified".to_owned(), |u95| significant(u95, 3));
    out += &format!("\n\n  {:<44} {:>14} {:>14}", "U95", "planned", "random");
    for (after, before) in after.parameters.iter().zip(&before.parameters) {
        out += &format!(
            "\n  {:<44} {:>14} {:>14} {}",
            after.name,
            cell(after.u95),
            cell(before.u95),
            after.unit
        );
    }
    let open = after.open();
    if !open.is_empty() {
        out +=
            &format!("\n\n{} of {} parameters are not identified by it.", open.len(), after.parameters.len());
    }
    out
}
