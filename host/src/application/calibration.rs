//! The calibration of a rig that a job is given.

use std::path::Path;

use super::Error;
use rigident_io::rig::{RigCalibration, RigFile};

/// Takes a calibration file for a rig, if one is given.
///
/// # Errors
/// [`Error::Calibration`] if it cannot be read, or is of another rig.
pub fn calibrate(rig: &mut RigFile, file: Option<&Path>) -> Result<(), Error> {
    let Some(file) = file else { return Ok(()) };
    Ok(rig.calibrate(RigCalibration::load(file)?)?)
}

/// Refuses a calibration of the rig where a tree is identified.
pub(super) fn refuse_for_trees(file: Option<&Path>) -> Result<(), Error> {
    file.map_or(Ok(()), |_| Err(Error::CalibrationOfTree))
}
