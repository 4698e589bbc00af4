use std::path::PathBuf;

use clap::Args;

use crate::options::calibration::CalibrationOption;
use crate::options::known_values::KnownQuantities;
use crate::options::output::Output;
use crate::options::trees::TreeModel;
use rigident_io::rig::labels;

/// The option `--tare`.
#[derive(Args, Debug, Clone, Default)]
pub struct TareFiles {
    /// Runs with the bare fixture on the same sensor, recordings (of several files the rig file that lists
    /// them) or factors: it is subtracted with its uncertainty
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub tare: Vec<PathBuf>,
}

/// `rigident factor`
#[derive(Args, Debug, Clone)]
#[command(after_help = "Each recording's wrench offset is its own (they drift from run to run) unless \
                  --shared-offset is given.\n\n\
                  Examples:\n  rigident factor bracket.csv -o bracket.factor\n  rigident factor run1.mcap \
                  run2.mcap run3.mcap --rig bracket.rig.toml -o bracket.factor")]
pub struct MakeFactor {
    /// The recordings, CSV or MCAP; of several files with clocks of their own the rig file that lists them,
    /// or their folder
    #[arg(required = true, value_name = "REC")]
    pub recordings: Vec<PathBuf>,
    /// The file to write; must not exist
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Rig file of all recordings. Default: NAME.rig.toml beside each
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub calibration: CalibrationOption,
    /// A label of the recordings, KEY=VALUE, beside those of their rig files: `rigident merge --by` goes by
    /// them
    #[arg(long, value_name = "LABEL", value_parser = labels::parse)]
    pub label: Vec<(String, String)>,
    /// All recordings have one wrench offset between them
    #[arg(long)]
    pub shared_offset: bool,
    /// Also recordings that disagree more than ten times as much as their noise explains
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub tree: TreeModel,
}

/// `rigident merge`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "The order does not matter, and a factor whose recordings are all in others is left out and \
                  counted, so that a part of the work may be done again. Factors that have some recordings \
                  in common, of other models or units, and of other bodies are refused.\n\n\
                  Examples:\n  rigident merge monday.factor tuesday.factor -o bracket.factor\n  rigident \
                  merge a.factor b.factor --shared-offset -o both.factor\n  find runs -name '*.factor' | \
                  rigident merge --from - -o all.factor\n  rigident merge --from list.txt --by body,rig -o \
                  bodies"
)]
pub struct Merge {
    /// The factors
    #[arg(required_unless_present = "from", value_name = "F")]
    pub factors: Vec<PathBuf>,
    /// A text with the paths of more factors, one a line, relative to the working directory; `-`: standard
    /// input
    #[arg(long, value_name = "LIST")]
    pub from: Option<PathBuf>,
    /// One factor for each combination of the values of these labels, comma separated
    #[arg(long, value_name = "KEY", value_delimiter = ',')]
    pub by: Vec<String>,
    /// The file to write; must not exist. With --by a folder, new or empty
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// All of them have one wrench offset between them
    #[arg(long)]
    pub shared_offset: bool,
    /// Also factors that disagree more than ten times as much as their noise explains
    #[arg(long)]
    pub force: bool,
}

/// `rigident solve`
#[derive(Args, Debug, Clone)]
#[command(after_help = "What needs the data themselves (residuals over time, convergence) is not in the \
                  answer.\n\nExamples:\n  rigident solve bracket.factor\n  rigident solve total.factor \
                  --tare fixture.factor --rig bracket.rig.toml --json")]
pub struct Solve {
    /// The factor
    #[arg(value_name = "F")]
    pub factor: PathBuf,
    /// Rig file: its [body] and [truth]; and what recordings of a tare were taken with
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Take the bare platform off, which [suspension.platform] of the rig file states: runs on springs have
    /// it on
    #[arg(long, requires = "rig", conflicts_with = "tare")]
    pub without_platform: bool,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub tare: TareFiles,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub known: KnownQuantities,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub output: Output,
}
