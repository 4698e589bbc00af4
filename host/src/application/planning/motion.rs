//! Motions of a platform.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use hexapod::{BodyParameters, Limit, Mounting, Peak};
use rigident_shared::inertia::PARAMETER_NAMES;
use serde::Serialize;

use super::super::{Caller, Error, PlanError};
use super::unchecked;
use rigident_fit::Progress;
use rigident_io::rig::RigFile;
use rigident_plan::carried::LoadBound;
use rigident_plan::equipment::Equipment;
use rigident_plan::machine::{self, MachineError};
use rigident_plan::motion::compare::{self, Row};
use rigident_plan::motion::{self, MotionPlan, Objective, Task, coverage};
use rigident_plan::plan_file::PlanFile;
use rigident_present::directions::{self, Directions};

/// Rate of readings where a rig file states none, 1/s.
const RATE_HZ: f64 = 1000.0;

/// The way a motion is planned.
#[derive(Clone, Debug)]
pub struct MotionOptions {
    /// Rig file with a platform. Default: the built-in platform.
    pub rig: Option<PathBuf>,
    /// The objective.
    pub objective: Objective,
    /// Length of the whole experiment, s.
    pub duration_s: f64,
    /// The body that the legs carry, with what it is called. Default: any of the rig file's bound, else the
    /// thesis' test body, lying.
    pub body: Option<(BodyParameters, String)>,
    /// The static step comes first.
    pub poses: bool,
    /// Highest frequency of a D-optimal motion, Hz. Default: the planner's.
    pub highest_hz: Option<f64>,
    /// The share of the stroke, or of the plate's travel, that is left unused where `stroke_m` is not given.
    pub reserve: f64,
    /// The stroke of the legs that is used, about its middle, m.
    pub stroke_m: Option<f64>,
}

impl Default for MotionOptions {
    fn default() -> Self {
        Self {
            rig: None,
            objective: Objective::DOptimal,
            duration_s: 60.0,
            body: None,
            poses: true,
            highest_hz: None,
            reserve: machine::RESERVE,
            stroke_m: None,
        }
    }
}

/// A planned motion.
#[derive(Debug)]
pub struct PlannedMotion {
    /// The warnings.
    pub warnings: Vec<String>,
    pub(super) plan: MotionPlan,
    pub(super) task: Task,
    pub(super) body: String,
    /// Directions of angular velocity and acceleration visited by the motion, shares.
    pub(super) coverage: [f64; 2],
}

/// Several motions beside each other.
#[derive(Debug)]
pub struct ComparedMotions {
    /// The warnings.
    pub warnings: Vec<String>,
    rows: Vec<Row>,
    duration_s: f64,
    rate_hz: f64,
}

/// A planned motion as an object.
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

/// One motion beside others.
#[derive(Serialize)]
struct Compared<'a> {
    worst_inertia_u95_share: f64,
    condition_number_alone: f64,
    condition_number_alone_eliminated: f64,
    #[serde(flatten)]
    motion: Object<'a>,
}

/// Several motions as an object.
#[derive(Serialize)]
struct Motions<'a> {
    motions: Vec<Compared<'a>>,
}

/// Plans a motion that tells the most, inside all limits at every instant. `stop` ends the search with the
/// best so far.
///
/// # Errors
/// [`Error::Plan`] if there is no such motion, [`Error::Recording`] of the rig file.
///
/// ```
/// use rigident::application::{Caller, MotionOptions, plan_motion};
/// use rigident::plan::motion::Objective;
///
/// let options = MotionOptions { objective: Objective::Multisine, ..MotionOptions::default() };
/// let planned = plan_motion(&options, &false.into(), &Caller::default())?;
/// let object = serde_json::to_value(planned.object()).unwrap();
/// assert!(object["predicted_u95"]["m"].as_f64().unwrap() < 0.1);
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub fn plan_motion(
    options: &MotionOptions,
    stop: &AtomicBool,
    caller: &Caller<'_>,
) -> Result<PlannedMotion, Error> {
    caller.stoppable(|| {
        let (task, body, warnings) = task(options)?;
        let note = |text: String| caller.stage(&text, 0.0);
        let plan = motion::plan(&task, stop, note).map_err(PlanError::from)?;
        let trajectory = plan.program.trajectory().map_err(PlanError::from)?;
        let [from, to] = plan.motion_s;
        let coverage = coverage::of_motion(&trajectory, from, to);
        Ok(PlannedMotion { warnings, plan, task, body, coverage })
    })
}

/// Plans motions for every objective and body of the thesis, and puts their predictions beside each other.
///
/// # Errors
/// As of [`plan_motion`].
pub fn compare_motions(
    (rig_file, stroke_m, duration_s): (Option<&Path>, Option<f64>, f64),
    stop: &AtomicBool,
    caller: &Caller<'_>,
) -> Result<ComparedMotions, Error> {
    caller.stoppable(|| {
        let Rig { equipment, rate_hz, warnings, .. } = rig(rig_file, stroke_m)?;
        let task = Task { duration_s, rate_hz, ..Task::new(equipment) };
        let note = |text: String| caller.stage(&text, 0.0);
        let rows = compare::compare(&task, stop, note).map_err(PlanError::from)?;
        Ok(ComparedMotions { warnings, rows, duration_s, rate_hz })
    })
}

impl PlannedMotion {
    /// Returns the plan's file.
    pub fn file(&self) -> PlanFile {
        let title = format!("{}, {:.0} s", self.words(), self.plan.program.duration_s());
        let equipment = &self.task.equipment;
        let file = PlanFile::new(title, &equipment.geometry, self.plan.program.clone());
        // A bound is no body.
        if equipment.bodies.is_some() { file } else { file.carrying(equipment.carried()) }
    }

    /// Returns the directions of angular rate and acceleration on their spheres, SVG.
    ///
    /// # Errors
    /// The platform cannot do it.
    pub fn plot(&self) -> Result<String, Error> {
        let [from, to] = self.plan.motion_s;
        let trajectory = self.plan.program.trajectory().map_err(PlanError::from)?;
        let kinds = ["angular rate", "angular acceleration"].into_iter().zip(self.coverage);
        let spheres: Vec<Directions> = kinds
            .zip(coverage::vectors(&trajectory, from, to))
            .map(|((kind, share), vectors)| Directions {
                title: format!("{kind}, axes of the plate: {:.0} % of all directions", 100.0 * share),
                vectors: vectors.into_iter().map(Into::into).collect(),
            })
            .collect();
        Ok(directions::svg(self.words(), &spheres))
    }

    /// Returns it as an object.
    pub fn object(&self) -> impl Serialize + '_ {
        let name = match self.task.objective {
            Objective::DOptimal => "d-optimal",
            Objective::Spheres => "spheres",
            Objective::RollPitchYaw => "rpy",
            Objective::Multisine => "multisine",
        };
        object(&self.plan, name, &self.body, self.coverage)
    }

    /// Returns what the motion is, in words.
    pub(super) fn words(&self) -> &'static str {
        match self.task.objective {
            Objective::DOptimal => "D-optimal motion",
            Objective::Spheres => "spheres about the centre of mass",
            Objective::RollPitchYaw => "roll, pitch and yaw",
            Objective::Multisine => "the default multisine",
        }
    }
}

impl ComparedMotions {
    /// Returns them as an object.
    pub fn object(&self) -> impl Serialize + '_ {
        let compared = |row: &'_ Row| Compared {
            worst_inertia_u95_share: row.worst(),
            condition_number_alone: row.condition_alone,
            condition_number_alone_eliminated: row.condition_alone_eliminated,
            motion: object(&row.plan, row.objective, row.body, row.coverage),
        };
        Motions { motions: self.rows.iter().map(compared).collect() }
    }

    /// Returns them as text.
    pub fn text(&self) -> String {
        format!(
            "Predicted U95, experiments of {:.0} s at {} readings/s, offsets unknown.\n\n{}",
            self.duration_s,
            self.rate_hz,
            compare::table(&self.rows).trim_end()
        )
    }
}

/// The part of a rig that a motion depends on.
struct Rig {
    equipment: Equipment,
    /// Readings, 1/s.
    rate_hz: f64,
    /// How heavy and large a body may be.
    bound: Option<LoadBound>,
    warnings: Vec<String>,
}

fn rig(path: Option<&Path>, stroke_m: Option<f64>) -> Result<Rig, Error> {
    let equipment = Equipment::thesis_horizontal();
    let mut own = Rig { equipment, rate_hz: RATE_HZ, bound: None, warnings: Vec::new() };
    if let Some(path) = path {
        let file = RigFile::load(path)?;
        let lacking = |error: MachineError| PlanError::Machine { rig: path.display().to_string(), error };
        own.equipment.geometry = machine::geometry(&file).map_err(lacking)?;
        own.warnings.extend(unchecked(&own.equipment.geometry).map(str::to_owned));
        machine::load_cell(&file).map_err(lacking)?;
        equip(&mut own.equipment, &file);
        own.rate_hz = file.recording.rate_hz.unwrap_or(own.rate_hz);
        own.bound = LoadBound::of(&file);
    }
    if let Some(stroke_m) = stroke_m {
        if !own.equipment.geometry.has_joints() {
            return Err(PlanError::Stroke.into());
        }
        own.equipment.geometry = own.equipment.geometry.with_stroke(stroke_m).map_err(PlanError::from)?;
    }
    Ok(own)
}

/// Takes places, ranges and noise of the sensors from a rig file.
fn equip(equipment: &mut Equipment, file: &RigFile) {
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
}

/// Returns the task, in words the body that it is for, and what to warn of.
fn task(options: &MotionOptions) -> Result<(Task, String, Vec<String>), Error> {
    let Rig { mut equipment, rate_hz, bound, warnings } = rig(options.rig.as_deref(), options.stroke_m)?;
    if !(0.0..1.0).contains(&options.reserve) {
        return Err(PlanError::Reserve(options.reserve).into());
    }
    if options.stroke_m.is_none() {
        equipment.geometry = equipment.geometry.with_reserve(options.reserve);
    }
    let (body, words) = match (&options.body, bound) {
        (Some((body, words)), _) => (*body, words.clone()),
        (None, Some(bound)) => {
            equipment.bodies = Some(bound.set());
            let words = "any of load_max_kg within load_within_m; predicted is a ball of that size";
            (bound.ball(), words.to_owned())
        }
        (None, None) => {
            let words = "the thesis' test body with plates, horizontal";
            (BodyParameters::thesis_horizontal(), words.to_owned())
        }
    };
    if options.highest_hz.is_some() && options.objective != Objective::DOptimal {
        return Err(PlanError::HighestHz.into());
    }
    let task = Task {
        objective: options.objective,
        duration_s: options.duration_s,
        poses: options.poses,
        highest_hz: options.highest_hz.unwrap_or(motion::plan::HIGHEST_HZ),
        rate_hz,
        ..Task::new(equipment.with_body(body))
    };
    Ok((task, words, warnings))
}

pub(super) fn key(peak: &Peak) -> &'static str {
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
