//! The verb `windows`: builds the program for Windows on this system, and runs it and its tests in Wine.
//!
//! Wine cannot show: real COM ports, a console's own behaviour, antivirus (docs/platforms.md).

mod checks;
mod wine;

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::places;
use crate::process::{self, Steps};
use crate::setup;
use crate::testing::{self, Counts};
use crate::toolchain::{self, Core};
use wine::Wine;

/// The target triple.
pub const TARGET: &str = "x86_64-pc-windows-gnu";
const LINKER: &str = "x86_64-w64-mingw32-gcc";
/// The crates whose tests run in Wine. The firmware in this process and the simulated rig are in
/// `rigident-cli`'s.
const TESTED: [&str; 15] = [
    "rigident-shared",
    "hexapod",
    "rigident-files",
    "rigident-fit",
    "rigident-model",
    "rigident-io",
    "rigident-rows",
    "rigident-vibration",
    "rigident-identify",
    "rigident-people",
    "rigident-present",
    "rigident-device",
    "rigident-plan",
    "rigident",
    "rigident-cli",
];
/// Fewer tests than this cannot be all that there are.
const LEAST: u32 = 200;

/// Says what is done.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Build the program, and no more.
    #[arg(long)]
    pub build: bool,
    /// Only tests whose names hold one of these words.
    #[arg(long, value_name = "WORD")]
    pub filter: Vec<String>,
    /// Only the program's checks, without the crates' tests.
    #[arg(long, conflicts_with = "filter")]
    pub checks: bool,
}

/// Builds, and runs.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    let core = ready(core)?;
    let program = build(core, &[])?;
    println!("{}", program.display());
    if options.build {
        return Ok(());
    }
    let wine = Wine::new(&folder())?;
    let mut steps = Steps::default();
    if options.filter.is_empty() {
        process::run(process::cargo(places::root()).args([
            "build",
            "-p",
            "rigident-cli",
            "-p",
            "rigident-sim",
        ]))?;
        checks::run(&mut steps, &wine, &program);
    }
    let mut counts = Counts::default();
    if !options.checks {
        steps.run("tests in Wine", || tests(core, &wine, options, &mut counts));
    }
    let ended = steps.finish();
    println!("in Wine: {counts}");
    ended
}

/// Installs what is missing and returns the way to `std`.
///
/// # Errors
/// Something cannot be installed.
pub fn ready(core: Option<Core>) -> Result<Core> {
    let is_here = process::is_installed(LINKER) && wine::is_installed();
    if !is_here {
        setup::apt_install(&wine::PACKAGES)?;
    }
    toolchain::choose_for(core, TARGET)
}

/// Builds the program with these more arguments of cargo's and returns where it is.
///
/// # Errors
/// It cannot be built.
pub fn build(core: Core, more: &[&str]) -> Result<PathBuf> {
    let mut command = cargo(core, "build");
    process::run(command.args(["-p", "rigident-cli"]).args(more).args(FEATURES))?;
    let profile = if more.contains(&"--release") { "release" } else { "debug" };
    Ok(folder().join(TARGET).join(profile).join("rigident.exe"))
}

/// Returns the command that runs a program of Windows in Wine.
///
/// # Errors
/// There is no Wine, or its folder cannot be made.
pub fn in_wine(program: &Path, at: &Path) -> Result<Command> {
    let mut command = Wine::new(&folder())?.command(at);
    command.arg(program);
    Ok(command)
}

/// The emulated board and the served rig are Unix' alone.
const FEATURES: [&str; 3] = ["--no-default-features", "--features", "rigident-cli/simulator"];

/// Returns Cargo for Windows, with a build folder of its own and the level of optimisation that compiles
/// soonest.
fn cargo(core: Core, verb: &str) -> Command {
    let mut command = toolchain::system_cargo(core, verb, TARGET);
    command
        .env(toolchain::linker_variable(TARGET), LINKER)
        .env("CARGO_TARGET_DIR", folder())
        .env("CARGO_PROFILE_DEV_OPT_LEVEL", "1");
    command
}

/// Returns where builds for Windows go, and Wine's own files.
fn folder() -> PathBuf {
    places::target().join("windows")
}

/// Runs the crates' tests in Wine and counts them.
fn tests(core: Core, wine: &Wine, options: &Options, counts: &mut Counts) -> Result<()> {
    let mut command = cargo(core, "test");
    command.arg("--no-fail-fast");
    command.args(TESTED.iter().flat_map(|name| ["-p", name])).args(FEATURES);
    // Documentation's examples are compiled for this system alone; benches need an idle machine.
    command.args(["--lib", "--test", "integration", "--", "--test-threads", "2"]).args(&options.filter);
    wine.runs_for(&mut command, TARGET);
    let filtered = !options.filter.is_empty();
    testing::counted(&mut command, filtered, counts).context("tests failed in Wine")?;
    anyhow::ensure!(filtered || counts.passed >= LEAST, "{counts}: at least {LEAST} must pass");
    Ok(())
}
