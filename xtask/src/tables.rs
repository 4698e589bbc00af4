//! The verb `tables`: makes the tables of the documents anew.

use anyhow::Result;

use crate::places;
use crate::process;
use crate::setup;

/// Options of the program `rigident-tables`.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Names of tables, `--long`, `--write`, `--check`; `-- --help` explains them.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

/// Makes the named tables; puts them into their documents if told to.
pub fn make(names: &[&str], write: bool) -> Result<()> {
    let written = write.then_some("--write");
    run(&Options { arguments: names.iter().copied().chain(written).map(str::to_owned).collect() })
}

/// Runs the studies.
pub fn run(options: &Options) -> Result<()> {
    let mut command = process::cargo(places::root());
    command.args(["run", "--quiet", "--release", "--package", "rigident-tables", "--"]);
    let python = setup::python();
    if python.is_file() {
        command.env("RIGIDENT_PYTHON", python);
    }
    process::run(command.args(&options.arguments))
}
