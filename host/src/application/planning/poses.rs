//! Still poses of a platform.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use hexapod::{Geometry, Load, Segment, THESIS_WRENCH_NOISE_N_NM};
use nalgebra::Matrix3;
use serde::Serialize;

use super::super::{Caller, Error, PlanError};
use super::unchecked;
use rigident_fit::Progress;
use rigident_io::rig::RigFile;
use rigident_plan::carried::{self, LoadBound};
use rigident_plan::machine::{self, MachineError};
use rigident_plan::motion::plan::GYRO_SHARE;
use rigident_plan::plan_file::PlanFile;
use rigident_plan::poses::plan::{self, PlanError as NoPoses, PosePlan, Task, check_n, of_angles};
use rigident_plan::poses::program::{MOVE_RATE_RADPS, program};
use rigident_plan::poses::{Objective, Reach, Region};

/// The longest that a pose may be held, s.
const LONGEST_HOLD_S: f64 = 600.0;

/// The purpose of poses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PoseObjective {
    /// The least condition number of the normal matrix.
    #[default]
    Condition,
    /// The largest determinant of it.
    Determinant,
    /// The least of the largest uncertainties of the first moment.
    WorstUncertainty,
}

impl PoseObjective {
    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Condition => "condition",
            Self::Determinant => "determinant",
            Self::WorstUncertainty => "worst-uncertainty",
        }
    }
}

/// The way poses are planned.
#[derive(Clone, Debug)]
pub struct PoseOptions {
    /// Rig file with a platform. Default: the built-in platform.
    pub rig: Option<PathBuf>,
    /// The number of poses; of given ones theirs.
    pub n: Option<usize>,
    /// Roll and pitch of poses that are given, degrees: they are judged, not planned.
    pub angles_deg: Option<Vec<[f64; 2]>>,
    /// The stroke of the legs that is used, about its middle, m.
    pub stroke_m: Option<f64>,
    /// How far the poses stay away from every limit, a share.
    pub margin: f64,
    /// The objective.
    pub objective: PoseObjective,
    /// The time that each pose is held in the plan's file, s.
    pub hold_s: f64,
}

impl Default for PoseOptions {
    fn default() -> Self {
        Self {
            rig: None,
            n: None,
            angles_deg: None,
            stroke_m: None,
            margin: 0.01,
            objective: PoseObjective::default(),
            hold_s: 3.0,
        }
    }
}

/// Planned poses.
#[derive(Debug)]
pub struct PlannedPoses {
    /// The warnings.
    pub warnings: Vec<String>,
    pub(super) plan: PosePlan,
    pub(super) held: Vec<bool>,
    pub(super) region: Region,
    pub(super) reach: Reach,
    /// Absent where the poses were given.
    objective: Option<PoseObjective>,
    hold_s: f64,
    turn_radps: f64,
}

/// Planned poses as an object.
#[derive(Serialize)]
struct Object {
    n: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    objective: Option<&'static str>,
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

/// Plans still poses that tell the centre of mass best, or judges given ones. `stop` ends the search with the
/// best so far.
///
/// # Errors
/// [`Error::Plan`] if there are no such poses, [`Error::Rig`] of the rig file.
///
/// ```
/// use rigident::application::{Caller, PoseOptions, plan_poses};
///
/// let options = PoseOptions { n: Some(4), ..PoseOptions::default() };
/// let planned = plan_poses(&options, &false.into(), &Caller::default())?;
/// let object = serde_json::to_value(planned.object()).unwrap();
/// assert_eq!(object["poses_deg"].as_array().unwrap().len(), 4);
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub fn plan_poses(
    options: &PoseOptions,
    stop: &AtomicBool,
    caller: &Caller<'_>,
) -> Result<PlannedPoses, Error> {
    caller.stoppable(|| planned(options, stop, caller))
}

fn planned(options: &PoseOptions, stop: &AtomicBool, caller: &Caller<'_>) -> Result<PlannedPoses, Error> {
    let rig = rig(options.rig.as_deref())?;
    let given = options.angles_deg.as_deref();
    let task = task(options, &rig);
    check_n(task.n, &task.objective).map_err(|e| named(e, given.is_some()))?;
    if !(options.hold_s > 0.0 && options.hold_s <= LONGEST_HOLD_S) {
        return Err(PlanError::Hold(options.hold_s).into());
    }
    caller.stage("where the platform can tilt to", 0.0);
    let mut warnings: Vec<String> =
        options.rig.iter().filter_map(|_| unchecked(&rig.geometry)).map(str::to_owned).collect();
    if rig.geometry.limits.of_force().is_some() && rig.load.is_none() {
        warnings.push(
            "the forces of the legs are not checked: the rig file has no load_within_m that bounds what they \
             carry"
                .to_owned(),
        );
    }
    let reach = Reach::new(rig.geometry, options.stroke_m)
        .and_then(|reach| reach.with_margin(if given.is_some() { 0.0 } else { options.margin }))
        .and_then(|reach| reach.carrying(rig.load))
        .map_err(PlanError::from)?;
    let region = Region::of_platform(&reach);
    let (plan, held) = match given {
        Some(angles) => {
            let angles: Vec<_> = angles.iter().map(|angles| angles.map(f64::to_radians)).collect();
            of_angles(&reach, &angles, &task).map_err(|e| named(e, true))?
        }
        None => {
            let doing = |doing: &str| caller.stage(doing, 0.0);
            let plan = plan::plan(&reach, &region, &task, stop, doing).map_err(PlanError::from)?;
            let held = vec![true; plan.poses.len()];
            (plan, held)
        }
    };
    let objective = given.is_none().then_some(options.objective);
    let (hold_s, turn_radps) = (options.hold_s, rig.turn_radps);
    Ok(PlannedPoses { warnings, plan, held, region, reach, objective, hold_s, turn_radps })
}

fn task(options: &PoseOptions, rig: &Rig) -> Task {
    let [_, _, _, mx, my, mz] = rig.noise_n_nm;
    let objective = match options.objective {
        PoseObjective::Condition => Objective::Condition,
        PoseObjective::Determinant => Objective::Determinant,
        PoseObjective::WorstUncertainty => {
            Objective::WorstUncertainty { moment_sigma_nm: [mx, my, mz], plate_to_cell: rig.plate_to_cell }
        }
    };
    Task {
        n: options.n.or(options.angles_deg.as_ref().map(Vec::len)).unwrap_or(0),
        objective,
        noise_n_nm: rig.noise_n_nm,
        plate_to_cell: rig.plate_to_cell,
        gravity_mps2: rig.gravity_mps2,
    }
}

/// Says by which option a number of poses is wrong.
fn named(error: NoPoses, is_given: bool) -> PlanError {
    match error {
        NoPoses::Orientations { n, fewest } if is_given => PlanError::Count { n, fewest },
        NoPoses::Angles(_) => PlanError::Angles(error),
        other => other.into(),
    }
}

impl PlannedPoses {
    /// Returns the plan's file, and the length of its program and of what is at rest in it, s.
    ///
    /// # Errors
    /// [`PlanError::CannotHold`] of a given pose; the platform cannot go from one to the next.
    pub fn file(&self) -> Result<(PlanFile, [f64; 2]), Error> {
        if let Some(k) = self.held.iter().position(|held| !held) {
            return Err(PlanError::CannotHold(k + 1).into());
        }
        let program =
            program(&self.reach, &self.plan.poses, self.hold_s, self.turn_radps).map_err(PlanError::from)?;
        let rests = program.segments.iter().filter(|s| matches!(s, Segment::Hold { .. }));
        let (duration_s, rest_s) = (program.duration_s(), rests.map(Segment::duration_s).sum());
        let which = self.objective.map_or("given".to_owned(), |own| format!("best {}", own.name()));
        let title = format!("{} still poses, {which}, {duration_s:.0} s", self.plan.poses.len());
        Ok((PlanFile::new(title, self.reach.geometry(), program), [duration_s, rest_s]))
    }

    /// Returns it as an object.
    pub fn object(&self) -> impl Serialize {
        let plan = &self.plan;
        let finite = |v: f64| v.is_finite().then_some(v);
        Object {
            n: plan.poses.len(),
            objective: self.objective.map(PoseObjective::name),
            poses_deg: plan.poses_deg(),
            held: self.held.clone(),
            positions_m: plan.poses.iter().map(|p| p.position_m).collect(),
            condition_number: plan.condition_number_normal.sqrt(),
            condition_number_normal: plan.condition_number_normal,
            condition_number_normal_relative: finite(plan.relative_condition_number_normal),
            determinant_normal: plan.determinant,
            predicted_u95: plan.predicted_u95.map(|[m, mcx, mcy, mcz]| PredictedU95 { m, mcx, mcy, mcz }),
        }
    }
}

fn rig(path: Option<&Path>) -> Result<Rig, Error> {
    let thesis = THESIS_WRENCH_NOISE_N_NM;
    let Some(path) = path else {
        return Ok(Rig {
            geometry: Geometry::thesis(),
            load: None,
            noise_n_nm: thesis,
            plate_to_cell: Matrix3::identity(),
            gravity_mps2: hexapod::STANDARD_GRAVITY_MPS2,
            turn_radps: MOVE_RATE_RADPS,
        });
    };
    let file = RigFile::load(path)?;
    let lacking = |error: MachineError| PlanError::Machine { rig: path.display().to_string(), error };
    let geometry = machine::with_joints(&file).map_err(lacking)?;
    let cell_to_plate = machine::load_cell(&file).map_err(lacking)?.1;
    let load = LoadBound::of(&file).map(|bound| carried::load(&file, &bound.set()));
    let ranges = file.imu.iter().filter_map(|imu| imu.range_radps);
    Ok(Rig {
        geometry,
        load: load.transpose().map_err(lacking)?,
        noise_n_nm: file.load_cell.noise_n_nm.unwrap_or(thesis),
        plate_to_cell: cell_to_plate.transpose(),
        gravity_mps2: file.recording.gravity_mps2,
        turn_radps: ranges.fold(MOVE_RATE_RADPS, |rate, range| rate.min(GYRO_SHARE * range)),
    })
}
