//! Building: the first answer from nothing, a changed line, the last run of all tests.
//!
//! Machines differ, so the unit is a *reference build*: the processor time of `cargo build --release` from
//! nothing of an empty program with four common libraries of fixed versions.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::{Figure, Setting, measure};
use crate::places;
use crate::process;

/// Time of the reference build on the machine on which limits in seconds were set, s.
const REFERENCE_THERE_S: f64 = 83.0;
/// Clock of all tests after a change, in reference builds: 45 min where one takes 53 s.
const TESTS: f64 = 51.0;
/// Changed lines for each figure.
const CHANGES: usize = 3;

/// Measures all of them.
pub fn figures(setting: &Setting) -> Result<Vec<Figure>> {
    let reference_s = reference_build_s(setting)?;
    let mut figures = vec![first_answer(setting, reference_s)?];
    figures.extend(changed_lines(setting, reference_s)?);
    if let Some(seconds) = process::last_test_s() {
        figures.push(Figure {
            name: "all tests after a change, reference builds by the clock".to_owned(),
            value: seconds / reference_s,
            limit: TESTS,
            note: format!("{:.0} min, the last run of `cargo xtask test` here", seconds / 60.0),
        });
    }
    Ok(figures)
}

/// Returns the processor seconds of the reference build, which is made once.
///
/// # Errors
/// The reference's libraries cannot be fetched.
pub fn reference_build_s(setting: &Setting) -> Result<f64> {
    if let Some(seconds) = setting.reference_s.get() {
        return Ok(*seconds);
    }
    let folder = setting.folder.join("reference");
    if !folder.is_dir() {
        let half = setting.folder.join("reference-half");
        std::fs::create_dir_all(half.join("src"))?;
        std::fs::write(half.join("src/main.rs"), "fn main() {}\n")?;
        std::fs::write(
            half.join("Cargo.toml"),
            "[package]\nname = \"reference\"\nversion = \"0.1.0\"\nedition \
             = \"2024\"\n\n[workspace]\n\n[dependencies]\n\
             nalgebra = \"=0.34.0\"\nclap = { version = \"=4.5.40\", features = [\"derive\"] }\n\
             regex = \"=1.11.1\"\nserde_json = \"=1.0.140\"\n",
        )?;
        std::fs::rename(&half, &folder)?;
    }
    let target = from_nothing(&setting.folder.join("reference-target"))?;
    process::run(process::cargo(&folder).arg("fetch").arg("--quiet"))?;
    let mut command = process::cargo(&folder);
    let used = measure::run(command.args(["build", "--release"]).env("CARGO_TARGET_DIR", target), &[0])?;
    println!("a reference build takes {:.0} s of the processor here", used.processor_s);
    Ok(*setting.reference_s.get_or_init(|| used.processor_s))
}

/// Measures the first of README's two commands, from nothing.
fn first_answer(setting: &Setting, reference_s: f64) -> Result<Figure> {
    let target = from_nothing(&setting.folder.join("first-target"))?;
    let answer = from_nothing(&setting.folder.join("first-answer"))?;
    process::run(process::cargo(places::root()).args(["fetch", "--quiet"]))?;
    let mut command = process::cargo(places::root());
    command.args(["run", "--release", "--", "demo", "--out"]).arg(&answer).env("CARGO_TARGET_DIR", target);
    let used = measure::run(&mut command, &[0])?;
    Ok(Figure {
        name: "first answer from nothing, reference builds".to_owned(),
        value: used.processor_s / reference_s,
        limit: 8.5,
        note: format!("{:.0} s of the processor, {:.0} s by the clock", used.processor_s, used.clock_s),
    })
}

/// Measures a clone of what is committed, in which lines are changed: the sources here stay as they are.
fn changed_lines(setting: &Setting, reference_s: f64) -> Result<Vec<Figure>> {
    let clone = from_nothing(&setting.folder.join("clone"))?;
    let mut git = process::command("git", places::root());
    process::run(git.args(["clone", "--quiet", "--depth", "1"]).arg(file_url()).arg(&clone))?;
    let target = setting.folder.join("quick-target");
    let build = || {
        let mut command: Command = process::cargo(&clone);
        command.args(["build", "--quiet"]).env("CARGO_TARGET_DIR", &target).env_remove("CARGO_INCREMENTAL");
        command
    };
    measure::run(&mut build(), &[0])?;
    let mut figures = Vec::new();
    for (room, file, limit) in
        [("cli", "host/cli/src/commands/predict/mod.rs", 12.0), ("fit", "host/fit/src/weighing.rs", 35.0)]
    {
        let mut seconds = Vec::new();
        for number in 0..CHANGES {
            append(&clone.join(file), number)?;
            seconds.push(measure::run(&mut build(), &[0])?.clock_s);
        }
        let seconds = measure::median(seconds);
        figures.push(Figure {
            name: format!("a line changed in `{room}`: built, s where a reference build takes 83"),
            value: seconds * REFERENCE_THERE_S / reference_s,
            limit,
            note: format!("{seconds:.1} s by the clock here"),
        });
    }
    Ok(figures)
}

fn file_url() -> String {
    format!("file://{}", places::root().display())
}

/// Adds a function to a file.
fn append(file: &Path, number: usize) -> Result<()> {
    let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
    ensure!(text.contains("fn "), "{} is no source", file.display());
    let more = format!("\n/// Returns a number.\npub fn changed_{number}() -> usize {{\n    {number}\n}}\n");
    std::fs::write(file, text + &more).with_context(|| file.display().to_string())
}

/// Removes a folder of an earlier measurement.
fn from_nothing(folder: &Path) -> Result<PathBuf> {
    if folder.exists() {
        std::fs::remove_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    Ok(folder.to_owned())
}
