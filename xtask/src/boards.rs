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
    /// Build the emulated board's firmware by the other way to `core` too.
    #[arg(long)]
    pub both_cores: bool,
}

/// Runs every step.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    let mut steps = Steps::default();
    if let Some(core) = steps.run("choice of core", || toolchain::choose(core)) {
        lints(&mut steps, core);
        images(&mut steps, core);
        steps.run("a panic and a fault on the board end with a status", || emulator::bad_ends(core));
        check_elf::run_steps(&mut steps, core);
        steps.run("size", || size::run(&size::Options::default(), Some(core)));
        let bench =
            bench_target::Options { baseline: bench_target::can_compile_baseline(), ..Default::default() };
        steps.run("bench-target", || bench_target::run(&bench, Some(core)));
        if options.both_cores {
            other_core(&mut steps, core.other());
        }
    }
    steps.finish()
}

fn lints(steps: &mut Steps, core: Core) {
    for features in ["", firmware::WATCH] {
        steps.run(&format!("clippy, board {features}"), || {
            let mut command = toolchain::board_cargo(core, "clippy", &places::board());
            process::clippy_strictly(command.args(["--release", "--features", features]))
        });
    }
    for features in ["", "rtt", firmware::WATCH] {
        steps.run(&format!("clippy, STM32 {features}"), || {
            let folder = places::board_named(places::STM32);
            let mut command = toolchain::board_cargo(core, "clippy", &folder);
            process::clippy_strictly(command.args(["--release", "--features", features]))
        });
    }
    steps.run("clippy, RP2350", || {
        toolchain::have(core, places::PICO_TARGET)?;
        let folder = places::board_named(places::PICO);
        let mut command = toolchain::board_cargo_for(core, "clippy", &folder, places::PICO_TARGET);
        process::clippy_strictly(command.args(["--release", "--features", "an505"]))
    });
}

/// Builds all images, those that tests and the simulator look for among them.
fn images(steps: &mut Steps, core: Core) {
    for board in firmware::BOUGHT {
        steps.run(&format!("firmware, {board:?}"), || firmware::build_for(board, core, &[]));
    }
    steps.run("firmware, STM32F405 with the watch", || {
        firmware::build_for(firmware::Board::F405, core, &[firmware::WATCH])
    });
    steps.run("firmware, RP2350", || firmware::build_for(firmware::Board::Pico, core, &[]));
    steps.run("firmware", || {
        firmware::build_watch(core)?;
        firmware::build(core, &[])
    });
}

/// Does the same checks on what the other way to `core` builds.
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
