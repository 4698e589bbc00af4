//! The verb `test`: installs, builds and tests everything; all failures are reported at the end.
//!
//! The tests after each change and those at night: [`Part`] and CONTRIBUTING.md.

use anyhow::{Context, Result, bail};

use crate::boards;
use crate::faults;
use crate::firmware;
use crate::fuzz;
use crate::goldens;
use crate::places;
use crate::process::{self, Beside, Steps};
use crate::python;
use crate::safety;
use crate::setup;
use crate::structure;
use crate::support;
use crate::testing::{Counts, Surroundings};
use crate::toolchain::{self, Core};

/// A part of the checks that runs by itself, as one job of the workflow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Part {
    /// Format, structure, clippy; at night also sets of features and documentation.
    Lints,
    /// Images of the boards: lints, sizes, instructions; at night also by the other way to `core`.
    Boards,
    /// Tests of the host, the simulator, the firmware in the emulator and the documents; goldens and short
    /// faults.
    Host,
    /// The wheel, installed and tested.
    Python,
    /// The fuzzer: decoders of the device; at night all.
    Fuzz,
}

const ALL: [Part; 5] = [Part::Lints, Part::Boards, Part::Host, Part::Python, Part::Fuzz];

/// Says how much is tested.
#[derive(clap::Args, Clone)]
pub struct Options {
    /// Only this part; may be given several times.
    #[arg(long = "part", value_enum, value_name = "PART")]
    pub parts: Vec<Part>,
    /// Everything that takes too long after each change: studies at full length, the other way to `core`,
    /// each set of features, the released program, all faults, a minute of fuzzing for each decoder.
    #[arg(long)]
    pub nightly: bool,
}

/// Runs every step.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    let parts = if options.parts.is_empty() { &ALL[..] } else { &options.parts[..] };
    let job = Job { nightly: options.nightly, core, has: |part| parts.contains(&part) };
    let mut steps = Steps::default();
    let mut counts = Counts::default();
    job.run(&mut steps, &mut counts);
    if options.parts.is_empty() && !options.nightly {
        steps.remember_time()?;
    }
    let ended = steps.finish();
    println!("\n{counts}");
    ended
}

struct Job<F: Fn(Part) -> bool> {
    nightly: bool,
    core: Option<Core>,
    has: F,
}

impl<F: Fn(Part) -> bool> Job<F> {
    fn run(&self, steps: &mut Steps, counts: &mut Counts) {
        steps.run("set-up", || setup::programs(self.core));
        let chosen = steps.run("choice of core", || toolchain::choose(self.core));
        // None of these shares a build folder with the host, and much of what they compile keeps one
        // processor busy.
        let mut beside = |is_wanted: bool, words: &[&str]| {
            let start = || Beside::start(words);
            is_wanted.then(|| steps.run(&format!("start of {}, beside", words.join(" ")), start)).flatten()
        };
        let is_host = (self.has)(Part::Host);
        let python = beside(is_host || (self.has)(Part::Python), &["setup", "--python"]);
        let boards = beside((self.has)(Part::Boards), &self.boards());
        let fuzz = beside((self.has)(Part::Fuzz), &self.fuzz("0"));
        if (self.has)(Part::Lints) {
            lints(steps, self.nightly);
        }
        if is_host {
            steps.run("compiling tests", compile_tests);
        }
        if let Some(python) = python {
            steps.run("set-up of Python", || python.wait());
        }
        let are_built = match boards {
            // An image above its limit fails, and can still be tested.
            Some(boards) => {
                steps.run("boards", || boards.wait());
                places::firmware_elf().is_file()
            }
            None => {
                is_host
                    && chosen.is_some_and(|core| {
                        steps.run("images for tests", || boards::images_for_tests(core)).is_some()
                    })
            }
        };
        if is_host {
            self.host(steps, counts, chosen, are_built);
        }
        if (self.has)(Part::Python) {
            steps.run("Python wheel", || python::test(counts, self.nightly));
        }
        if let Some(fuzz) = fuzz {
            steps.run("fuzz, compiling", || fuzz.wait());
            let seconds = if self.nightly { 60 } else { 10 };
            let options = fuzz::Options { seconds, device: !self.nightly, targets: Vec::new() };
            steps.run("fuzz", || fuzz::run(&options));
        }
    }

    /// Runs tests of the workspace, then checks what the built program must print.
    fn host(&self, steps: &mut Steps, counts: &mut Counts, core: Option<Core>, has_firmware: bool) {
        let elf = has_firmware.then(places::firmware_elf);
        let mut here = Surroundings::look(elf.as_deref(), self.nightly);
        steps.run("needs of tests", || here.check());
        let passed = steps.run("tests, on the host and in the emulator", || {
            here.test(&[&WITHOUT_XTASK[..], &["--no-fail-fast"]].concat(), &[], counts)
        });
        if let Some(passed) = passed {
            steps.run("support matrix", || support::check(&passed));
        }
        steps
            .run("tests of the developer jobs", || here.test(&["--package", "xtask"], &[], counts).map(drop));
        steps.run("a program outside", || here.test(&outside(self.nightly), &[], counts).map(drop));
        steps.run("goldens", || {
            // After each change the program that the tests have just built, at night the released one.
            let binary = (!self.nightly).then(|| places::built("rigident"));
            goldens::run(&goldens::Options { quick: !self.nightly, binary, ..Default::default() })
        });
        let Some(core) = core else { return };
        if self.nightly {
            other_core(steps, core.other(), &mut here, counts);
            steps.run("safety", || safety::run(&safety::Options::default()));
            steps.run("faults", || faults::run(&faults::Options::default(), Some(core)));
            steps.run("faults, of the board's drivers", faults::of_board);
        } else {
            steps.run("faults, the short ones", || faults::short(core));
        }
    }

    /// Returns the words of the verb `boards` that does the boards' part.
    fn boards(&self) -> Vec<&'static str> {
        let mut words = vec!["boards"];
        words.extend(self.core.iter().flat_map(|core| ["--core", core.name()]));
        words.extend(self.nightly.then_some("--nightly"));
        words
    }

    fn fuzz(&self, seconds: &'static str) -> Vec<&'static str> {
        let mut words = vec!["fuzz", "--seconds", seconds];
        words.extend((!self.nightly).then_some("--device"));
        words
    }
}

/// The developer jobs were built by themselves, with fewer features of what they share with the others; they
/// stay so.
const WITHOUT_XTASK: [&str; 3] = ["--workspace", "--exclude", "xtask"];

/// Programs of users, in a workspace of their own: at night those on the host's library, too, which is built
/// for them.
fn outside(nightly: bool) -> Vec<&'static str> {
    let mut words = vec!["--manifest-path", "tests/outside/Cargo.toml", "--target-dir", "target/outside"];
    words.extend(if nightly { &["--workspace"][..] } else { &["--package", "in-firmware"] });
    words
}

fn compile_tests() -> Result<()> {
    process::run(process::cargo(places::root()).args(["test", "--no-run"]).args(WITHOUT_XTASK))
}

fn lints(steps: &mut Steps, nightly: bool) {
    formatting(steps);
    steps.run("structure", structure::run);
    steps.run("clippy, host", || {
        process::clippy_strictly(process::cargo(places::root()).args([
            "clippy",
            "--workspace",
            "--all-targets",
        ]))
    });
    steps.run("oldest compiler", oldest_compiler);
    if nightly {
        feature_sets(steps);
        steps.run("documentation", || {
            let mut command = process::cargo(places::root());
            command.args(["doc", "--workspace", "--no-deps", "--quiet"]);
            process::run(command.env("RUSTDOCFLAGS", "-D warnings"))
        });
    }
}

fn formatting(steps: &mut Steps) {
    // With `--all`, cargo would follow paths out of the workspace and do the host's crates again.
    let host: &[&str] = &["fmt", "--all", "--check"];
    let one: &[&str] = &["fmt", "--check"];
    let outside: &[&str] = &["fmt", "--check", "--package", "outside", "--package", "in-firmware"];
    let workspaces = [
        ("host", places::root().to_owned(), host),
        ("board", places::board(), one),
        ("STM32", places::board_named(places::STM32), one),
        ("RP2350", places::board_named(places::PICO), one),
        ("boards' common part", places::board_named("cortex-m"), one),
        ("fuzz targets", places::fuzz(), one),
        ("programs outside", places::root().join("tests/outside"), outside),
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
            command.args(["check", "--quiet", "--package", "rigident-cli"]).args(features);
            process::run(&mut command)
        });
    }
}

/// Runs the emulated tests on the firmware that the other way to `core` builds.
fn other_core(steps: &mut Steps, core: Core, here: &mut Surroundings, counts: &mut Counts) {
    let built = steps.run(&format!("firmware, core by {core}"), || {
        toolchain::choose(Some(core))?;
        firmware::build_watch_apart(core)?;
        firmware::build_apart(core)
    });
    let Some(elf) = built else { return };
    steps.run(&format!("emulated tests, core by {core}"), || {
        // Of the whole workspace, so that features are those of the first time and nothing is compiled again.
        let arguments = [&WITHOUT_XTASK[..], &["--test", "integration", "--no-fail-fast"]].concat();
        here.with_firmware(elf).test(&arguments, &["emulated"], counts).map(drop)
    });
}

/// Checks by the compiler that `rust-version` promises: this one, an installed one, or clippy's knowledge of
/// the library.
fn oldest_compiler() -> Result<()> {
    let promised = promised_version()?;
    let text = process::output(process::command("rustc", places::root()).arg("--version"))?;
    let here = text.split_whitespace().nth(1).context("rustc prints no version")?;
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
