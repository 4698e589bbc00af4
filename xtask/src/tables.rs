//! The verb `tables`: makes the tables of `docs/estimation.md` anew.

use anyhow::Result;

use crate::places;
use crate::process;

/// Which tables, and where they go.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Only these; all that do not take long, if none is named.
    names: Vec<String>,
    /// The ones that take minutes, too.
    #[arg(long)]
    long: bool,
    /// Put them into docs/estimation.md; tables that were not made stay as they are.
    #[arg(long)]
    write: bool,
    /// Change nothing: see whether the document has a place for every table and no other, and whether those named are
    /// what this command makes.
    #[arg(long)]
    check: bool,
}

/// Runs the studies, an example of the host's crate.
pub fn run(options: &Options) -> Result<()> {
    let mut command = process::cargo(places::root());
    command.args(["run", "--quiet", "--package", "rigident", "--example", "estimation_tables", "--"]);
    command.args(&options.names);
    let flags = [("--long", options.long), ("--write", options.write), ("--check", options.check)];
    command.args(flags.into_iter().filter(|(_, given)| *given).map(|(flag, _)| flag));
    process::run(&mut command)
}
