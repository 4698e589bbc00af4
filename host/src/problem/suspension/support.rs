//! What carries the platform, and what a recording of its swinging must have.

use nalgebra::{Matrix6, Vector6};

use super::SuspensionError;
use super::mount::Mount;
use super::springs::{Springs, free};
use rigident_io::recording::Recording;
use rigident_io::rig::{RigFile, SuspensionTable};

/// Holds the springs that everything swings on.
#[derive(Clone, Debug)]
pub struct Support {
    /// The springs.
    pub springs: Springs,
    /// Where S is in P.
    pub mount: Mount,
    /// Height above O at which the springs carry the weight, m.
    pub anchor_height_m: f64,
    /// Coordinates that are not locked, by their numbers.
    pub free: Vec<usize>,
    /// Gravity, m/s².
    pub gravity_mps2: f64,
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
            anchor_height_m: table.anchor_height_m.unwrap_or_else(|| anchors_height(table)),
            free: free(&table.locked),
            gravity_mps2: rig.recording.gravity_mps2,
        })
    }

    /// Returns the height at which the weight is carried, m; a guide that locks z carries it through O.
    pub(super) fn weight_height_m(&self) -> f64 {
        if self.free.contains(&2) { self.anchor_height_m } else { 0.0 }
    }

    /// Returns what the weight of ten parameters about O adds to the stiffness: `g (h m − ms_z)` on roll and pitch.
    pub(super) fn weight_stiffness(&self, mass_kg: f64, ms_z: f64) -> Matrix6<f64> {
        let lever = self.gravity_mps2 * (self.weight_height_m() * mass_kg - ms_z);
        Matrix6::from_diagonal(&Vector6::new(0.0, 0.0, 0.0, lever, lever, 0.0))
    }
}

/// Mean height of the springs' places above O, weighed by their stiffness along z as they share the weight; zero of a matrix.
fn anchors_height(table: &SuspensionTable) -> f64 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for spring in &table.spring {
        let along: f64 = spring.axis.iter().map(|v| v * v).sum();
        let share = if along > 0.0 { spring.axis[2].powi(2) / along } else { 0.0 };
        let own = spring.axial_npm * share + spring.lateral_npm * (1.0 - share);
        sum += own * (spring.at_m[2] - table.at_m[2]);
        weight += own;
    }
    if weight > 0.0 { sum / weight } else { 0.0 }
}

/// What is missing, with its verb, and what to do.
pub(super) fn missing(name: &str, missing: &str, advice: &str) -> SuspensionError {
    SuspensionError::Missing { name: name.to_owned(), missing: missing.to_owned(), advice: advice.to_owned() }
}

/// Samples per second.
pub(super) fn constant_rate_hz(recording: &Recording) -> Result<f64, SuspensionError> {
    recording.rate_hz.ok_or_else(|| {
        missing(
            &recording.name,
            "a constant rate is",
            "free vibration is a motion in time: t_s must increase by equal steps, and static be false",
        )
    })
}
