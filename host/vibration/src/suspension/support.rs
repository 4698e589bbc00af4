//! The support of the platform, and the data that a recording of its swinging must have.

use nalgebra::{Matrix6, Vector3, Vector6};

use super::SuspensionError;
use super::geometry::{Geometry, air, air_nuisance};
use super::mount::Mount;
use super::preload::Preload;
use super::rests::{StatedRest, stated};
use super::springs::{Displacement, Springs, free};
use rigident_fit::Nuisance;
use rigident_io::recording::Recording;
use rigident_io::rig::{RigFile, SpringTable, SuspensionTable};

/// 1 σ of the force of springs 10 mm from the rest of a recording, relative, where none is stated: springs
/// that stiffen by a few hundredths, axes that turn as the platform sags.
const STATIC_STD: f64 = 0.01;
/// 1 σ of the force of springs at any distance, relative: hysteresis.
const LEAST_STATIC_STD: f64 = 2e-3;
/// Distance of springs from O where a matrix alone is stated, m.
const REACH_M: f64 = 0.5;

/// Holds the springs that everything swings on.
#[derive(Clone, Debug)]
pub struct Support {
    /// The springs.
    pub springs: Springs,
    /// The place of S in P.
    pub mount: Mount,
    /// The load of the springs at rest.
    pub preload: Preload,
    /// The errors of places, axes and lengths.
    pub geometry: Geometry,
    /// The mass matrix about O of the air that may move with the platform.
    pub air: Option<Matrix6<f64>>,
    /// Coordinates that are not locked, by their numbers.
    pub free: Vec<usize>,
    /// Gravity, m/s².
    pub gravity_mps2: f64,
    /// The point O in P, m.
    pub at_m: [f64; 3],
    /// 1 σ of forces of springs at another rest, relative, for each metre of its distance.
    pub(super) static_std_by_m: f64,
    /// Distance of the farthest spring from O, m.
    pub(super) reach_m: f64,
    /// Stated rests with other loads.
    pub rests: Vec<StatedRest>,
}

impl Support {
    /// Returns what a rig file says of springs and mount; `name` is the recording's.
    ///
    /// # Errors
    /// [`SuspensionError::Missing`] if it has no `[suspension]`.
    pub fn of(rig: &RigFile, name: &str) -> Result<Self, SuspensionError> {
        let table = rig.suspension.as_ref().ok_or_else(|| {
            missing(name, "the table [suspension] of the rig file is", "it says what the springs are")
        })?;
        Ok(Self {
            springs: Springs::new(table),
            mount: Mount::of(table),
            preload: Preload::new(table, rig.recording.gravity_mps2),
            geometry: Geometry::new(table, rig.recording.gravity_mps2),
            air: air(table),
            free: free(&table.locked),
            gravity_mps2: rig.recording.gravity_mps2,
            at_m: table.at_m,
            static_std_by_m: table.static_std.unwrap_or(STATIC_STD) / 0.01,
            reach_m: reach_m(table),
            rests: stated(table),
        })
    }

    /// Returns what is not known of the stiffness and the mass that modes have: of the springs, what they
    /// carry, and the air.
    pub fn modal_nuisances(&self) -> Vec<Nuisance> {
        self.with_others(self.springs.stiffness_nuisances())
    }

    /// Returns the same of a motion, the errors of the damping first.
    pub fn motion_nuisances(&self) -> Vec<Nuisance> {
        self.with_others(self.springs.nuisances().to_vec())
    }

    fn with_others(&self, springs: Vec<Nuisance>) -> Vec<Nuisance> {
        let mut all = springs;
        all.extend(self.preload.nuisances(all.len()));
        all.extend(self.geometry.nuisances(all.len()));
        all.extend(self.air.map(|_| air_nuisance(all.len())));
        all
    }

    /// Returns 1 σ of the forces of springs at a displacement from the rest of a recording, relative.
    pub(super) fn static_std(&self, displacement: &Vector6<f64>) -> f64 {
        let distance_m =
            displacement.fixed_rows::<3>(0).norm() + displacement.fixed_rows::<3>(3).norm() * self.reach_m;
        (self.static_std_by_m * distance_m).max(LEAST_STATIC_STD)
    }

    /// Returns what a unit of each of [`Support::modal_nuisances`] changes, under ten parameters about O.
    pub fn modal_changes(&self, ten: &[f64; 10]) -> Vec<Change> {
        let stiffness = |stiffness: Matrix6<f64>| Change { stiffness, mass: Matrix6::zeros() };
        let mut all: Vec<Change> = self.springs.error_stiffnesses().into_iter().map(stiffness).collect();
        all.extend(self.preload.has_unknown_ends.then(|| stiffness(self.preload.error_stiffness(ten))));
        all.extend(self.geometry.stiffnesses(ten).into_iter().map(stiffness));
        all.extend(self.air.map(|mass| Change { stiffness: Matrix6::zeros(), mass }));
        all
    }

    /// Returns what a unit of each of [`Support::motion_nuisances`] but the air's adds to the wrench on the
    /// platform about O, under loads of the springs: stated preload, W (N), Mx and My (N m).
    pub fn wrench_errors(&self, at: &Displacement, loads: &[f64; 4]) -> Vec<Vector6<f64>> {
        let mut all = self.springs.error_wrenches(at);
        all.extend(self.preload.has_unknown_ends.then(|| self.preload.error_wrench(at, loads)));
        all.extend(self.geometry.wrenches(at, loads));
        all
    }
}

/// Returns the distance of the farthest spring from O, m.
fn reach_m(table: &SuspensionTable) -> f64 {
    let of = |own: &SpringTable| (Vector3::from(own.at_m) - Vector3::from(table.at_m)).norm();
    table.spring.iter().map(of).max_by(f64::total_cmp).unwrap_or(REACH_M)
}

/// The change of the equations of free vibration about O by an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Stiffness: N/m, N, N m.
    pub stiffness: Matrix6<f64>,
    /// Mass: kg, kg m, kg m².
    pub mass: Matrix6<f64>,
}

/// Returns what is missing, with its verb, and what to do.
pub(super) fn missing(name: &str, missing: &str, advice: &str) -> SuspensionError {
    SuspensionError::Missing { name: name.to_owned(), missing: missing.to_owned(), advice: advice.to_owned() }
}

/// Returns the samples per second.
pub(super) fn constant_rate_hz(recording: &Recording) -> Result<f64, SuspensionError> {
    recording.rate_hz.ok_or_else(|| {
        missing(
            &recording.name,
            "a constant rate is",
            "free vibration is a motion in time: t_s must increase by equal steps, and static be false",
        )
    })
}
