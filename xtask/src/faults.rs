//! The verb `faults`: makes everything go wrong with a device that the simulator can make go wrong.

use anyhow::Result;

use crate::firmware;
use crate::places;
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
    /// Faults of the board itself instead: its own drivers on a model of the chip's registers, 9 000 short
    /// runs and 1 000 long ones with one to three faults drawn at random; with --short 60.
    #[arg(long, conflicts_with_all = ["only", "write"])]
    board: bool,
    /// Put the table into docs/faults.md; of all faults only.
    #[arg(long, conflicts_with_all = ["only", "short"])]
    write: bool,
}

/// Builds the release image and runs the faults against it; fails if one leads to a wrong number, a panic or
/// a hang, or nobody is reported.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    if options.board {
        return board(options.short);
    }
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

/// Makes ten thousand runs of the board's own drivers.
pub fn of_board() -> Result<()> {
    board(false)
}

/// Runs the short selection, against the image that is built.
pub fn short(core: Core) -> Result<()> {
    run(&Options { short: true, ..Options::default() }, Some(core))
}

/// Runs of the board's own drivers, and their seconds on the model's clock.
fn board(short: bool) -> Result<()> {
    // The seeds of the runs differ.
    let rounds: &[(u32, u32, u32)] =
        if short { &[(60, 4, 1)] } else { &[(4_500, 4, 10_000), (4_500, 7, 20_000), (1_000, 40, 30_000)] };
    for (runs, seconds, first) in rounds {
        eprintln!("{runs} runs of {seconds} s on the board's clock");
        let mut command = process::cargo(places::root());
        // Of the whole workspace, as every test is.
        command.args([
            "test",
            "--quiet",
            "--workspace",
            "--exclude",
            "xtask",
            "--exclude",
            "rigident-python",
        ]);
        command.args(["--test", "board", "--", "--nocapture", "runs_with_faults_drawn_at_random"]);
        command.env("RIGIDENT_BOARD_RUNS", runs.to_string());
        command.env("RIGIDENT_BOARD_SECONDS", seconds.to_string());
        command.env("RIGIDENT_BOARD_FIRST", first.to_string());
        process::run(&mut command)?;
    }
    Ok(())
}
