//! The support of the platform, and the data that a recording of its swinging must have.

use nalgebra::Matrix6;

use super::SuspensionError;
use super::mount::Mount;
use super::preload::Preload;
use super::springs::{Springs, free};
use rigident_fit::Nuisance;
use rigident_io::recording::Recording;
use rigident_io::rig::RigFile;

/// Holds the springs that everything swings on.
#[derive(Clone, Debug)]
pub struct Support {
    /// The springs.
    pub springs: Springs,
    /// The place of S in P.
    pub mount: Mount,
    /// The load of the springs at rest.
    pub preload: Preload,
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
            preload: Preload::new(table, rig.recording.gravity_mps2),
            free: free(&table.locked),
            gravity_mps2: rig.recording.gravity_mps2,
        })
    }

    /// Returns what is not known of the stiffness that modes have: of the springs' and of what they carry.
    pub fn stiffness_nuisances(&self) -> Vec<Nuisance> {
        let mut all = self.springs.stiffness_nuisances();
        all.extend(self.preload.nuisances(all.len()));
        all
    }

    /// Returns what a unit of each of these changes in the stiffness about O under ten parameters about O.
    pub fn error_stiffnesses(&self, ten: &[f64; 10]) -> Vec<Matrix6<f64>> {
        let mut all = self.springs.error_stiffnesses();
        all.extend(self.preload.nuisances(0).iter().map(|_| self.preload.error_stiffness(ten)));
        all
    }
}

/// Returns what is missing, with its verb, and what to do.
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
