//! Running other programs: clean environment, time limits, named and timed steps.

use std::ffi::OsStr;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::places;

/// Returns a command without what cargo set for this program alone, and without standard input.
///
/// Build scripts watch such variables: left in place, they would rebuild crates on every change of caller.
pub fn command(program: impl AsRef<OsStr>, folder: &Path) -> Command {
    let mut command = Command::new(program);
    command.current_dir(folder).stdin(Stdio::null());
    for (key, _) in std::env::vars_os() {
        let name = key.to_string_lossy();
        let of_cargo_run = name.starts_with("CARGO_PKG_")
            || name.starts_with("CARGO_BIN_")
            || name.starts_with("CARGO_MANIFEST_")
            || matches!(name.as_ref(), "CARGO" | "CARGO_CRATE_NAME" | "CARGO_PRIMARY_PACKAGE" | "OUT_DIR");
        if of_cargo_run {
            command.env_remove(&key);
        }
    }
    command
}

/// Returns Cargo as the user calls it, in `folder`.
pub fn cargo(folder: &Path) -> Command {
    command("cargo", folder)
}

/// Returns the command as one would type it.
pub fn shown(command: &Command) -> String {
    let mut words: Vec<String> = vec![command.get_program().to_string_lossy().into_owned()];
    words.extend(command.get_args().map(|word| word.to_string_lossy().into_owned()));
    words.join(" ")
}

/// Runs to the end; its output goes where ours goes.
pub fn run(command: &mut Command) -> Result<()> {
    eprintln!("$ {}", shown(command));
    let status = command.status().with_context(|| format!("cannot start `{}`", shown(command)))?;
    if !status.success() {
        bail!("`{}` ended with {status}", shown(command));
    }
    Ok(())
}

/// Runs clippy, for which a warning is an error.
pub fn clippy_strictly(command: &mut Command) -> Result<()> {
    run(command.args(["--quiet", "--", "-D", "warnings"]))
}

/// Runs to the end and gives its standard output.
pub fn output(command: &mut Command) -> Result<String> {
    let output = command
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("cannot start `{}`", shown(command)))?;
    if !output.status.success() {
        bail!("`{}` ended with {}", shown(command), output.status);
    }
    String::from_utf8(output.stdout).with_context(|| format!("`{}` did not print text", shown(command)))
}

/// Runs for at most `limit`; `Ok(false)` when it failed or had to be ended.
pub fn run_bounded(command: &mut Command, limit: Duration) -> Result<bool> {
    Ok(status_bounded(command, limit)?.is_some_and(|status| status.success()))
}

/// Runs for at most `limit`; `None` when it had to be ended.
pub fn status_bounded(command: &mut Command, limit: Duration) -> Result<Option<ExitStatus>> {
    eprintln!("$ {} (at most {} s)", shown(command), limit.as_secs());
    let begun = Instant::now();
    let mut child = command.spawn().with_context(|| format!("cannot start `{}`", shown(command)))?;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if begun.elapsed() >= limit {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Returns whether a program of that name is on the path.
pub fn is_installed(program: &str) -> bool {
    std::env::var_os("PATH")
        .is_some_and(|path| std::env::split_paths(&path).any(|folder| folder.join(program).is_file()))
}

/// Returns the processor time of the programs that ended so far, user's and system's; `None` where `/proc`
/// does not state it.
pub fn processor_time() -> Option<Duration> {
    /// Ticks of these figures in a second, on every Linux.
    const TICKS: f64 = 100.0;
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name in parentheses may hold blanks; behind it are the state and 12 figures more before those of
    // children.
    let (_, rest) = text.rsplit_once(')')?;
    let fields: Vec<&str> = rest.split_whitespace().collect();
    let ticks = fields.get(13)?.parse::<u64>().ok()? + fields.get(14)?.parse::<u64>().ok()?;
    Some(Duration::from_secs_f64(ticks as f64 / TICKS))
}

/// A verb of this program that runs beside other steps; what it prints goes to a file.
pub struct Beside {
    child: Child,
    shown: String,
    report: PathBuf,
}

impl Beside {
    /// Starts a verb.
    pub fn start(words: &[&str]) -> Result<Self> {
        let folder = places::own().join("beside");
        std::fs::create_dir_all(&folder)?;
        let report = folder.join(words.join(" ")).with_extension("txt");
        let file = File::create(&report).with_context(|| format!("cannot write {}", report.display()))?;
        let mut command = command(std::env::current_exe()?, places::root());
        command.args(words).stdout(Stdio::from(file.try_clone()?)).stderr(Stdio::from(file));
        let shown = format!("cargo xtask {}", words.join(" "));
        eprintln!("$ {shown} > {} &", report.display());
        let child = command.spawn().with_context(|| format!("cannot start `{shown}`"))?;
        Ok(Self { child, shown, report })
    }

    /// Waits for its end and prints what it printed.
    pub fn wait(mut self) -> Result<()> {
        let status = self.child.wait()?;
        std::io::copy(&mut File::open(&self.report)?, &mut std::io::stdout())?;
        if !status.success() {
            bail!("`{}` ended with {status}", self.shown);
        }
        Ok(())
    }
}

/// Returns where the seconds of the last run of all tests are.
fn last_test_file() -> PathBuf {
    places::own().join("last-test-s.txt")
}

/// Returns how long the last run of all tests took by the clock, s; `None` if there was none.
pub fn last_test_s() -> Option<f64> {
    std::fs::read_to_string(last_test_file()).ok()?.trim().parse().ok()
}

struct Done {
    name: String,
    took: Duration,
    processor: Option<Duration>,
    failure: Option<String>,
}

/// Runs named steps, times each, and keeps going after a failure so that all are reported.
#[derive(Default)]
pub struct Steps {
    done: Vec<Done>,
}

impl Steps {
    /// Runs one step. A failure is printed and recorded; the value is there only on success.
    pub fn run<T>(&mut self, name: &str, step: impl FnOnce() -> Result<T>) -> Option<T> {
        println!("\n=== {name}");
        let (begun, used) = (Instant::now(), processor_time());
        let result = step();
        let took = begun.elapsed();
        let processor = processor_time().zip(used).map(|(now, before)| now.saturating_sub(before));
        let (value, failure) = match result {
            Ok(value) => (Some(value), None),
            Err(error) => (None, Some(format!("{error:#}"))),
        };
        match &failure {
            None => println!("--- {name}: ok, {:.1} s", took.as_secs_f64()),
            Some(failure) => println!("--- {name}: FAILED, {:.1} s: {failure}", took.as_secs_f64()),
        }
        self.done.push(Done { name: name.into(), took, processor, failure });
        value
    }

    /// Records how long all steps took, for [`last_test_s`].
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn remember_time(&self) -> Result<()> {
        std::fs::create_dir_all(places::own())?;
        let total: Duration = self.done.iter().map(|done| done.took).sum();
        Ok(std::fs::write(last_test_file(), format!("{:.1}\n", total.as_secs_f64()))?)
    }

    /// Prints what each step took, by the clock and of the processors, and fails if any did.
    pub fn finish(self) -> Result<()> {
        println!("\n=== summary: seconds by the clock, and of the processors");
        let seconds =
            |time: Option<Duration>| time.map_or("?".to_owned(), |time| format!("{:.1}", time.as_secs_f64()));
        for Done { name, took, processor, failure } in &self.done {
            let mark = if failure.is_none() { "ok    " } else { "FAILED" };
            println!("{mark} {:7.1} s {:>7} s  {name}", took.as_secs_f64(), seconds(*processor));
        }
        let total: Duration = self.done.iter().map(|done| done.took).sum();
        let processor: Option<Duration> = self.done.iter().map(|done| done.processor).sum();
        println!("       {:7.1} s {:>7} s  in all", total.as_secs_f64(), seconds(processor));
        let failures: Vec<_> =
            self.done.iter().filter_map(|done| Some((&done.name, done.failure.as_ref()?))).collect();
        for (name, failure) in &failures {
            println!("\n{name}:\n  {failure}");
        }
        if failures.is_empty() { Ok(()) } else { bail!("{} step(s) failed", failures.len()) }
    }
}
