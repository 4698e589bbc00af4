//! Developer jobs, one verb each, one file each; `.ci/run` calls the same verbs.
//!
//! Lives here: installing tools, building the firmware for its target, running every test, and
//! measuring the linked program. What may not: anything the instrument needs at run time. Start with
//! `verify` (the verb `test`), which calls nearly all the others.

mod bench_target;
mod board_test;
mod boards;
mod budgets;
mod check_elf;
mod elf;
mod emulator;
mod faults;
mod firmware;
mod flash;
mod fuzz;
mod goldens;
mod macos;
mod package;
mod picture;
mod places;
mod process;
mod python;
mod safety;
mod setup;
mod size;
mod structure;
mod support;
mod tables;
mod testing;
mod toolchain;
mod verify;
mod web;
mod windows;
mod workflows;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use toolchain::Core;

#[derive(Parser)]
#[command(name = "cargo xtask", about = "Rigident's developer jobs", version)]
struct Arguments {
    /// Where the target's `core` comes from; chosen by itself when not given.
    #[arg(long, global = true, env = "RIGIDENT_CORE", value_enum)]
    core: Option<Core>,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Install what is missing: emulator, target `core`, C++ compiler, cargo-fuzz, Python readers.
    Setup(setup::Options),
    /// Build the firmware for the emulated board, or for another one, and print where the ELF is.
    Firmware(firmware::Options),
    /// Build the firmware for a board and put it there: by a debug probe, or with --dfu over USB.
    Flash(flash::Options),
    /// Install, build and test everything: after a change, or --nightly at full length; --part for one job of
    /// it.
    Test(verify::Options),
    /// Lint, build and check the firmware of every board, without the host.
    Boards(boards::Options),
    /// Flash, RAM and worst stack of the firmware, against the golden file.
    Size(size::Options),
    /// Instructions and estimated Cortex-M4 cycles for each sample, in the emulator.
    BenchTarget(bench_target::Options),
    /// Look for double precision and for panics reachable from the sample path in the firmware.
    CheckElf(check_elf::Options),
    /// Make the emulated board panic and fault, and look at the exit status.
    BadEnds,
    /// Fuzz the decoders.
    Fuzz(fuzz::Options),
    /// Measure speed and memory side by side with others, against their limits; takes an hour. Ends with 1
    /// above one.
    Budgets(budgets::Options),
    /// Compare what the program prints with what it printed once.
    Goldens(goldens::Options),
    /// Look at the sources: no circles among folders, no unguarded code for Unix alone, sizes of factors in
    /// one file.
    Structure,
    /// Take the pictures of the documents anew, of the demonstration's report in a browser and of the
    /// monitor.
    Picture,
    /// Compare README's support matrix with the list of tests behind its cells, or write it.
    Support(support::Options),
    /// Have things go wrong in every phase of a run, on the simulated rig: the plate must be at rest in 0.8
    /// s. Takes minutes.
    Safety(safety::Options),
    /// Make every fault of sensors, line, clock, flash and supply that the simulator can make, and see that
    /// none leads to a wrong number, a panic or a hang. Takes an hour; `--short` a minute or two.
    Faults(faults::Options),
    /// The procedure for the first person with a board: ask it what it can answer, print what is to be done
    /// by hand, write a page.
    BoardTest(board_test::Options),
    /// Build the Python wheel, install it, and test functions, examples, types and notebooks.
    Python,
    /// Build the page for browsers, check its size, and test it in one.
    Web(web::Options),
    /// Build the program for Windows and run it and the host's tests in Wine.
    Windows(windows::Options),
    /// Check the types of the program for macOS.
    Macos(macos::Options),
    /// Make what a release holds for a system, and try it: program, manual, notices, bill of materials; or
    /// the wheel.
    Package(package::Options),
    /// Look at the workflows: their schema, rights and secrets.
    Workflows,
    /// Make the tables of docs/estimation.md, docs/platform.md and docs/trees.md anew.
    Tables(tables::Options),
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments.verb, arguments.core) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(verb: &Verb, core: Option<Core>) -> anyhow::Result<()> {
    match verb {
        Verb::Setup(options) => setup::run(options, core),
        Verb::Firmware(options) => firmware::run(options, core),
        Verb::Flash(options) => flash::run(options, core),
        Verb::Test(options) => verify::run(options, core),
        Verb::Boards(options) => boards::run(options, core),
        Verb::Size(options) => size::run(options, core),
        Verb::BenchTarget(options) => bench_target::run(options, core),
        Verb::CheckElf(options) => check_elf::run(options, core),
        Verb::BadEnds => emulator::bad_ends(toolchain::choose(core)?),
        Verb::Fuzz(options) => fuzz::run(options),
        Verb::Budgets(options) => budgets::run(options, core),
        Verb::Goldens(options) => goldens::run(options),
        Verb::Structure => structure::run(),
        Verb::Picture => picture::run(),
        Verb::Support(options) => support::run(options),
        Verb::Faults(options) => faults::run(options, core),
        Verb::Safety(options) => safety::run(options),
        Verb::BoardTest(options) => board_test::run(options, core),
        Verb::Python => python::run(),
        Verb::Web(options) => web::run(options),
        Verb::Workflows => workflows::run(),
        Verb::Windows(options) => windows::run(options, core),
        Verb::Macos(options) => macos::run(options, core),
        Verb::Package(options) => package::run(options, core),
        Verb::Tables(options) => tables::run(options),
    }
}
