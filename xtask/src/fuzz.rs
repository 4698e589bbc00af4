//! The verb `fuzz`: every decoder against hostile bytes, on the stable compiler.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;

use anyhow::{Context, Result, bail};

use crate::places;
use crate::process;
use crate::setup;

/// What to fuzz and for how long.
#[derive(clap::Args, Clone)]
pub struct Options {
    /// Seconds for each target; 0 builds them only.
    #[arg(long, default_value_t = 60)]
    pub seconds: u32,
    /// Only targets of the device's decoders, without compiling the host for the fuzzer.
    #[arg(long)]
    pub device: bool,
    /// Targets; all when none is named.
    pub targets: Vec<String>,
}

/// Builds the targets and runs as many at a time as there are processors.
pub fn run(options: &Options) -> Result<()> {
    setup::system_packages()?;
    let cargo_fuzz = setup::cargo_fuzz()?;
    let mut waiting = match &options.targets[..] {
        [] if options.device => device_targets()?,
        [] => all_targets()?,
        named => named.to_vec(),
    };
    process::run(&mut fuzz_command(&cargo_fuzz, "build", options.device))?;
    if options.seconds == 0 {
        return Ok(());
    }
    waiting.reverse();
    let workers = std::thread::available_parallelism().map_or(1, usize::from).min(waiting.len());
    let waiting = Mutex::new(waiting);
    let failures = Mutex::new(Vec::new());
    let next = || waiting.lock().map(|mut names| names.pop()).ok().flatten();
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some(target) = next() {
                    if let (Err(error), Ok(mut list)) =
                        (run_target(&cargo_fuzz, &target, options), failures.lock())
                    {
                        list.push(format!("{target}: {error:#}"));
                    }
                }
            });
        }
    });
    let failures = failures.into_inner().unwrap_or_default();
    if failures.is_empty() { Ok(()) } else { bail!("{}", failures.join("\n  ")) }
}

/// Returns the names of the fuzz targets: the files in their folder.
fn all_targets() -> Result<Vec<String>> {
    let folder = places::fuzz().join("fuzz_targets");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let path = entry?.path();
        if path.extension().is_some_and(|end| end == "rs") {
            names.extend(path.file_stem().map(|stem| stem.to_string_lossy().into_owned()));
        }
    }
    names.sort();
    Ok(names)
}

/// Returns the names of the fuzz targets that do without the host's crate: those that require no feature of
/// it.
fn device_targets() -> Result<Vec<String>> {
    let file = places::fuzz().join("Cargo.toml");
    let text = std::fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
    let needs_host = |target: &String| {
        let entry = text.split("[[bin]]").find(|entry| entry.contains(&format!("name = \"{target}\"")));
        entry.is_some_and(|entry| entry.contains("required-features"))
    };
    Ok(all_targets()?.into_iter().filter(|target| !needs_host(target)).collect())
}

fn fuzz_command(cargo_fuzz: &Path, verb: &str, device: bool) -> Command {
    let mut command = process::command(cargo_fuzz, places::root());
    command.args(["fuzz", verb, "-s", "none", "--target-dir"]).arg(places::own().join("fuzz-build"));
    command.args(device.then_some("--no-default-features"));
    command
}

/// Runs one target; its report goes to a file of which the end is printed.
fn run_target(cargo_fuzz: &Path, target: &str, options: &Options) -> Result<()> {
    let seconds = options.seconds;
    let folder = places::own().join("fuzz").join(target);
    // New finds go here, before the committed corpus, which stays as it is.
    let found = folder.join("found");
    std::fs::create_dir_all(&found)?;
    let report = folder.join("report.txt");
    let file = File::create(&report)?;
    let mut command = fuzz_command(cargo_fuzz, "run", options.device);
    command.arg(target).arg(&found).arg(corpus(target));
    command.arg("--").arg(format!("-artifact_prefix={}/", folder.display()));
    command.arg(format!("-max_total_time={seconds}")).args([
        "-timeout=10",
        "-rss_limit_mb=2048",
        "-print_final_stats=1",
    ]);
    command.stdout(Stdio::from(file.try_clone()?)).stderr(Stdio::from(file));
    let status = command.status().with_context(|| format!("cannot start `{}`", process::shown(&command)))?;
    let text = String::from_utf8_lossy(&std::fs::read(&report)?).into_owned();
    if status.success() {
        let runs = text.lines().find_map(|line| line.strip_prefix("stat::number_of_executed_units:"));
        println!("fuzz {target}: {} inputs in {seconds} s, none failed", runs.unwrap_or("unknown").trim());
        return Ok(());
    }
    let lines: Vec<&str> = text.lines().collect();
    let end = lines[lines.len().saturating_sub(30)..].join("\n    ");
    bail!("failed, see {}:\n    {end}", report.display())
}

/// Returns the committed inputs of a target.
fn corpus(target: &str) -> PathBuf {
    places::fuzz().join("corpus").join(target)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_of_the_device_do_without_the_host() {
        let device = device_targets().unwrap();
        for (target, is_device) in [("wire_frame", true), ("sensor_drivers", true), ("rig_file", false)] {
            assert_eq!(device.iter().any(|name| name == target), is_device, "{device:?}");
        }
    }

    #[test]
    fn every_fuzz_target_has_a_committed_corpus() {
        for target in all_targets().unwrap() {
            let inputs = std::fs::read_dir(corpus(&target)).map(Iterator::count).unwrap_or(0);
            assert!(inputs > 0, "fuzz/corpus/{target} is empty");
        }
    }
}
