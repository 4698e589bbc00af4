use std::path::PathBuf;

use clap::Args;

/// Options of every command that gives an answer.
#[derive(Args, Debug, Clone, Default)]
pub struct Output {
    /// Print the result object on standard output, and nothing else there
    #[arg(long)]
    pub json: bool,
    /// Folder for the files; must be new or empty. Default: a new folder here
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// What must be identified for exit status 0: any of m, mc, I, offset, or single names as Ixx; of several
    /// links their names, or single parameters as arm.MSx
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub estimate: Vec<String>,
    /// Write a certificate to print (A4) to this new file: part, equipment, results with k = 2, what they
    /// rest on. What [certificate] of the rig file does not state is listed, or asked for
    #[arg(long, value_name = "FILE.html")]
    pub certificate: Option<PathBuf>,
    /// State a key of [certificate], as number=2026-117; may be given several times
    #[arg(long, value_name = "KEY=VALUE", requires = "certificate")]
    pub certify: Vec<String>,
    /// The files that the answer rests on; those of the folder of its own where there are none.
    #[arg(skip)]
    pub evidence: Vec<PathBuf>,
}
