//! A plan of still poses: the search's result as poses of the plate.

use std::sync::atomic::AtomicBool;

use hexapod::{Pose, THESIS_WRENCH_NOISE_N_NM};
use nalgebra::{Matrix3, Vector3};

use super::estimators::{StillReading, modelled};
use super::measure::{
    Objective, condition_number, fewest_orientations, normal_matrix, relative_normal_matrix, roll_pitch,
    up_in_plate,
};
use super::reach::RegionError;
use super::reach::{Reach, tilted};
use super::region::Region;
use super::search::Search;

/// More than anyone holds still; the search's sequence spreads less and less well.
pub const MOST_ORIENTATIONS: usize = 30;
/// Angles are given to this many parts of a degree.
const PARTS_OF_A_DEGREE: f64 = 100.0;

/// The reason why there is no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// There are too few orientations, or too many.
    #[error(
        "`n` {n}: {fewest} orientations at least (fewer leave a part of the centre of mass open), \
         {MOST_ORIENTATIONS} at most"
    )]
    Orientations {
        /// Asked for.
        n: usize,
        /// The fewest orientations.
        fewest: usize,
    },
    /// An angle that no plate has.
    #[error("roll and pitch of {0:?}°: numbers from -180 to 180")]
    Angles([f64; 2]),
    /// The platform.
    #[error(transparent)]
    Region(#[from] RegionError),
    /// No set of orientations determines anything, or none can be held.
    #[error(
        "the platform tilts by {0:.2}° at most: no {1} orientations differ enough to determine the centre of mass"
    )]
    NoneFound(f64, usize),
}

/// The task of the plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Number of orientations.
    pub n: usize,
    /// The objective.
    pub objective: Objective,
    /// Noise of the load cell, 1 σ of a reading, N, N m, for the prediction.
    pub noise_n_nm: [f64; 6],
    /// Plate's axes to load cell's axes.
    pub plate_to_cell: Matrix3<f64>,
    /// m/s².
    pub gravity_mps2: f64,
}

impl Task {
    /// Returns the task of the least condition number, on the thesis' rig.
    pub fn thesis(n: usize) -> Self {
        Self {
            n,
            objective: Objective::Condition,
            noise_n_nm: THESIS_WRENCH_NOISE_N_NM,
            plate_to_cell: Matrix3::identity(),
            gravity_mps2: 9.80665,
        }
    }
}

/// Still poses and what they are worth.
#[derive(Clone, Debug, PartialEq)]
pub struct PosePlan {
    /// The poses by azimuth of the tilt; roll and pitch are rounded to hundredths of a degree.
    pub poses: Vec<Pose>,
    /// Condition number of the normal matrix `[F]ᵀ[F]`.
    pub condition_number_normal: f64,
    /// Condition number of the normal matrix of the forces less those of the level pose; infinite if they
    /// leave something open.
    pub relative_condition_number_normal: f64,
    /// Determinant of the normal matrix of unit forces, at most `(2n/3)³`.
    pub determinant: f64,
    /// Cost of the best combination of the sequence, before its refinement.
    pub screened_cost: f64,
    /// Predicted 95 % uncertainty of mass, kg, and first moment, kg m, in the load cell's axes, from one
    /// reading in each pose with the offsets unknown; `None` if they leave something open.
    pub predicted_u95: Option<[f64; 4]>,
}

impl PosePlan {
    /// Returns roll and pitch of the poses, degrees.
    pub fn poses_deg(&self) -> Vec<[f64; 2]> {
        let hundredths = |angle: f64| (angle.to_degrees() * PARTS_OF_A_DEGREE).round() / PARTS_OF_A_DEGREE;
        self.poses
            .iter()
            .map(|Pose { rpy_rad: [roll, pitch, _], .. }| [hundredths(*roll), hundredths(*pitch)])
            .collect()
    }
}

/// Checks a number of orientations.
///
/// # Errors
/// One that is too small or too large.
pub fn check_n(n: usize, objective: &Objective) -> Result<(), PlanError> {
    let fewest = fewest_orientations(objective);
    if (fewest..=MOST_ORIENTATIONS).contains(&n) {
        Ok(())
    } else {
        Err(PlanError::Orientations { n, fewest })
    }
}

/// Returns the best still poses of a platform; see [`Search::run`].
///
/// # Errors
/// A number of orientations that makes no sense, or a platform that cannot tilt.
pub fn plan(
    reach: &Reach,
    region: &Region,
    task: &Task,
    stop: &AtomicBool,
    progress: impl FnMut(&str),
) -> Result<PosePlan, PlanError> {
    check_n(task.n, &task.objective)?;
    let none = || PlanError::NoneFound(region.tilt_range_rad().1.to_degrees(), task.n);
    let search = Search { region, n: task.n, objective: task.objective };
    let found = search.run(stop, progress).ok_or_else(none)?;
    let poses: Option<Vec<Pose>> = found.ups.iter().map(|up| held(reach, up)).collect();
    let poses = poses.ok_or_else(none)?;
    let ups: Vec<_> = poses.iter().map(|p| up_in_plate([p.rpy_rad[0], p.rpy_rad[1]])).collect();
    Ok(PosePlan { screened_cost: found.screened, ..worth(poses, &ups, task) })
}

/// Returns what poses of these rolls and pitches, rad, are worth, and which of them the platform can hold:
/// the others are where they would be at the height of the level pose.
///
/// # Errors
/// A number of orientations that makes no sense, or an angle that is no number or beyond a half turn.
pub fn of_angles(
    reach: &Reach,
    angles_rad: &[[f64; 2]],
    task: &Task,
) -> Result<(PosePlan, Vec<bool>), PlanError> {
    check_n(angles_rad.len(), &task.objective)?;
    let within = |angle: &f64| angle.abs() <= std::f64::consts::PI;
    if let Some(angles) = angles_rad.iter().find(|angles| !angles.iter().all(within)) {
        return Err(PlanError::Angles(angles.map(f64::to_degrees)));
    }
    let ups: Vec<_> = angles_rad.iter().map(|angles| up_in_plate(*angles)).collect();
    let (poses, held) = angles_rad
        .iter()
        .zip(&ups)
        .map(|([roll, pitch], up)| {
            let held = reach.pose(up);
            let position_m = held.unwrap_or(reach.level()).position_m;
            (Pose { position_m, rpy_rad: [*roll, *pitch, 0.0] }, held.is_some())
        })
        .unzip();
    Ok((worth(poses, &ups, task), held))
}

fn worth(poses: Vec<Pose>, ups: &[Vector3<f64>], task: &Task) -> PosePlan {
    let normal = normal_matrix(ups.iter().copied());
    PosePlan {
        condition_number_normal: condition_number(&normal),
        relative_condition_number_normal: condition_number(&relative_normal_matrix(ups, &Vector3::z())),
        determinant: normal.determinant(),
        screened_cost: task.objective.cost(ups),
        predicted_u95: predicted(ups, task),
        poses,
    }
}

/// Returns the orientation rounded to what is printed, and towards the level pose until it can be held: the
/// border is a line between the azimuths at which it was searched for.
pub(super) fn held(reach: &Reach, up: &Vector3<f64>) -> Option<Pose> {
    let tilt = up.z.clamp(-1.0, 1.0).acos();
    (0..100).find_map(|hundredths| {
        let less = (tilt - (f64::from(hundredths) / PARTS_OF_A_DEGREE).to_radians()).max(0.0);
        let angles = roll_pitch(&tilted(up, less));
        let rounded =
            angles.map(|a| ((a.to_degrees() * PARTS_OF_A_DEGREE).round() / PARTS_OF_A_DEGREE).to_radians());
        reach.pose(&up_in_plate(rounded))
    })
}

fn predicted(ups: &[Vector3<f64>], task: &Task) -> Option<[f64; 4]> {
    let nothing = Vector3::zeros();
    let readings: Vec<_> = ups
        .iter()
        .map(|up| StillReading {
            specific_force: task.plate_to_cell * up * task.gravity_mps2,
            force: nothing,
            moment: nothing,
        })
        .collect();
    let factor = modelled(&readings, &task.noise_n_nm, None);
    let sd = factor.standard_deviations();
    factor.well_determined(&sd)?;
    let [m, x, y, z, ..] = sd;
    Some([m, x, y, z].map(|sd| 1.96 * sd))
}
