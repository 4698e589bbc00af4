//! The verb `goldens`: what the program printed once, compared with what it prints now.
//!
//! Every case of [`cases`] is one command, run in a folder of its own in the order of the list, so that later
//! ones may read what earlier ones wrote. [`seen`] says what of a command's output is stored, [`compare`]
//! when two are the same.

mod cases;
mod compare;
mod inputs;
mod seen;

use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context as _, Result, bail};
use cases::{CASES, Case};
use seen::Seen;

use crate::places;
use crate::process;

/// What is run and what becomes of it.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Write what this binary prints as the goldens, instead of comparing.
    #[arg(long, value_name = "BINARY")]
    pub record: Option<PathBuf>,
    /// Compare this binary, instead of building the current one.
    #[arg(long, value_name = "BINARY", conflicts_with = "record")]
    pub binary: Option<PathBuf>,
    /// Only cases that take no more than a few seconds.
    #[arg(long)]
    pub quick: bool,
}

/// The result of one case.
enum Ending {
    Same,
    OnPurpose(Vec<String>),
    Skipped(String),
    Recorded,
    Different(Vec<String>),
}

/// Runs every case, prints a line for each, and fails if one differs without a named reason.
pub fn run(options: &Options) -> Result<()> {
    let binary = match options.record.as_ref().or(options.binary.as_ref()) {
        Some(binary) => std::path::absolute(binary)?,
        None => build()?,
    };
    let folder = places::own().join("goldens");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
    }
    std::fs::create_dir_all(&folder)?;
    inputs::write(&folder, &data())?;
    let (mut same, mut on_purpose, mut skipped, mut different) = (0, 0, 0, 0);
    for case in CASES {
        let name = case.name;
        match one(case, &binary, &folder, options)? {
            Ending::Same => {
                same += 1;
                println!("same      {name}");
            }
            Ending::Recorded => {
                same += 1;
                println!("recorded  {name}");
            }
            Ending::OnPurpose(reasons) => {
                on_purpose += 1;
                println!("changed   {name}: {}", reasons.join("; "));
            }
            Ending::Skipped(why) => {
                skipped += 1;
                println!("skipped   {name}: {why}");
            }
            Ending::Different(what) => {
                different += 1;
                println!("DIFFERENT {name}: `rigident {}`", case.command);
                what.iter().take(8).for_each(|line| println!("          {line}"));
                if what.len() > 8 {
                    println!("          and {} more", what.len() - 8);
                }
            }
        }
    }
    println!("{same} same, {on_purpose} changed on purpose, {skipped} skipped, {different} different");
    if different > 0 { bail!("{different} case(s) differ from the goldens") } else { Ok(()) }
}

fn one(case: &Case, binary: &Path, folder: &Path, options: &Options) -> Result<Ending> {
    let file = stored().join(format!("{}.json", case.golden()));
    let golden = match options.record {
        None if !file.is_file() => bail!("{} is missing: record it", file.display()),
        None => Some(Seen::read(&file)?),
        Some(_) => None,
    };
    if options.quick && case.slow {
        return Ok(Ending::Skipped("slow".to_owned()));
    }
    if case.command.contains("{data}") && !data().is_dir() {
        return Ok(Ending::Skipped(format!("{} is not there", data().display())));
    }
    if case.command.contains("--mcu qemu") {
        if options.record.is_some() {
            return Ok(Ending::Skipped(format!("its golden is that of {}", case.golden())));
        }
        if !process::is_installed("qemu-system-arm") || !places::firmware_elf().is_file() {
            return Ok(Ending::Skipped("no emulator or no firmware: `cargo xtask firmware`".to_owned()));
        }
    }
    let docs = places::root().join("docs/examples");
    let line =
        case.command.replace("{data}", &data().to_string_lossy()).replace("{docs}", &docs.to_string_lossy());
    let words: Vec<&str> = line.split_whitespace().collect();
    let mut command = process::command(binary, folder);
    command.args(&words).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.env("RIGIDENT_FIRMWARE_ELF", places::firmware_elf());
    let output = command.output().with_context(|| format!("cannot start {}", binary.display()))?;
    inputs::after(case.name, folder)?;
    let seen = Seen::of(folder, &words, &output)?;
    let Some(golden) = golden else {
        std::fs::create_dir_all(stored())?;
        seen.write(&file, case.command)?;
        return Ok(Ending::Recorded);
    };
    let found = compare::differences(&golden, &seen, case);
    let mut reasons: Vec<String> = found.iter().filter_map(|d| d.reason).map(str::to_owned).collect();
    reasons.sort();
    reasons.dedup();
    let unexplained: Vec<String> = found.into_iter().filter(|d| d.reason.is_none()).map(|d| d.what).collect();
    Ok(match (unexplained.is_empty(), reasons.is_empty()) {
        (true, true) => Ending::Same,
        (true, false) => Ending::OnPurpose(reasons),
        _ => {
            let error = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            let last = error.lines().last().map(|line| format!("standard error: {line}"));
            Ending::Different(unexplained.into_iter().chain(last).collect())
        }
    })
}

/// Builds the current program as people use it, and returns its path.
fn build() -> Result<PathBuf> {
    let mut command = process::cargo(places::root());
    process::run(command.args(["build", "--release", "-p", "rigident-cli", "--bin", "rigident"]))?;
    Ok(places::released("rigident"))
}

/// Returns where the goldens are.
fn stored() -> PathBuf {
    places::root().join("host/cli/tests/goldens")
}

/// Returns where recordings of others are; they are not part of the project.
fn data() -> PathBuf {
    places::root().join("../shared/data")
}
