//! The verb `tables`: makes the tables of the documents anew.

use std::process::Command;

use anyhow::Result;

use crate::places;
use crate::process;
use crate::setup;

const PROGRAM: &str = "rigident-tables";

/// Options of the program `rigident-tables`.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Names of tables, `--long`, `--write`, `--check`; `-- --help` explains them.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

/// Makes the named tables; puts them into their documents on request.
pub fn make(names: &[&str], write: bool) -> Result<()> {
    let written = write.then_some("--write");
    run(&Options { arguments: names.iter().copied().chain(written).map(str::to_owned).collect() })
}

/// Builds the program of the studies and returns a command that runs it.
pub fn program() -> Result<Command> {
    let mut build = process::cargo(places::root());
    // Of the whole workspace: by itself the host's crate would have other features than in tests, and be
    // compiled again.
    build.args(["build", "--quiet", "--workspace", "--exclude", "xtask", "--bin", PROGRAM]);
    process::run(&mut build)?;
    Ok(process::command(places::built(PROGRAM), places::root()))
}

/// Runs the studies.
pub fn run(options: &Options) -> Result<()> {
    let mut command = program()?;
    let python = setup::python();
    if python.is_file() {
        command.env("RIGIDENT_PYTHON", python);
    }
    process::run(command.args(&options.arguments))
}
