use std::path::PathBuf;

use clap::Args;

use crate::options::trees::TreeModel;

/// `rigident predict`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The model is a result.json of `rigident identify`, or a robot description: URDF, MJCF, \
                  SDF. A result of a tree needs the description that it was identified with, too: --model \
                  FILE. What is not identified has the value that fits best beside the nominal model; \
                  without a nominal model it counts as zero and is named.\n\nWhere the recording has no \
                  efforts they are predicted from its motion. With --out a folder with prediction.csv and a \
                  page.\n\nExit status 0, 2 if something cannot be read or does not fit.\n\nExamples:\n  \
                  rigident predict identify/result.json planned.csv --model arm.urdf --out prediction\n  \
                  rigident predict identified.urdf planned.csv --json"
)]
pub struct Predict {
    /// result.json, or a robot description
    #[arg(value_name = "MODEL")]
    pub given: PathBuf,
    /// The recording, CSV or MCAP
    pub recording: PathBuf,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub how: Predicting,
}

/// `rigident summary`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Of every quantity: mean of the runs, its 95 % uncertainty by the scatter alone, the \
                  standard deviation between runs beside the standard uncertainty that the runs state, and \
                  the probability of so much scatter if that holds. What all runs have in common, such as an \
                  error of mounting, does not scatter. Results whose numbers are not to be used are left \
                  out.\n\nExit status 1 if the runs scatter more than they state, or fewer than two are \
                  left.\n\nExamples:\n  rigident summary day1 day2 day3\n  rigident summary run*/result.json \
                  --json"
)]
pub struct Summary {
    /// Results of runs of one body: result.json, or folders with one
    #[arg(required = true, num_args = 2.., value_name = "RESULT")]
    pub results: Vec<PathBuf>,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// `rigident validate`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Compares what models predict of a recording with what was measured, channel by channel: \
                  root mean square of what is left, and that over the standard deviation of what was \
                  measured (NRMSE), both behind the filter of 0.1 s. The nominal model of --model is shown \
                  beside it, and plain least squares on --train, the recording that the results are \
                  of.\n\nExit status 0, 2 if something cannot be read or does not fit.\n\nExamples:\n  \
                  rigident validate identify/result.json other.csv --model arm.urdf --train first.csv\n  \
                  rigident validate a/result.json b/result.json other.csv --model arm.urdf --json\n  \
                  rigident validate identify/result.json bracket2.csv"
)]
pub struct Validate {
    /// One or several of result.json and robot descriptions, then the recording
    #[arg(required = true, num_args = 2.., value_names = ["MODEL", "RECORDING"])]
    pub files: Vec<PathBuf>,
    /// The recording that the results are of: plain least squares on it are compared, too
    #[arg(long, value_name = "RECORDING")]
    pub train: Option<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub how: Predicting,
}

/// What both commands take.
#[derive(Args, Debug, Clone)]
pub struct Predicting {
    /// Rig file. Default: NAME.rig.toml beside the recording
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Print one object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
    /// Folder for prediction.csv and a page; must be new or empty
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub tree: TreeModel,
}
