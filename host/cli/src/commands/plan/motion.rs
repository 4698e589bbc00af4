use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use hexapod::BodyParameters;
use hexapod::Mounting;
use hexapod::{Limit, Part, Peak};
use rigident_shared::inertia::PARAMETER_NAMES;
use serde::Serialize;

use crate::commands::factor::absent;
use crate::commands::plan::arguments::{MotionObjective, PlanCompare, PlanMotion};
use crate::commands::run::programme::tell_collisions;
use crate::kept::Stop;
use crate::options::test_body::DemoBody;
use crate::screen::outcome::say;
use crate::{ExitStatus, Failure, Progress};
use rigident::plan::carried::LoadBound;
use rigident::plan::equipment::Equipment;
use rigident::plan::machine;
use rigident::plan::motion::{self, MotionPlan, Objective, Task, compare, coverage};
use rigident::plan::plan_file::PlanFile;
use rigident::present::directions::{self, Directions};
use rigident_io::recording::new_file::write_new_text;
use rigident_io::rig::RigFile;

/// The object of `--json`.
#[derive(Serialize)]
struct Object<'a> {
    objective: &'a str,
    /// The body that the forces and the uncertainties are of.
    body: &'a str,
    duration_s: f64,
    motion_s: [f64; 2],
    condition_number: f64,
    /// With the offsets eliminated.
    condition_number_eliminated: f64,
    /// Of the information on the body, offsets eliminated, SI.
    log_determinant: f64,
    /// Of the body's parameters about S's origin.
    predicted_u95: BTreeMap<&'a str, f64>,
    predicted_com_u95_m: [f64; 3],
    predicted_inertia_com_u95_kgm2: [f64; 6],
    /// Guaranteed margins, as shares of what is allowed.
    limits: BTreeMap<&'a str, f64>,
    peaks: BTreeMap<&'a str, PeakObject>,
    /// Directions of angular velocity and acceleration visited by the motion, of 96.
    coverage: [f64; 2],
}

#[derive(Serialize)]
struct PeakObject {
    seen: f64,
    bound: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    allowed: Option<f64>,
}

/// Runs `rigident plan motion`.
pub(crate) fn run(arguments: &PlanMotion) -> Result<ExitCode, Failure> {
    // Said now rather than after the work.
    for path in [&arguments.out, &arguments.plot].into_iter().flatten() {
        absent(path)?;
    }
    let (task, body) = task(arguments)?;
    let (name, words) = match arguments.objective {
        MotionObjective::DOptimal => ("d-optimal", "D-optimal motion"),
        MotionObjective::Spheres => ("spheres", "spheres about the centre of mass"),
        MotionObjective::Rpy => ("rpy", "roll, pitch and yaw"),
        MotionObjective::Multisine => ("multisine", "the default multisine"),
    };
    let stop = Stop::of_this_command();
    let mut progress = Progress::new();
    let plan = motion::plan(&task, &stop, |text| progress.show(|| text)).map_err(Failure::input)?;
    progress.finish();
    let stopped = stop.load(Ordering::Relaxed);
    if let Some(path) = &arguments.out {
        let title = format!("{words}, {:.0} s", plan.program.duration_s());
        let file = PlanFile::new(title, &task.equipment.geometry, plan.program.clone());
        // A bound is no body.
        let file =
            if task.equipment.bodies.is_some() { file } else { file.carrying(task.equipment.carried()) };
        file.write(path).map_err(Failure::input)?;
        tell!("{}", path.display());
    }
    let trajectory = plan.program.trajectory().map_err(Failure::input)?;
    let [from, to] = plan.motion_s;
    let covered = coverage::of_motion(&trajectory, from, to);
    if let Some(path) = &arguments.plot {
        let kinds = ["angular rate", "angular acceleration"].into_iter().zip(covered);
        let spheres: Vec<Directions> = kinds
            .zip(coverage::vectors(&trajectory, from, to))
            .map(|((kind, share), vectors)| Directions {
                title: format!("{kind}, axes of the plate: {:.0} % of all directions", 100.0 * share),
                vectors: vectors.into_iter().map(Into::into).collect(),
            })
            .collect();
        write_new_text(path, &directions::svg(words, &spheres)).map_err(Failure::input)?;
        tell!("{}", path.display());
    }
    if arguments.json {
        say(serde_json::to_string(&object(&plan, name, &body, covered)).map_err(Failure::input)?);
    } else {
        say(text(&plan, words, covered, &task, &body));
    }
    Ok(ended(stopped, "motion"))
}

/// Returns the exit status of a search; one that Ctrl-C has ended is partly done.
pub(crate) fn ended(stopped: bool, what: &str) -> ExitCode {
    if stopped {
        tell!("rigident: stopped by Ctrl-C: the best {what} found by then, there may be better ones");
        return ExitStatus::NotIdentified.into();
    }
    ExitCode::SUCCESS
}

/// One motion of `rigident plan compare --json`.
#[derive(Serialize)]
struct Compared<'a> {
    worst_inertia_u95_share: f64,
    condition_number_alone: f64,
    condition_number_alone_eliminated: f64,
    #[serde(flatten)]
    motion: Object<'a>,
}

/// Runs `rigident plan compare`.
pub(crate) fn compare(arguments: &PlanCompare) -> Result<ExitCode, Failure> {
    let (equipment, rate_hz, _) = rig(arguments.rig.as_deref(), arguments.stroke_m)?;
    let task = Task { duration_s: arguments.duration_s, rate_hz, ..Task::new(equipment) };
    let stop = Stop::of_this_command();
    let mut progress = Progress::new();
    let rows = compare::compare(&task, &stop, |text| progress.show(|| text)).map_err(Failure::input)?;
    progress.finish();
    if arguments.json {
        let all: Vec<_> = rows
            .iter()
            .map(|row| Compared {
                worst_inertia_u95_share: row.worst(),
                condition_number_alone: row.condition_alone,
                condition_number_alone_eliminated: row.condition_alone_eliminated,
                motion: object(&row.plan, row.objective, row.body, row.coverage),
            })
            .collect();
        say(serde_json::to_string(&serde_json::json!({ "motions": all })).map_err(Failure::input)?);
    } else {
        say(format!(
            "Predicted U95, experiments of {:.0} s at {rate_hz:.0} readings/s, offsets unknown.\n\n{}",
            arguments.duration_s,
            compare::table(&rows).trim_end()
        ));
    }
    Ok(ended(stop.load(Ordering::Relaxed), "motions"))
}

/// Equipment, the rate of its readings, 1/s, and how heavy and large a body may be.
type Planned = (Equipment, f64, Option<LoadBound>);

/// Returns what of a rig a motion depends on.
fn rig(path: Option<&Path>, stroke_m: Option<f64>) -> Result<Planned, Failure> {
    let mut equipment = Equipment::thesis_horizontal();
    let mut rate_hz = 1000.0;
    let mut bound = None;
    if let Some(path) = path {
        let file = RigFile::load(path).map_err(Failure::input)?;
        let named = |e: machine::MachineError| Failure::input(format!("{}: {e}", path.display()));
        equipment.geometry = machine::geometry(&file).map_err(named)?;
        tell_collisions(&equipment.geometry);
        machine::load_cell(&file).map_err(named)?;
        let payload = &mut equipment.payload;
        if let Some(place) = file.platform.as_ref().and_then(|p| p.load_cell.as_ref()) {
            payload.load_cell = Mounting { position_m: place.position_m, rotation_wxyz: place.rotation_wxyz };
        }
        payload.gravity_mps2 = file.recording.gravity_mps2;
        if let Some(imu) = file.imu.first() {
            payload.imu = Mounting { position_m: imu.position_m, rotation_wxyz: imu.rotation_wxyz };
            equipment.gyro_range_radps = imu.range_radps.unwrap_or(equipment.gyro_range_radps);
            equipment.accel_range_mps2 = imu.range_mps2.unwrap_or(equipment.accel_range_mps2);
        }
        equipment.noise_n_nm = file.load_cell.noise_n_nm.unwrap_or(equipment.noise_n_nm);
        equipment.wrench_range_n_nm = file.load_cell.range_n_nm.unwrap_or(equipment.wrench_range_n_nm);
        rate_hz = file.recording.rate_hz.unwrap_or(rate_hz);
        bound = LoadBound::of(&file);
    }
    if let Some(stroke_m) = stroke_m {
        if !equipment.geometry.has_joints() {
            return Err(Failure::input(
                "--stroke-m is the stroke of legs, of which the rig file says nothing",
            ));
        }
        equipment.geometry = equipment.geometry.with_stroke(stroke_m).map_err(Failure::input)?;
    }
    Ok((equipment, rate_hz, bound))
}

/// Returns the task, and in words the body that it is for.
fn task(arguments: &PlanMotion) -> Result<(Task, String), Failure> {
    let (mut equipment, rate_hz, bound) = rig(arguments.rig.as_deref(), arguments.stroke_m)?;
    if !(0.0..1.0).contains(&arguments.reserve) {
        return Err(Failure::input(format!(
            "--reserve {}: a share of the stroke from 0 to less than 1, as 0.05",
            arguments.reserve
        )));
    }
    if arguments.stroke_m.is_none() {
        equipment.geometry = equipment.geometry.with_reserve(arguments.reserve);
    }
    let (body, words) = match (arguments.body, bound) {
        (None, Some(bound)) => {
            equipment.bodies = Some(bound.set());
            (bound.ball(), "any of load_max_kg within load_within_m; predicted is a ball of that size")
        }
        (Some(DemoBody::Vertical), _) => {
            (BodyParameters::thesis_vertical(), "the thesis' test body with plates, vertical")
        }
        (Some(DemoBody::Horizontal) | None, _) => {
            (BodyParameters::thesis_horizontal(), "the thesis' test body with plates, horizontal")
        }
    };
    let objective = match arguments.objective {
        MotionObjective::DOptimal => Objective::DOptimal,
        MotionObjective::Spheres => Objective::Spheres,
        MotionObjective::Rpy => Objective::RollPitchYaw,
        MotionObjective::Multisine => Objective::Multisine,
    };
    if arguments.highest_hz.is_some() && objective != Objective::DOptimal {
        return Err(Failure::input(
            "--highest-hz goes with --objective d-optimal: the other motions have frequencies of their own",
        ));
    }
    let task = Task {
        objective,
        duration_s: arguments.duration_s,
        poses: !arguments.no_poses,
        highest_hz: arguments.highest_hz.unwrap_or(motion::plan::HIGHEST_HZ),
        rate_hz,
        ..Task::new(equipment.with_body(body))
    };
    Ok((task, words.to_owned()))
}

fn key(peak: &Peak) -> &'static str {
    match peak.limit {
        Some(Limit::LegLength) => "leg_length",
        Some(Limit::LegRate) => "leg_rate",
        Some(Limit::LegAcceleration) => "leg_acceleration",
        Some(Limit::LegJerk) => "leg_jerk",
        Some(Limit::LegForce) => "leg_force",
        Some(Limit::LegPush) => "leg_push",
        Some(Limit::LegPull) => "leg_pull",
        Some(Limit::LegBuckling) => "leg_buckling",
        Some(Limit::BaseJointAngle) => "base_joint_angle",
        Some(Limit::PlateJointAngle) => "plate_joint_angle",
        Some(Limit::Conditioning) => "conditioning",
        Some(Limit::Clearance) => "clearance",
        Some(Limit::Travel) => "travel",
        Some(Limit::PlateSpeed) => "plate_speed",
        Some(Limit::PlateRate) => "plate_rate",
        Some(Limit::ArmReach) => "arm_reach",
        Some(Limit::ArmPosition) => "arm_position",
        Some(Limit::ArmRate) => "arm_rate",
        Some(Limit::ArmAcceleration) => "arm_acceleration",
        Some(Limit::ArmPayload) => "arm_payload",
        None => "angular_rate",
    }
}

fn object<'a>(plan: &MotionPlan, objective: &'a str, body: &'a str, coverage: [f64; 2]) -> Object<'a> {
    let peaks = &plan.guarantee.peaks;
    let finite = |v: f64| v.is_finite().then_some(v);
    Object {
        objective,
        body,
        duration_s: plan.program.duration_s(),
        motion_s: plan.motion_s,
        condition_number: plan.prediction.condition_number,
        condition_number_eliminated: plan.prediction.condition_eliminated,
        log_determinant: plan.prediction.log_determinant,
        predicted_u95: PARAMETER_NAMES.iter().copied().zip(plan.prediction.parameters).collect(),
        predicted_com_u95_m: plan.prediction.com_m,
        predicted_inertia_com_u95_kgm2: plan.prediction.inertia_com_kgm2,
        limits: peaks.iter().map(|p| (key(p), p.margin())).collect(),
        peaks: peaks
            .iter()
            .map(|p| (key(p), PeakObject { seen: p.seen, bound: p.bound, allowed: finite(p.allowed) }))
            .collect(),
        coverage,
    }
}

fn text(plan: &MotionPlan, words: &str, [rate, acceleration]: [f64; 2], task: &Task, body: &str) -> String {
    let [from, to] = plan.motion_s;
    let mut text = format!(
        "{words}: {:.1} s, the motion from {from:.1} s to {to:.1} s; it turns into {:.0} % of all \
         directions, its angular acceleration points into {:.0} %.\n\n  guaranteed at every instant        \
         seen       below     allowed   margin",
        plan.program.duration_s(),
        100.0 * rate,
        100.0 * acceleration
    );
    for peak in &plan.guarantee.peaks {
        let name = match key(peak) {
            "leg_length" => "leg length from the middle, m",
            "leg_rate" => "leg speed, m/s",
            "leg_acceleration" => "leg acceleration, m/s²",
            "leg_jerk" => "leg jerk, m/s³",
            "leg_force" => "leg force, N",
            "leg_push" => "leg force that pushes, N",
            "leg_pull" => "leg force that pulls, N",
            "leg_buckling" => "push times length squared, N m²",
            "base_joint_angle" => "base joint, rad",
            "plate_joint_angle" => "plate joint, rad",
            "conditioning" => "cond(H)",
            "travel" => "share of the travel",
            "plate_speed" => "speed of the plate, m/s",
            "plate_rate" => "turning of the plate, rad/s",
            "arm_reach" => "reach of the arm",
            "arm_position" => "joint from its middle, rad",
            "arm_rate" => "joint rate, rad/s",
            "arm_acceleration" => "joint acceleration, rad/s²",
            "arm_payload" => "mass at the flange, kg",
            "clearance" => "clearance short of ⌀ leg, m",
            _ => "angular rate, rad/s",
        };
        let allowed = if peak.allowed.is_finite() {
            format!("{:>11.4} {:>6.1} %", peak.allowed, 100.0 * peak.margin())
        } else {
            format!("{:>11} {:>8}", "–", "–")
        };
        text += &format!("\n  {name:<30} {:>10.4}  {:>10.4} {allowed}", peak.seen, peak.bound);
    }
    if let Some(bulk) = &task.equipment.geometry.limits.bulk
        && let Some((peak, between)) = plan.guarantee.peaks.iter().find_map(|p| Some((p, p.between?)))
    {
        let distance_mm = 1e3 * (bulk.clearance_m + bulk.range_m() - peak.seen);
        let between = Part::both(between);
        text += &format!(
            "\n\nNearest to each other are {between} at t = {:.2} s, {distance_mm:.1} mm.",
            peak.time_s
        );
    }
    let p = &plan.prediction;
    let [x, y, z] = p.com_m.map(|v| 1e3 * v);
    text += &format!(
        "\n\nThe body: {body}, {:.3} kg.\nPredicted U95 at {:.0} readings/s, offsets unknown: mass {:.4} kg; \
         centre of mass {x:.3}, {y:.3}, {z:.3} mm;\n\
         tensor about it (Ixx, Iyy, Izz, Iyz, Izx, Ixy) {}, 1e-3 kg m².\nCondition number of the columns, \
         scaled: {:.2}; with the offsets eliminated {:.2}.",
        task.equipment.payload.body.mass_kg,
        task.rate_hz,
        p.parameters[0],
        p.inertia_com_kgm2.map(|v| format!("{:.3}", 1e3 * v)).join(", "),
        p.condition_number,
        p.condition_eliminated
    );
    if !p.determined {
        text += "\nThis motion leaves a part of the body undetermined.";
    }
    text
}
