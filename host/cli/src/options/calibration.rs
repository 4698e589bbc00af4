use std::path::PathBuf;

use clap::Args;

/// The option `--calibration`.
#[derive(Args, Debug, Clone, Default)]
pub struct CalibrationOption {
    /// Calibration of the rig, by `rigident calibrate rig`: its errors with their correlations in place of
    /// what data sheets say. Default: [calibration] of the rig file
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
}
