use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use hexapod::{Geometry, Load, Segment, THESIS_WRENCH_NOISE_N_NM};
use nalgebra::Matrix3;
use serde::Serialize;

use crate::commands::factor::absent;
use crate::commands::plan::arguments::{PlanPoses, PoseObjective};
use crate::commands::plan::motion::ended;
use crate::commands::run::programme::tell_collisions;
use crate::kept::Stop;
use crate::screen::outcome::say;
use crate::{Failure, Progress};
use rigident::plan::carried::{self, LoadBound};
use rigident::plan::machine;
use rigident::plan::motion::plan::GYRO_SHARE;
use rigident::plan::plan_file::PlanFile;
use rigident::plan::poses::measure::least_condition_number_in_cone;
use rigident::plan::poses::plan::{MOST_ORIENTATIONS, PlanError, PosePlan, Task, check_n, of_angles, plan};
use rigident::plan::poses::program::{MOVE_RATE_RADPS, program};
use rigident::plan::poses::{Objective, Reach, Region};
use rigident_io::rig::RigFile;

/// The part of a rig that the plan depends on.
struct Rig {
    geometry: Geometry,
    load: Option<Load>,
    noise_n_nm: [f64; 6],
    plate_to_cell: Matrix3<f64>,
    gravity_mps2: f64,
    /// Highest angular rate between poses, rad/s.
    turn_radps: f64,
}

/// The object of `--json`.
#[derive(Serialize)]
struct Object<'a> {
    n: usize,
    /// Absent where the poses were given.
    #[serde(skip_serializing_if = "Option::is_none")]
    objective: Option<&'a str>,
    poses_deg: Vec<[f64; 2]>,
    held: Vec<bool>,
    positions_m: Vec<[f64; 3]>,
    condition_number: f64,
    condition_number_normal: f64,
    /// Absent where the level pose and these leave something open.
    #[serde(skip_serializing_if = "Option::is_none")]
    condition_number_normal_relative: Option<f64>,
    determinant_normal: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    predicted_u95: Option<PredictedU95>,
}

/// One reading in each pose, offsets unknown.
#[derive(Serialize)]
struct PredictedU95 {
    m: f64,
    mcx: f64,
    mcy: f64,
    mcz: f64,
}

/// Runs `rigident plan poses`.
pub(crate) fn run(arguments: &PlanPoses) -> Result<ExitCode, Failure> {
    let rig = rig(arguments.rig.as_deref())?;
    let [_, _, _, mx, my, mz] = rig.noise_n_nm;
    let (name, objective) = match arguments.objective {
        PoseObjective::Condition => ("condition", Objective::Condition),
        PoseObjective::Determinant => ("determinant", Objective::Determinant),
        PoseObjective::WorstUncertainty => (
            "worst-uncertainty",
            Objective::WorstUncertainty { moment_sigma_nm: [mx, my, mz], plate_to_cell: rig.plate_to_cell },
        ),
    };
    let given = arguments.angles.as_ref().map(|angles| angles.0.as_slice());
    let n = arguments.n.or(given.map(<[_]>::len)).unwrap_or(0);
    check_n(n, &objective).map_err(|e| named(e, given.is_some()))?;
    check_out(arguments)?;
    let mut progress = Progress::new();
    progress.show(|| "where the platform can tilt to".to_owned());
    if rig.geometry.limits.of_force().is_some() && rig.load.is_none() {
        tell!(
            "rigident: the forces of the legs are not checked: the rig file has no load_within_m that bounds \
             what they carry"
        );
    }
    let reach = Reach::new(rig.geometry, arguments.stroke_m)
        .and_then(|reach| reach.with_margin(if given.is_some() { 0.0 } else { arguments.margin }))
        .and_then(|reach| reach.carrying(rig.load))
        .map_err(Failure::input)?;
    let region = Region::of_platform(&reach);
    let task = Task {
        n,
        objective,
        noise_n_nm: rig.noise_n_nm,
        plate_to_cell: rig.plate_to_cell,
        gravity_mps2: rig.gravity_mps2,
    };
    let stop = Stop::of_this_command();
    let (made, held) = match given {
        Some(angles) => {
            let angles: Vec<_> = angles.iter().map(|angles| angles.map(f64::to_radians)).collect();
            of_angles(&reach, &angles, &task).map_err(|e| named(e, true))?
        }
        None => {
            let made = plan(&reach, &region, &task, &stop, |doing| progress.show(|| doing.to_owned()))
                .map_err(Failure::input)?;
            let held = vec![true; made.poses.len()];
            (made, held)
        }
    };
    progress.finish();
    let stopped = stop.load(Ordering::Relaxed);
    if let Some(k) = held.iter().position(|held| !held).filter(|_| arguments.out.is_some()) {
        return Err(Failure::input(format!(
            "--angles: the platform cannot hold pose {}; nothing was written",
            k + 1
        )));
    }
    if let Some(path) = &arguments.out {
        let program =
            program(&reach, &made.poses, arguments.hold_s, rig.turn_radps).map_err(Failure::input)?;
        let rest_s: f64 = program
            .segments
            .iter()
            .filter(|s| matches!(s, Segment::Hold { .. }))
            .map(Segment::duration_s)
            .sum();
        let duration_s = program.duration_s();
        let which = if given.is_some() { "given".to_owned() } else { format!("best {name}") };
        let title = format!("{n} still poses, {which}, {duration_s:.0} s");
        PlanFile::new(title, reach.geometry(), program).write(path).map_err(Failure::input)?;
        tell!("{}: {duration_s:.1} s, {rest_s:.1} s of them at rest", path.display());
    }
    if arguments.json {
        say(serde_json::to_string(&object(&made, given.is_none().then_some(name), held))
            .map_err(Failure::input)?);
    } else {
        say(table(&made, &held, &region, &reach));
    }
    Ok(ended(stopped, "poses"))
}

/// Checks the options of the plan's file now rather than after the work.
fn check_out(arguments: &PlanPoses) -> Result<(), Failure> {
    if !(arguments.hold_s > 0.0 && arguments.hold_s <= 600.0) {
        return Err(Failure::input(format!(
            "--hold-s {}: more than 0 s, and 600 s at most",
            arguments.hold_s
        )));
    }
    arguments.out.as_deref().map_or(Ok(()), absent)
}

/// Returns what is wrong with a number of poses, by the option that says it.
fn named(error: PlanError, given: bool) -> Failure {
    match error {
        PlanError::Orientations { n, fewest } if given => Failure::input(format!(
            "--angles: {n} poses; {fewest} at least (fewer leave a part of the centre of mass open), \
             {MOST_ORIENTATIONS} at most"
        )),
        PlanError::Angles(_) => Failure::input(format!("--angles: {error}")),
        other => Failure::input(other),
    }
}

fn object<'a>(plan: &PosePlan, objective: Option<&'a str>, held: Vec<bool>) -> Object<'a> {
    let finite = |v: f64| v.is_finite().then_some(v);
    Object {
        n: plan.poses.len(),
        objective,
        poses_deg: plan.poses_deg(),
        held,
        positions_m: plan.poses.iter().map(|p| p.position_m).collect(),
        condition_number: plan.condition_number_normal.sqrt(),
        condition_number_normal: plan.condition_number_normal,
        condition_number_normal_relative: finite(plan.relative_condition_number_normal),
        determinant_normal: plan.determinant,
        predicted_u95: plan.predicted_u95.map(|[m, mcx, mcy, mcz]| PredictedU95 { m, mcx, mcy, mcz }),
    }
}

fn table(plan: &PosePlan, held: &[bool], region: &Region, reach: &Reach) -> String {
    let (least, largest) = region.tilt_range_rad();
    let [low, high] = reach.geometry().leg_length_m;
    let mut text = format!(
        "Legs from {low:.4} m to {high:.4} m tilt the plate by {:.1}° to {:.1}°, depending on the \
         direction.\n\n  pose     roll    pitch     tilt        x        y        z\n          °        \
         °        °        m        m        m",
        least.to_degrees(),
        largest.to_degrees()
    );
    let mut steepest: f64 = 0.0;
    for (k, ((pose, [roll, pitch]), held)) in plan.poses.iter().zip(plan.poses_deg()).zip(held).enumerate() {
        let tilt = (roll.to_radians().cos() * pitch.to_radians().cos()).acos().to_degrees();
        steepest = steepest.max(tilt);
        text += &format!("\n  {:>4} {roll:>8.2} {pitch:>8.2} {tilt:>8.2}", k + 1);
        let [x, y, z] = pose.position_m;
        text += &match held {
            true => format!(" {x:>8.4} {y:>8.4} {z:>8.4}"),
            false => "   the platform cannot hold it".to_owned(),
        };
    }
    text += &format!(
        "\n\nCondition number of the stacked [F] {:.3}, of the normal matrix {:.3}",
        plan.condition_number_normal.sqrt(),
        plan.condition_number_normal
    );
    if plan.relative_condition_number_normal.is_finite() {
        text += &format!("; relative to the level pose {:.3}", plan.relative_condition_number_normal);
    }
    let n = plan.poses.len();
    text += &format!(
        ". Determinant {:.4}.\n{n} poses that tilt by {steepest:.1}° at most have a normal matrix of {:.3} \
         at least.\n",
        plan.determinant,
        least_condition_number_in_cone(n, steepest.to_radians())
    );
    text += &match plan.predicted_u95 {
        Some([m, x, y, z]) => format!(
            "One reading a pose, offsets unknown, predicted U95: mass {m:.2} kg, first moment {x:.3}, \
             {y:.3}, {z:.3} kg m."
        ),
        None => {
            "These poses alone leave a part of the first moment open if the offsets are unknown: add the \
                 level pose."
                .to_owned()
        }
    };
    text
}

fn rig(path: Option<&Path>) -> Result<Rig, Failure> {
    let thesis = THESIS_WRENCH_NOISE_N_NM;
    let Some(path) = path else {
        return Ok(Rig {
            geometry: Geometry::thesis(),
            load: None,
            noise_n_nm: thesis,
            plate_to_cell: Matrix3::identity(),
            gravity_mps2: 9.80665,
            turn_radps: MOVE_RATE_RADPS,
        });
    };
    let file = RigFile::load(path).map_err(Failure::input)?;
    let incomplete = |error| Failure::input(format!("{}: {error}", path.display()));
    let geometry = machine::with_joints(&file).map_err(incomplete)?;
    tell_collisions(&geometry);
    let cell_to_plate = machine::load_cell(&file).map_err(incomplete)?.1;
    Ok(Rig {
        geometry,
        load: match LoadBound::of(&file) {
            Some(bound) => Some(carried::load(&file, &bound.set()).map_err(incomplete)?),
            None => None,
        },
        noise_n_nm: file.load_cell.noise_n_nm.unwrap_or(thesis),
        plate_to_cell: cell_to_plate.transpose(),
        gravity_mps2: file.recording.gravity_mps2,
        turn_radps: file
            .imu
            .iter()
            .filter_map(|imu| imu.range_radps)
            .fold(MOVE_RATE_RADPS, |rate, range| rate.min(GYRO_SHARE * range)),
    })
}
