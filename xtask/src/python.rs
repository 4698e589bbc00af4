//! The verb `python`: builds the wheel, installs it as a user does, and tests what is installed: functions,
//! examples in their documentation, types and notebooks.

use std::io::Write;
use std::process::Stdio;

use anyhow::{Context, Result, bail};

use crate::places;
use crate::process;
use crate::setup;
use crate::testing::{self, Counts};

/// Builds, installs and tests the wheel, and prints the number of tests.
///
/// # Errors
/// It cannot be built, a test fails, or nothing of what is needed can be installed.
pub fn run() -> Result<()> {
    setup::python_module(setup::WHEEL);
    let mut counts = Counts::default();
    let ended = test(&mut counts, true);
    println!("{counts}");
    ended
}

/// Builds, installs and tests the wheel as a step of all tests; it is skipped where what it needs is not here
/// and `CI` is not set.
///
/// After each change (`released` is false) the wheel is linked from what the tests compiled, and recipes for
/// other engines than Dask are left to the night.
///
/// # Errors
/// See [`run`].
pub fn test(counts: &mut Counts, released: bool) -> Result<()> {
    if !setup::has_module(setup::WHEEL) {
        if testing::is_ci() {
            bail!(
                "CI is set, and there is no maturin, pytest, mypy or nbclient in Python: cargo xtask setup"
            );
        }
        println!("skipped: there is no maturin, pytest, mypy or nbclient in Python: cargo xtask setup");
        counts.skipped += 1;
        return Ok(());
    }
    install(released)?;
    let mut command = python();
    command.args(["-m", "pytest", "-q", "--doctest-modules", "-p", "no:cacheprovider"]);
    // The package by its name is the installed one, not its sources.
    command.args(["-c", "python/pyproject.toml", "--rootdir", ".", "--pyargs", "rigident", "python/tests"]);
    if released {
        command.env(testing::NIGHTLY, "1");
    } else {
        command.args(["-m", "not nightly"]);
    }
    let shown = process::shown(&command);
    eprintln!("$ {shown}");
    let output = command
        .stdout(Stdio::piped())
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("cannot start `{shown}`"))?;
    std::io::stdout().write_all(&output.stdout)?;
    let text = String::from_utf8_lossy(&output.stdout);
    let found = text.lines().rev().find_map(summary).unwrap_or_default();
    *counts += found;
    if !output.status.success() {
        bail!("`{shown}` ended with {}", output.status);
    }
    if found.passed == 0 {
        bail!("`{shown}` ran no test");
    }
    Ok(())
}

/// Installs the package from its sources, with the packages for it that are here.
fn install(released: bool) -> Result<()> {
    let mut command = python();
    if !released {
        command.env("MATURIN_PEP517_ARGS", "--profile dev");
    }
    command.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-build-isolation"]);
    process::run(command.args(["--no-deps", "--force-reinstall", "./python"]))
}

/// Returns the project's own Python, whose programs come before others of their name.
fn python() -> std::process::Command {
    let program = setup::python();
    let mut command = process::command(&program, places::root());
    let own = program.parent().map(std::path::Path::to_owned);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = own.into_iter().chain(std::env::split_paths(&path));
    if let Ok(path) = std::env::join_paths(folders) {
        command.env("PATH", path);
    }
    // Where pip builds, too: what is compiled already is not compiled again.
    command.env("CARGO_TARGET_DIR", places::target());
    command
}

/// Reads pytest's last line, as `2 failed, 31 passed, 1 skipped in 5.21s`.
fn summary(line: &str) -> Option<Counts> {
    let (figures, _) = line.trim_matches(['=', ' ']).rsplit_once(" in ")?;
    let mut counts = Counts::default();
    let mut known = false;
    for part in figures.split(", ") {
        let (number, word) = part.split_once(' ')?;
        let number: u32 = number.parse().ok()?;
        match word {
            "passed" => counts.passed += number,
            "failed" | "error" | "errors" => counts.failed += number,
            "skipped" => counts.skipped += number,
            _ => continue,
        }
        known = true;
    }
    known.then_some(counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pytests_last_line_is_counted() {
        assert_eq!(
            summary("2 failed, 31 passed, 1 skipped, 3 warnings in 5.21s"),
            Some(Counts { passed: 31, failed: 2, skipped: 1 })
        );
        assert_eq!(summary("==== 1 error in 0.10s ===="), Some(Counts { failed: 1, ..Counts::default() }));
        for line in ["", "FAILED python/tests/test_a.py::test_b - in c", "no tests ran in 0.01s"] {
            assert_eq!(summary(line), None, "{line}");
        }
    }
}
