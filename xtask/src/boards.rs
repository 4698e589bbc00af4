//! The verb `boards`: lints, builds and checks the firmware of every board, without the host.

use anyhow::{Context, Result};

use crate::bench_target;
use crate::check_elf;
use crate::emulator;
use crate::firmware;
use crate::places;
use crate::process::{self, Steps};
use crate::size;
use crate::toolchain::{self, Core};

/// Says how far the checks go.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Also each set of features by clippy, smaller chips, and the emulated board's firmware by the other way
    /// to `core`.
    #[arg(long)]
    pub nightly: bool,
}

/// Runs every step.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    let mut steps = Steps::default();
    if let Some(core) = steps.run("choice of core", || toolchain::choose(core)) {
        lints(&mut steps, core, options.nightly);
        images(&mut steps, core);
        if options.nightly {
            smaller_chips(&mut steps, core);
        }
        steps.run("a panic and a fault on the board end with a status", || emulator::bad_ends(core));
        check_elf::run_steps(&mut steps, core);
        steps.run("size", || size::run(&size::Options::default(), Some(core)));
        let bench =
            bench_target::Options { baseline: bench_target::can_compile_baseline(), ..Default::default() };
        steps.run("bench-target", || bench_target::run(&bench, Some(core)));
        if options.nightly {
            other_core(&mut steps, core.other());
        }
    }
    steps.finish()
}

/// Lints each board once, with the features that compile most of it; at night with each set of them.
fn lints(steps: &mut Steps, core: Core, nightly: bool) {
    let emulated: &[&str] = if nightly { &["", firmware::WATCH] } else { &[firmware::WATCH] };
    let bought: &[&str] = if nightly { &["", "rtt", firmware::WATCH] } else { &[firmware::WATCH] };
    for (name, board, sets) in [("board", places::BOARD, emulated), ("STM32", places::STM32, bought)] {
        for features in sets {
            steps.run(format!("clippy, {name} {features}").trim_end(), || {
                let mut command = toolchain::board_cargo(core, "clippy", &places::board_named(board));
                process::clippy_strictly(command.args(["--release", "--features", features]))
            });
        }
    }
    steps.run("clippy, RP2350", || {
        toolchain::have(core, places::PICO_TARGET)?;
        let folder = places::board_named(places::PICO);
        let mut command = toolchain::board_cargo_for(core, "clippy", &folder, places::PICO_TARGET);
        process::clippy_strictly(command.args(["--release", "--features", "an505"]))
    });
}

/// Builds the images that tests and the simulator use.
fn images(steps: &mut Steps, core: Core) {
    steps.run("firmware, STM32F405", || firmware::build_for(firmware::Board::F405, core, &[]));
    steps.run("firmware, STM32F405 with the watch", || {
        firmware::build_for(firmware::Board::F405, core, &[firmware::WATCH])
    });
    steps.run("firmware, RP2350", || firmware::build_for(firmware::Board::Pico, core, &[]));
    steps.run("firmware", || {
        firmware::build_watch(core)?;
        firmware::build(core, &[])
    });
}

/// Builds these images and checks nothing else.
///
/// # Errors
/// Names the images that cannot be built.
pub fn images_for_tests(core: Core) -> Result<()> {
    let mut steps = Steps::default();
    images(&mut steps, core);
    steps.finish()
}

/// Builds the images of the chips with half a megabyte of flash.
fn smaller_chips(steps: &mut Steps, core: Core) {
    for board in firmware::SMALLER {
        steps.run(&format!("firmware, {board:?}"), || firmware::build_for(board, core, &[]));
    }
}

/// Makes the same checks on the firmware that the other way to `core` builds.
fn other_core(steps: &mut Steps, core: Core) {
    let built = steps.run(&format!("firmware, core by {core}"), || {
        toolchain::choose(Some(core))?;
        check_elf::check_watch_file(&firmware::build_watch_apart(core)?)?;
        firmware::build_apart(core)
    });
    steps.run(&format!("check-elf, core by {core}"), || {
        check_elf::check_file(&built.context("there is no firmware to look at")?)
    });
}
