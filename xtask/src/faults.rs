//! The verb `faults`: makes everything go wrong with a device that the simulator can make go wrong.

use anyhow::Result;

use crate::firmware;
use crate::process;
use crate::tables;
use crate::toolchain::{self, Core};

/// Which faults, and what becomes of the table.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Only faults whose names hold this.
    #[arg(long)]
    only: Option<String>,
    /// Only those that take a minute, with twenty power cuts instead of a thousand.
    #[arg(long)]
    short: bool,
    /// Put the table into docs/faults.md; of all faults only.
    #[arg(long, conflicts_with_all = ["only", "short"])]
    write: bool,
}

/// Builds the release image and runs the faults against it; fails if one leads to a wrong number, a panic or a hang, or nobody is
/// told.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    let elf = firmware::build(toolchain::choose(core)?, &[])?;
    let mut command = tables::program()?;
    command.env("RIGIDENT_FIRMWARE_ELF", elf);
    if options.write {
        command.args(["device-faults-long", "--write"]);
    } else if let Some(name) = &options.only {
        command.args(["--fault", name]);
        command.args(options.short.then_some("--short-faults"));
    } else if options.short {
        command.arg("--short-faults");
    } else {
        command.args(["--fault", ""]);
    }
    process::run(&mut command)
}

/// The short selection, against the image that is built.
pub fn short(core: Core) -> Result<()> {
    run(&Options { short: true, ..Options::default() }, Some(core))
}
