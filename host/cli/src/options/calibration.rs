use std::path::{Path, PathBuf};

use clap::Args;

use crate::Failure;
use rigident_io::rig::{RigCalibration, RigFile};

/// The option `--calibration`.
#[derive(Args, Debug, Clone, Default)]
pub struct CalibrationOption {
    /// Calibration of the rig, by `rigident calibrate rig`: its errors with their correlations in place of what data sheets say.
    /// Default: [calibration] of the rig file
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
}

/// Takes a calibration file for a rig, if one is given.
///
/// # Errors
/// Bad input: it cannot be read, or is of another rig.
pub(crate) fn take(rig: &mut RigFile, file: Option<&Path>) -> Result<(), Failure> {
    let Some(file) = file else { return Ok(()) };
    let calibration = RigCalibration::load(file).map_err(Failure::input)?;
    rig.calibrate(calibration).map_err(Failure::input)
}

/// Refuses a calibration of the rig where a tree is identified.
///
/// # Errors
/// Bad input.
pub(crate) fn refuse_for_trees(file: Option<&Path>) -> Result<(), Failure> {
    match file {
        None => Ok(()),
        Some(_) => {
            Err(Failure::input("--calibration is for one body, and this is a tree of links: leave it out"))
        }
    }
}
