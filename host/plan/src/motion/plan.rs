//! A motion for a rig: made by one of three objectives, made small enough, and guaranteed.

use std::sync::atomic::AtomicBool;

use hexapod::{Axis, Guarantee, Load, MotionProgram, Segment, SineTerm, Sphere, Trajectory, Violation};
use nalgebra::Vector3;

use super::barrier::Barrier;
use super::family::Family;
use super::information::{Information, Instrument};
use super::predict::{PredictError, Prediction, predict};
use super::program::{Frame, FrameError, stands};
use super::search::{Descent, Problem, Volume};
use crate::equipment::Equipment;

/// The purpose of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Objective {
    /// The largest determinant of the information on the body, offsets unknown.
    DOptimal,
    /// The thesis' spheres: turns about every axis, the centre of mass still.
    Spheres,
    /// Roll, pitch and yaw, one frequency each.
    RollPitchYaw,
    /// The default experiment's multisine, not searched for.
    Multisine,
}

/// The planning task.
#[derive(Clone, Debug)]
pub struct Task {
    /// The platform with body and sensors.
    pub equipment: Equipment,
    /// The objective.
    pub objective: Objective,
    /// Duration of the whole experiment, s.
    pub duration_s: f64,
    /// True if the thesis' static step comes first.
    pub poses: bool,
    /// Highest frequency of the motion, Hz.
    pub highest_hz: f64,
    /// Highest angular rate, rad/s.
    pub rate_radps: f64,
    /// Rate of the readings that are predicted for, 1/s.
    pub rate_hz: f64,
    /// Random beginnings of the search.
    pub starts: usize,
}

/// A motion, its guarantee and what it will tell.
#[derive(Clone, Debug)]
pub struct MotionPlan {
    /// The whole experiment.
    pub program: MotionProgram,
    /// Begin and end of the motion in it, s.
    pub motion_s: [f64; 2],
    /// The guarantee of every limit over all of it.
    pub guarantee: Guarantee,
    /// The information that it will bring.
    pub prediction: Prediction,
    /// The part of the plan that is driven; below one where the guarantee asked for less.
    pub size: f64,
}

/// The reason why there is no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// The experiment around it.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The prediction.
    #[error(transparent)]
    Predict(#[from] PredictError),
    /// A number that makes no sense.
    #[error("{0}")]
    Number(String),
    /// The static step, or even the smallest motion.
    #[error("no motion is inside the limits: {violation} at t = {time_s:.3} s: {}", violation.advice())]
    Limit {
        /// The limit that is exceeded.
        violation: Violation,
        /// The time, s.
        time_s: f64,
    },
    /// The static step turns faster than the gyro's range allows, rad/s.
    #[error("the static step turns at up to {0:.3} rad/s, more than the IMU may see: give more time")]
    Rate(f64),
    /// The body's weight is too much.
    #[error(
        "the body at rest takes {0:.0} % of the load cell's range in one of its channels: nothing is left \
         for a motion: plan for a lighter or smaller one (lower load_max_kg or load_within_m, or give \
         `body`)"
    )]
    Sensors(f64),
    /// The limits leave no room about home.
    #[error("the limits leave no room for a motion about home, x = {x:.3} m, y = {y:.3} m, z = {z:.3} m")]
    NoRoom {
        /// m.
        x: f64,
        /// m.
        y: f64,
        /// m.
        z: f64,
    },
}

/// Share of the sensors' ranges that a motion may use.
pub const SENSOR_SHARE: f64 = 0.85;
/// Share of the gyro's range, in which nothing is unknown but noise.
pub const GYRO_SHARE: f64 = 0.9;

/// Returns the grid of the search, s; a twentieth of the shortest period.
pub fn step_s(highest_hz: f64) -> f64 {
    (0.05 / highest_hz).min(0.04)
}

/// Returns six frequencies, well separated, none a multiple of another.
pub fn frequencies_hz(highest_hz: f64) -> [f64; 6] {
    [0.17, 0.29, 0.43, 0.61, 0.79, 1.0].map(|share| share * highest_hz)
}

/// Periods of [`frequencies_hz`] in one common period.
const PERIODS: [f64; 6] = [8.0, 14.0, 20.0, 29.0, 37.0, 47.0];

/// Returns the common period of the frequencies, s, where a motion of this length is made of repetitions, and
/// their number beside the part that is searched for: a long motion would yield no more by other means, and
/// takes long to search.
fn repetitions(highest_hz: f64, motion_s: f64, ramp_s: f64) -> Option<(f64, usize)> {
    let period_s = PERIODS[5] / highest_hz;
    let again = ((motion_s - 2.0 * ramp_s) / period_s - 1.0).floor();
    (again >= 1.0).then_some((period_s, again as usize))
}

/// Plans. `note` receives the progress; `stop` ends the search with the best so far.
///
/// # Errors
/// Limits that cannot be met, a duration that is too short, numbers without sense.
pub fn plan(task: &Task, stop: &AtomicBool, mut note: impl FnMut(String)) -> Result<MotionPlan, PlanError> {
    let positive = |name: &str, v: f64, most: f64| {
        if v > 0.0 && v <= most {
            Ok(())
        } else {
            Err(PlanError::Number(format!("{name} {v}: more than 0, and {most} at most")))
        }
    };
    positive("`duration_s`", task.duration_s, 3600.0)?;
    positive("`highest_hz`", task.highest_hz, 5.0)?;
    positive("`rate_hz`", task.rate_hz, 20_000.0)?;
    if task.highest_hz * task.duration_s < 1.0 {
        let (highest_hz, duration_s) = (task.highest_hz, task.duration_s);
        return Err(PlanError::Number(format!(
            "`highest_hz` {highest_hz}: not one period in {duration_s} s"
        )));
    }
    let geometry = &task.equipment.geometry;
    let load = task.equipment.load();
    stands(geometry, &load)?;
    let frame = if task.poses {
        Frame::with_poses(geometry, &load, task.duration_s)?
    } else {
        Frame::bare(geometry, task.duration_s)?
    };
    let shape = shape(task, &frame, stop, &mut note)?;
    note("limits at every instant".to_owned());
    let (size, program, guarantee) = guaranteed(task, &frame, &load, &*shape)?;
    note("prediction".to_owned());
    let prediction = predict(&task.equipment, &program, task.rate_hz)?;
    let motion_s = [frame.begin_s, frame.begin_s + frame.motion_s];
    Ok(MotionPlan { program, motion_s, guarantee, prediction, size })
}

/// A motion by its size.
type Shape = dyn Fn(f64) -> Segment;

fn shape(
    task: &Task,
    frame: &Frame,
    stop: &AtomicBool,
    mut note: impl FnMut(String),
) -> Result<Box<Shape>, PlanError> {
    let duration_s = frame.motion_s;
    let ramp_s = (0.5 * duration_s).min(1.5);
    match task.objective {
        Objective::RollPitchYaw => Ok(Box::new(move |size| {
            let term = |axis, frequency_hz| SineTerm { axis, amplitude: size, frequency_hz, phase_rad: 0.0 };
            let terms = vec![term(Axis::Roll, 0.23), term(Axis::Pitch, 0.31), term(Axis::Yaw, 0.41)];
            Segment::Multisine { duration_s, ramp_s, terms }
        })),
        Objective::Spheres => {
            let still_point_m = task.equipment.carried().com_m;
            let sphere = Sphere {
                duration_s,
                ramp_s,
                amplitude_rad: 1.0,
                frequency_hz: 0.4,
                // A new direction with every swing.
                turns: 0.21 * duration_s,
                still_point_m,
            };
            Ok(Box::new(move |size| Segment::Sphere(Sphere { amplitude_rad: size, ..sphere })))
        }
        Objective::Multisine => {
            let whole = hexapod::experiment::thesis_program(&task.equipment.geometry, 60.0);
            let terms: Vec<SineTerm> = whole
                .segments
                .into_iter()
                .find_map(|s| match s {
                    Segment::Multisine { terms, .. } => Some(terms),
                    _ => None,
                })
                .unwrap_or_default();
            Ok(Box::new(move |size| {
                let terms = terms.iter().map(|t| SineTerm { amplitude: size * t.amplitude, ..*t }).collect();
                Segment::Multisine { duration_s, ramp_s, terms }
            }))
        }
        Objective::DOptimal => {
            let problem = problem(task, frame, ramp_s);
            let found = problem.search(task.starts, 1, stop, |ended, best| {
                let best = if best.is_finite() { format!(", best log det {best:.2}") } else { String::new() };
                note(format!("{ended} of {} searches ended{best}", task.starts));
            });
            let [x, y, z] = frame.home().position_m;
            let best = found.into_iter().next().ok_or(PlanError::NoRoom { x, y, z })?;
            Ok(Box::new(move |size| problem.family.segment(&best.coefficients, size)))
        }
    }
}

/// Returns the load cell with what it may be loaded with.
fn instrument(task: &Task) -> Instrument {
    let Equipment { payload, noise_n_nm, wrench_range_n_nm, accel_range_mps2, .. } = &task.equipment;
    let rotation = payload.load_cell.rotation().unwrap_or_else(nalgebra::Matrix3::identity);
    Instrument::new(
        &Vector3::from(payload.load_cell.position_m),
        &rotation,
        payload.gravity_mps2,
        noise_n_nm,
        task.rate_hz * step_s(task.highest_hz),
    )
    .within(
        Some(task.equipment.may_be()),
        wrench_range_n_nm.map(|r| SENSOR_SHARE * r),
        SENSOR_SHARE * accel_range_mps2,
    )
}

/// Returns the search that a task asks for.
pub(super) fn problem(task: &Task, frame: &Frame, ramp_s: f64) -> Problem {
    let step = step_s(task.highest_hz);
    let instrument = instrument(task);
    let mut beforehand = Information::zeros();
    if let Ok(still) = frame.without_motion().trajectory() {
        for k in 0..(still.duration_s() / step) as usize {
            instrument.add(&still.state(k as f64 * step), 1.0, &mut beforehand);
        }
    }
    let family = match repetitions(task.highest_hz, frame.motion_s, ramp_s) {
        Some((period_s, again)) => {
            let once_s = frame.motion_s - again as f64 * period_s;
            let frequencies = PERIODS.map(|n| n / period_s);
            Family::new(&frame.home(), once_s, ramp_s, &frequencies, step).repeating(period_s, again, step)
        }
        None => Family::new(&frame.home(), frame.motion_s, ramp_s, &frequencies_hz(task.highest_hz), step),
    };
    Problem {
        family,
        barrier: Barrier::new(&task.equipment.geometry, task.rate_radps),
        instrument,
        beforehand,
        merit: Volume,
    }
}

/// Returns whether every limit is met where it is examined, every 20 ms of the motion.
fn seems_kept(
    task: &Task,
    instrument: &Instrument,
    trajectory: &Trajectory,
    load: &Load,
    span_s: [f64; 2],
) -> bool {
    let [from, to] = span_s;
    let geometry = &task.equipment.geometry;
    (0..((to - from) / 0.02) as usize).all(|k| {
        let state = trajectory.state(from + 0.02 * k as f64);
        state.angular_rate.norm() <= task.rate_radps
            && instrument.load_share(&state) <= 1.0
            && geometry.margins(&state, Some(load)).check().is_ok()
    })
}

/// Returns the largest size, up to that planned, at which every limit is guaranteed.
fn guaranteed(
    task: &Task,
    frame: &Frame,
    load: &Load,
    shape: &Shape,
) -> Result<(f64, MotionProgram, Guarantee), PlanError> {
    let geometry = &task.equipment.geometry;
    let span = [frame.begin_s, frame.begin_s + frame.motion_s];
    let instrument = instrument(task);
    let at = |size: f64| {
        let program = frame.around(shape(size));
        program.trajectory().ok().map(|trajectory| (program, trajectory))
    };
    let seems = |size: f64| {
        at(size).is_some_and(|(_, trajectory)| {
            let arm = geometry.arm.as_ref();
            seems_kept(task, &instrument, &trajectory, load, span)
                && arm.is_none_or(|arm| arm.check(&trajectory).is_ok())
        })
    };
    let mut size = 1.0;
    if !seems(size) {
        let (mut inside, mut outside) = (0.0, 1.0);
        for _ in 0..12 {
            size = 0.5 * (inside + outside);
            if seems(size) { inside = size } else { outside = size }
        }
        size = inside;
        if size == 0.0
            && let Some((_, trajectory)) = at(size)
        {
            let share = instrument.load_share(&trajectory.state(frame.begin_s)) * SENSOR_SHARE;
            if share > SENSOR_SHARE {
                return Err(PlanError::Sensors(100.0 * share));
            }
        }
    }
    let mut last = None;
    for _ in 0..12 {
        let Some((program, trajectory)) = at(size) else { break };
        let guarantee = geometry.guarantee(&trajectory, Some(load), task.rate_radps);
        if guarantee.is_kept() {
            return Ok((size, program, guarantee));
        }
        // The guarantee is a per cent above what is seen; what remains outside is taken off.
        let over = guarantee.peaks.iter().map(|p| p.bound / p.allowed).fold(1.0, f64::max);
        last = Some(guarantee);
        size *= if over.is_finite() { 0.999 - (over - 1.0).min(0.2) } else { 0.8 };
    }
    // What even a smaller motion oversteps is overstepped by the rest of the experiment.
    let Some(guarantee) = last else {
        let [x, y, z] = frame.home().position_m;
        return Err(PlanError::NoRoom { x, y, z });
    };
    match guarantee.violation(geometry) {
        Some((violation, time_s)) => Err(PlanError::Limit { violation, time_s }),
        None => {
            let rate =
                guarantee.peaks.iter().filter(|p| p.limit.is_none()).map(|p| p.seen).fold(0.0, f64::max);
            Err(PlanError::Rate(rate))
        }
    }
}

/// Highest frequency of the default experiment's multisine, Hz.
pub const HIGHEST_HZ: f64 = 2.35;

impl Task {
    /// Returns the default task: D-optimal, 60 s, the static step first, in the default multisine's band, 0.9
    /// of the gyro's range.
    pub fn new(equipment: Equipment) -> Self {
        Self {
            rate_radps: GYRO_SHARE * equipment.gyro_range_radps,
            equipment,
            objective: Objective::DOptimal,
            duration_s: 60.0,
            poses: true,
            highest_hz: HIGHEST_HZ,
            rate_hz: 1000.0,
            starts: 4,
        }
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
