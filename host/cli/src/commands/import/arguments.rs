use std::path::PathBuf;

use clap::Args;

/// `rigident convert`
#[derive(Args, Debug, Clone)]
#[command(
    after_help = "Examples:\n  rigident convert bracket.csv bracket.mcap\n  rigident convert bracket.mcap \
                  bracket.csv"
)]
pub struct Convert {
    /// The recording to read
    pub input: PathBuf,
    /// The recording to write; must not exist
    pub output: PathBuf,
    /// Rig file. Default: NAME.rig.toml beside the recording
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
}

/// `rigident import`
#[derive(Args, Debug, Clone)]
#[command(after_help = "Examples:\n  rigident import Messung_01.csv\n  rigident import log.csv --column \
                  t_s=Zeit:ms --unit Fx=kgf --sign on-sensor\n  rigident import force.lvm imu.csv --to \
                  run.rig.toml\n  rigident import log.csv --look")]
pub struct Import {
    /// Files of text, Parquet or MAT; several are one recording, each with its own clock. With --look
    /// also the rig file that lists them, to see how their clocks fit
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// The rig file to write; must not exist. Default: NAME.rig.toml beside a single file
    #[arg(long, value_name = "RIG")]
    pub to: Option<PathBuf>,
    /// Where a column is: t_s=NAME, or with its unit fx_n=NAME:kgf
    #[arg(long, value_name = "COLUMN=NAME[:UNIT]")]
    pub column: Vec<String>,
    /// The unit of a column that the file does not say
    #[arg(long, value_name = "NAME=UNIT")]
    pub unit: Vec<String>,
    /// Whose sign the wrench has: of the sensor on the body, or the reaction
    #[arg(long, value_enum)]
    pub sign: Option<Sign>,
    /// The mark before the decimals, where the numbers do not show it
    #[arg(long, value_enum)]
    pub decimal: Option<Decimal>,
    /// Write and ask nothing: print as an object what is understood, what is missing, and how the recording
    /// moves
    #[arg(long, conflicts_with = "to")]
    pub look: bool,
    /// Ask nothing
    #[arg(long)]
    pub yes: bool,
    /// Print an object instead of words
    #[arg(long)]
    pub json: bool,
}

/// Whose sign a wrench has.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Of the sensor on the body
    OnBody,
    /// The reaction, of the body on the sensor
    OnSensor,
}

/// Mark before the decimals.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decimal {
    /// 1.5
    Point,
    /// 1,5
    Comma,
}
