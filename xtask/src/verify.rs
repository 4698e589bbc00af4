//! The verb `test`: installs, builds and tests everything; all failures are told at the end.

use anyhow::{Context, Result, bail};

use crate::faults;
use crate::firmware;
use crate::fuzz;
use crate::goldens;
use crate::places;
use crate::process::{self, Beside, Steps};
use crate::python;
use crate::setup;
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
    steps.run("set-up", || setup::programs(core));
    let chosen = steps.run("choice of core", || toolchain::choose(core));
    formatting(&mut steps);
    // None of these shares a build folder with the host, and much of what they compile keeps one processor busy.
    let mut start =
        |words: &[&str]| steps.run(&format!("start of {}, beside", words.join(" ")), || Beside::start(words));
    let python = start(&["setup", "--python"]);
    let boards = start(&boards_words(core, options));
    let fuzz_build = (options.fuzz_seconds > 0).then(|| start(&["fuzz", "--seconds", "0"])).flatten();
    steps.run("structure", structure::run);
    steps.run("clippy, host", || {
        process::clippy_strictly(process::cargo(places::root()).args([
            "clippy",
            "--release",
            "--workspace",
            "--all-targets",
        ]))
    });
    feature_sets(&mut steps);
    // This program was built by itself, with fewer features of what it shares with the others; it stays so.
    let others = ["--workspace", "--exclude", "xtask"];
    steps.run("compiling tests", || {
        process::run(process::cargo(places::root()).args(["test", "--release", "--no-run"]).args(others))
    });
    if let Some(python) = python {
        steps.run("set-up of Python", || python.wait());
    }
    let elf =
        boards.and_then(|boards| steps.run("boards", || boards.wait())).map(|()| places::firmware_elf());
    let is_fuzz_built = fuzz_build.and_then(|build| steps.run("fuzz, compiling", || build.wait())).is_some();
    let here = steps.run("what tests need", || Surroundings::look(elf.as_deref())).unwrap_or_default();
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
        steps.run("faults, the short ones", || faults::short(core));
    }
    steps.run("documentation", || {
        let mut command = process::cargo(places::root());
        // In the profile of clippy, so that what it checked is not checked again.
        command.args(["doc", "--release", "--workspace", "--no-deps", "--quiet"]);
        process::run(command.env("RUSTDOCFLAGS", "-D warnings"))
    });
    if let (Some(core), true) = (chosen, options.both_cores) {
        other_core(&mut steps, core.other(), &here, &mut counts);
    }
    steps.run("oldest compiler", oldest_compiler);
    if is_fuzz_built {
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

/// Returns the words of the verb `boards` that does the boards' part of these options.
fn boards_words(core: Option<Core>, options: &Options) -> Vec<&'static str> {
    let mut words = vec!["boards"];
    words.extend(core.iter().flat_map(|core| ["--core", core.name()]));
    words.extend(options.both_cores.then_some("--both-cores"));
    words
}

/// Runs the same emulated tests on what the other way to `core` built.
fn other_core(steps: &mut Steps, core: Core, here: &Surroundings, counts: &mut Counts) {
    steps.run(&format!("emulated tests, core by {core}"), || {
        // Of the whole workspace, so that features are those of the first time and nothing is compiled again.
        let arguments = ["--workspace", "--exclude", "xtask", "--test", "integration", "--no-fail-fast"];
        here.with_firmware(firmware::apart(core)).test(&arguments, &["emulated"], counts).map(drop)
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
