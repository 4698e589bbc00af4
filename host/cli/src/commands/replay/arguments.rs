use std::path::PathBuf;

use clap::Args;

use crate::commands::factor::arguments::TareFiles;
use crate::options::calibration::CalibrationOption;
use crate::options::forgetting::Forgetting;
use crate::options::known_values::KnownQuantities;
use crate::options::output::Output;
use crate::options::stop_criterion::StopCriterion;
use crate::options::trees::TreeModel;

/// `rigident replay`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Examples:\n  rigident replay bracket.mcap --mcu inproc\n  rigident replay poses.csv --rig \
                        poses.rig.toml --mcu qemu\n  rigident replay bracket.csv --mcu \
                        /dev/ttyACM0\n\nSeveral links:\n  rigident replay two_links.mcap --mcu qemu\n  \
                        rigident replay walk.csv --model human34 --height-m 1.65 --mass-kg 60"
)]
pub struct Replay {
    /// The recording, CSV or MCAP
    pub recording: PathBuf,
    /// inproc, qemu, or the port of a device
    #[arg(long, default_value = "inproc", value_name = "inproc|qemu|PORT")]
    pub mcu: String,
    /// Rig file. Default: NAME.rig.toml beside the recording
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub calibration: CalibrationOption,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub stop: StopCriterion,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub forgetting: Forgetting,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub tare: TareFiles,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub known: KnownQuantities,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub output: Output,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub tree: TreeModel,
}
