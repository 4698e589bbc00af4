//! The verb `test`: installs, builds and tests everything; all failures are told at the end.

use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::bench_target;
use crate::check_elf;
use crate::emulator;
use crate::faults;
use crate::firmware;
use crate::fuzz;
use crate::goldens;
use crate::places;
use crate::process::{self, Steps};
use crate::python;
use crate::setup;
use crate::size;
use crate::structure;
use crate::support;
use crate::testing::{Counts, Surroundings};
use crate::toolchain::{self, Core};

/// How long and how far.
#[derive(clap::Args, Clone)]
pub struct Options {
    /// Seconds of fuzzing for each target; 0 leaves it out.
    #[arg(long, default_value_t = 10)]
    pub fuzz_seconds: u32,
    /// Test the firmware built by the other way to `core` too.
    #[arg(long)]
    pub both_cores: bool,
}

/// Runs every step.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    let mut steps = Steps::default();
    let mut counts = Counts::default();
    steps.run("set-up", || setup::run(core));
    let chosen = steps.run("choice of core", || toolchain::choose(core));
    formatting(&mut steps);
    steps.run("structure", structure::run);
    steps.run("clippy, host", || {
        clippy_strictly(process::cargo(places::root()).args([
            "clippy",
            "--release",
            "--workspace",
            "--all-targets",
        ]))
    });
    feature_sets(&mut steps);
    let elf = chosen.and_then(|core| {
        for features in ["", firmware::WATCH] {
            steps.run(&format!("clippy, board {features}"), || {
                let mut command = toolchain::board_cargo(core, "clippy", &places::board());
                clippy_strictly(command.args(["--release", "--features", features]))
            });
        }
        for features in ["", "rtt", firmware::WATCH] {
            steps.run(&format!("clippy, STM32 {features}"), || {
                let folder = places::board_named(places::STM32);
                let mut command = toolchain::board_cargo(core, "clippy", &folder);
                clippy_strictly(command.args(["--release", "--features", features]))
            });
        }
        for board in firmware::BOUGHT {
            steps.run(&format!("firmware, {board:?}"), || firmware::build_for(board, core, &[]));
        }
        steps.run("firmware, STM32F405 with the watch", || {
            firmware::build_for(firmware::Board::F405, core, &[firmware::WATCH])
        });
        steps.run("clippy, RP2350", || {
            toolchain::have(core, places::PICO_TARGET)?;
            let folder = places::board_named(places::PICO);
            let mut command = toolchain::board_cargo_for(core, "clippy", &folder, places::PICO_TARGET);
            clippy_strictly(command.args(["--release", "--features", "an505"]))
        });
        steps.run("firmware, RP2350", || firmware::build_for(firmware::Board::Pico, core, &[]));
        steps.run("firmware", || {
            firmware::build_watch(core)?;
            firmware::build(core, &[])
        })
    });
    let here = steps.run("what tests need", || Surroundings::look(elf.as_deref())).unwrap_or_default();
    // This program was built by itself, with fewer features of what it shares with the others; it stays so.
    let others = ["--workspace", "--exclude", "xtask"];
    steps.run("compiling tests", || {
        process::run(process::cargo(places::root()).args(["test", "--release", "--no-run"]).args(others))
    });
    let passed = steps.run("tests, on the host and in the emulator", || {
        here.test(&[&others[..], &["--no-fail-fast"]].concat(), &[], &mut counts)
    });
    if let Some(passed) = passed {
        steps.run("support matrix", || support::check(&passed));
    }
    steps.run("tests of the developer jobs", || {
        here.test(&["--package", "xtask"], &[], &mut counts).map(drop)
    });
    steps.run("Python wheel", || python::test(&mut counts));
    steps.run("goldens, the quick ones", || {
        // The program that the tests have just built: by itself it would have other features, and be compiled again.
        let binary = Some(places::target().join("release/rigident"));
        goldens::run(&goldens::Options { quick: true, binary, ..Default::default() })
    });
    if let Some(core) = chosen {
        steps.run("a panic and a fault on the board end with a status", || emulator::bad_ends(core));
        steps.run("faults, the short ones", || faults::short(core));
        check_elf::run_steps(&mut steps, core);
        steps.run("size", || size::run(&size::Options::default(), Some(core)));
        let bench =
            bench_target::Options { baseline: bench_target::can_compile_baseline(), ..Default::default() };
        steps.run("bench-target", || bench_target::run(&bench, Some(core)));
    }
    steps.run("documentation", || {
        let mut command = process::cargo(places::root());
        // In the profile of clippy, so that what it checked is not checked again.
        command.args(["doc", "--release", "--workspace", "--no-deps", "--quiet"]);
        process::run(command.env("RUSTDOCFLAGS", "-D warnings"))
    });
    if let (Some(core), true) = (chosen, options.both_cores) {
        other_core(&mut steps, core, &here, &mut counts);
    }
    steps.run("oldest compiler", oldest_compiler);
    if options.fuzz_seconds > 0 {
        steps
            .run("fuzz", || fuzz::run(&fuzz::Options { seconds: options.fuzz_seconds, targets: Vec::new() }));
    }
    let ended = steps.finish();
    println!("\n{counts}");
    ended
}

fn formatting(steps: &mut Steps) {
    // With `--all`, cargo would follow paths out of the workspace and do the host's crates again.
    let host: &[&str] = &["fmt", "--all", "--check"];
    let one: &[&str] = &["fmt", "--check"];
    let workspaces = [
        ("host", places::root().to_owned(), host),
        ("board", places::board(), one),
        ("STM32", places::board_named(places::STM32), one),
        ("RP2350", places::board_named(places::PICO), one),
        ("boards' common part", places::board_named("cortex-m"), one),
        ("fuzz targets", places::fuzz(), one),
    ];
    for (name, folder, arguments) in workspaces {
        steps.run(&format!("format, {name}"), || process::run(process::cargo(&folder).args(arguments)));
    }
}

/// Checks the host's library and program with fewer features than the default ones.
fn feature_sets(steps: &mut Steps) {
    for features in [&["--no-default-features"][..], &["--no-default-features", "--features", "simulator"]] {
        steps.run(&format!("check, {}", features.join(" ")), || {
            let mut command = process::cargo(places::root());
            command.args(["check", "--release", "--quiet", "--package", "rigident"]).args(features);
            process::run(&mut command)
        });
    }
}

fn clippy_strictly(command: &mut Command) -> Result<()> {
    process::run(command.args(["--quiet", "--", "-D", "warnings"]))
}

/// Runs the same checks and the same emulated tests on what the other way to `core` builds.
fn other_core(steps: &mut Steps, core: Core, here: &Surroundings, counts: &mut Counts) {
    let other = match core {
        Core::Rustup => Core::Debian,
        Core::Debian => Core::Rustup,
    };
    let built = steps.run(&format!("firmware, core by {other}"), || {
        toolchain::choose(Some(other))?;
        check_elf::check_watch_file(&firmware::build_watch_apart(other)?)?;
        firmware::build_apart(other)
    });
    let Some(elf) = built else { return };
    steps.run(&format!("check-elf, core by {other}"), || check_elf::check_file(&elf));
    steps.run(&format!("emulated tests, core by {other}"), || {
        // Of the whole workspace, so that features are those of the first time and nothing is compiled again.
        let arguments = ["--workspace", "--exclude", "xtask", "--test", "integration", "--no-fail-fast"];
        here.with_firmware(elf).test(&arguments, &["emulated"], counts).map(drop)
    });
}

/// The compiler that `rust-version` promises: this one, an installed one, or clippy's knowledge of the library.
fn oldest_compiler() -> Result<()> {
    let promised = promised_version()?;
    let text = process::output(process::command("rustc", places::root()).arg("--version"))?;
    let here = text.split_whitespace().nth(1).context("rustc does not tell its version")?;
    let minor = |version: &str| version.split('.').nth(1).and_then(|part| part.parse::<u32>().ok());
    match (minor(here), minor(&promised)) {
        (Some(here), Some(promised)) if here < promised => {
            bail!("this rustc is 1.{here}, older than the promised 1.{promised}")
        }
        (Some(here), Some(promised)) if here == promised => {
            println!("this rustc is 1.{here}, the promised one: every step above checked it");
            return Ok(());
        }
        _ => {}
    }
    let toolchains = process::command("rustup", places::root()).args(["toolchain", "list"]).output();
    let installed = toolchains.is_ok_and(|list| {
        String::from_utf8_lossy(&list.stdout).lines().any(|line| line.starts_with(&promised))
    });
    if !installed {
        println!("rustc {here}; {promised} is not installed: checked by clippy's incompatible_msrv alone");
        return Ok(());
    }
    println!("rustc {here}; checking with the installed {promised}");
    let mut command = process::command("rustup", places::root());
    command.args(["run", &promised, "cargo", "check", "--workspace", "--all-targets", "--quiet"]);
    process::run(command.env("CARGO_TARGET_DIR", places::own().join("oldest")))
}

fn promised_version() -> Result<String> {
    let mut command = process::cargo(places::root());
    let text = process::output(command.args(["metadata", "--no-deps", "--format-version", "1"]))?;
    let metadata: serde_json::Value = serde_json::from_str(&text)?;
    let version = metadata["packages"][0]["rust_version"].as_str();
    Ok(version.context("Cargo.toml promises no rust-version")?.to_owned())
}
