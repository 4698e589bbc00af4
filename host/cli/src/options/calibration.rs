use std::path::{Path, PathBuf};

use clap::Args;

use crate::Failure;
use rigident::application::Error;

/// The option `--calibration`.
#[derive(Args, Debug, Clone, Default)]
pub struct CalibrationOption {
    /// Calibration of the rig, by `rigident calibrate rig`: its errors with their correlations in place of
    /// what data sheets say. Default: [calibration] of the rig file
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
}

/// Refuses a calibration of the rig where a tree is identified.
///
/// # Errors
/// Bad input.
pub(crate) fn refuse_for_trees(file: Option<&Path>) -> Result<(), Failure> {
    file.map_or(Ok(()), |_| Err(Error::CalibrationOfTree.into()))
}
