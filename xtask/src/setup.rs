//! The verb `setup`: installs what is missing, as root only; otherwise says what to type.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::places;
use crate::process::{self, is_installed};
use crate::toolchain::{self, Core};

const CARGO_FUZZ: &str = "0.13.2";
/// An MCAP reader that shares no code with ours, for the test that reads our recordings with it.
const PYTHON_READER: [&str; 2] = ["mcap==1.6.0", "mcap-ros2-support==0.6.0"];
/// Rigid-body dynamics that share no code with ours.
const PINOCCHIO: &str = "pin==4.1.0";

/// Installs everything that any other verb may need.
pub fn run(core: Option<Core>) -> Result<()> {
    system_packages()?;
    toolchain::choose(core)?;
    cargo_fuzz()?;
    if let Some(python) = python_reader() {
        println!("independent MCAP reader: {}", python.display());
        if let Err(error) = pinocchio(&python) {
            eprintln!("no Pinocchio to compare with: {error:#}");
        }
    }
    Ok(())
}

/// The emulator, and the C++ compiler that the fuzzer's run-time needs.
pub fn system_packages() -> Result<()> {
    let wanted = [("qemu-system-arm", "qemu-system-arm"), ("g++", "g++")];
    let missing: Vec<&str> =
        wanted.iter().filter(|(program, _)| !is_installed(program)).map(|(_, package)| *package).collect();
    if missing.is_empty() { Ok(()) } else { apt_install(&missing) }
}

/// Installs Debian packages as root; for anyone else the error says what to type.
pub fn apt_install(packages: &[&str]) -> Result<()> {
    let list = packages.join(" ");
    let by_hand = format!("sudo apt-get install -y --no-install-recommends {list}");
    if !is_installed("apt-get") {
        bail!("{list}: missing, and there is no apt-get here; install them by hand");
    }
    let user = process::output(process::command("id", places::root()).arg("-u"))?;
    if user.trim() != "0" {
        bail!("{list}: missing; type\n  {by_hand}");
    }
    let apt = || {
        let mut command = process::command("apt-get", places::root());
        command.env("DEBIAN_FRONTEND", "noninteractive");
        command
    };
    process::run(apt().args(["-q", "update"]))?;
    process::run(apt().args(["-q", "install", "-y", "--no-install-recommends"]).args(packages))
        .with_context(|| format!("cannot install; by hand it is\n  {by_hand}"))
}

/// The pinned cargo-fuzz, in this project's own folder.
pub fn cargo_fuzz() -> Result<PathBuf> {
    let folder = places::own().join("tools");
    let program = folder.join("bin/cargo-fuzz");
    let version = process::command(&program, places::root()).arg("--version").output();
    let is_pinned = version.is_ok_and(|v| String::from_utf8_lossy(&v.stdout).contains(CARGO_FUZZ));
    if !is_pinned {
        process::run(
            process::cargo(places::root())
                .args(["install", "--quiet", "--locked", "cargo-fuzz", "--version", CARGO_FUZZ, "--root"])
                .arg(&folder)
                .env("CARGO_TARGET_DIR", places::own().join("tools-build")),
        )?;
    }
    Ok(program)
}

/// Pinocchio in that Python, for the test that compares rows and base parameters of trees with its own; the test says
/// that it was skipped where it is not.
fn pinocchio(python: &Path) -> Result<()> {
    let has = process::command(python, places::root()).args(["-c", "import pinocchio"]).output();
    if has.is_ok_and(|output| output.status.success()) {
        return Ok(());
    }
    process::run(process::command(python, places::root()).args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        PINOCCHIO,
    ]))
}

/// A Python that has the independent reader, or `None` where one cannot be made; the test then says it was skipped.
pub fn python_reader() -> Option<PathBuf> {
    let folder = places::own().join("python");
    let python = folder.join("bin/python");
    let has_reader = || {
        process::command(&python, places::root())
            .args(["-c", "import mcap_ros2.reader"])
            .output()
            .is_ok_and(|output| output.status.success())
    };
    if has_reader() {
        return Some(python);
    }
    let made = process::run(process::command("python3", places::root()).args(["-m", "venv"]).arg(&folder))
        .and_then(|()| {
            process::run(
                process::command(&python, places::root())
                    .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"])
                    .args(PYTHON_READER),
            )
        });
    match made {
        Ok(()) if has_reader() => Some(python),
        Ok(()) => None,
        Err(error) => {
            eprintln!("no independent MCAP reader: {error:#}");
            None
        }
    }
}
