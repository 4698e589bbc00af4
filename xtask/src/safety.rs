//! The verb `safety`: has things go wrong while a platform is driven, on the simulated rig.

use anyhow::Result;

use crate::places;
use crate::process;
use crate::tables;

/// What becomes of the table.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Put the table into docs/platform.md.
    #[arg(long)]
    write: bool,
}

/// Builds the program that is to be disturbed, and disturbs it; fails if the plate is not at rest in time.
pub fn run(options: &Options) -> Result<()> {
    let mut build = process::cargo(places::root());
    process::run(build.args(["build", "--quiet", "--package", "rigident-cli", "--bin", "rigident"]))?;
    tables::make(&["safety-long"], options.write)
}
