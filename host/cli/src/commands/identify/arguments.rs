use std::path::PathBuf;

use clap::Args;

use crate::commands::factor::arguments::TareFiles;
use crate::options::calibration::CalibrationOption;
use crate::options::forgetting::Forgetting;
use crate::options::known_values::KnownQuantities;
use crate::options::output::Output;
use crate::options::payload::PayloadOptions;
use crate::options::trees::TreeOptions;

/// `rigident identify`
#[derive(Args, Debug, Clone)]
#[command(after_help = "Examples:\n  rigident identify bracket.csv\n  rigident identify poses.csv --rig \
                        poses.rig.toml --estimate m,mc,offset --json\n  rigident identify bracket.csv --tare \
                        fixture.csv\n  rigident identify bracket.csv --known mass_kg=20.013±0.005 --symmetry \
                        y±0.002\n  rigident identify turn.rig.toml\n  rigident identify recordings/ --rig \
                        turn.rig.toml\n  rigident identify tank.mcap --forget 30\n\nTrees of links:\n  \
                        rigident identify two_links.csv\n  rigident identify arm.csv --model arm.urdf \
                        --friction viscous,coulomb,offset --write-model identified.urdf\n  rigident identify \
                        walk.csv --model human34 --height-m 1.65 --mass-kg 60 --symmetric-sides")]
pub struct Identify {
    /// The recording, CSV or MCAP; of several files with clocks of their own the rig file that lists them, or
    /// their folder
    pub recording: PathBuf,
    /// Rig file. Default: NAME.rig.toml beside the recording
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub calibration: CalibrationOption,
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
    pub tree: TreeOptions,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub payload: PayloadOptions,
}
