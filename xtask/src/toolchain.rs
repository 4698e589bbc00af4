//! The one place that chooses where the target's `core` comes from, and says what it chose and why.
//!
//! Either rustup's prebuilt `core`, or Debian's own compiler, which carries the sources and builds it.

use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::{Result, bail};

use crate::places::{self, TARGET};
use crate::process;
use crate::setup;

/// A way to the target's `core`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Core {
    /// The prebuilt one that `rustup target add` installs.
    Rustup,
    /// Debian's compiler builds it from the sources it carries.
    Debian,
}

impl Core {
    /// Returns its name, as `--core` takes it.
    pub fn name(self) -> &'static str {
        match self {
            Core::Rustup => "rustup",
            Core::Debian => "debian",
        }
    }

    /// Returns the other way.
    pub fn other(self) -> Self {
        match self {
            Core::Rustup => Core::Debian,
            Core::Debian => Core::Rustup,
        }
    }
}

impl fmt::Display for Core {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

/// Debian's packages for the second way.
const DEBIAN_PACKAGES: [&str; 5] = ["rustc-web", "cargo-web", "rust-web-src", "rust-web-clippy", "lld"];
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";
const DEBIAN_CARGO: &str = "/usr/bin/cargo";
const DEBIAN_CLIPPY: &str = "/usr/bin/cargo-clippy";
const RUSTUP_LIMIT: Duration = Duration::from_secs(60);

/// Chooses, installs if it must, and prints the choice and its reason.
///
/// Order: what was asked for; what is there already; rustup, for at most a minute; Debian's packages.
pub fn choose(asked: Option<Core>) -> Result<Core> {
    let (core, why) = match asked {
        Some(Core::Rustup) => {
            if !rustup_core_is_installed(TARGET) && !add_by_rustup(TARGET)? {
                bail!("`rustup target add {TARGET}` failed; try without `--core rustup`");
            }
            (Core::Rustup, "it was asked for")
        }
        Some(Core::Debian) => {
            install_debian()?;
            (Core::Debian, "it was asked for")
        }
        None if rustup_core_is_installed(TARGET) => (Core::Rustup, "the compiler has it already"),
        None if debian_is_installed() => (Core::Debian, "Debian's compiler is already here"),
        None if process::is_installed("rustup") && add_by_rustup(TARGET)? => {
            (Core::Rustup, "rustup could add it")
        }
        None => {
            install_debian()?;
            (Core::Debian, "rustup could not add it within a minute")
        }
    };
    eprintln!("core for {TARGET}: by {core}, because {why}");
    Ok(core)
}

/// Returns Cargo for a build in the board's folder, without arguments after the flags that `core` needs.
///
/// Each way has its own build folder, so that switching rebuilds nothing.
pub fn board_cargo(core: Core, verb: &str, folder: &Path) -> Command {
    board_cargo_for(core, verb, folder, TARGET)
}

/// Returns Cargo as [`board_cargo`] does, for another target than that of the first boards; see [`have`].
pub fn board_cargo_for(core: Core, verb: &str, folder: &Path, target: &str) -> Command {
    let mut command = cargo_for(core, verb, folder, target);
    if core == Core::Debian {
        command
            .args(["-Zbuild-std=core,compiler_builtins", "-Zbuild-std-features=compiler-builtins-mem"])
            .env(linker_variable(target), "ld.lld");
    }
    command.env("CARGO_TARGET_DIR", build_folder(core));
    command
}

/// Returns Cargo for a program on another system, whose target has `std`: rustup downloads it, Debian's
/// compiler builds it.
pub fn system_cargo(core: Core, verb: &str, target: &str) -> Command {
    let mut command = cargo_for(core, verb, places::root(), target);
    if core == Core::Debian {
        command.arg("-Zbuild-std=std,test,panic_abort,panic_unwind");
    }
    command
}

/// Returns the variable by which cargo takes a target's linker.
pub fn linker_variable(target: &str) -> String {
    format!("CARGO_TARGET_{}_LINKER", target.to_uppercase().replace(['-', '.'], "_"))
}

/// Returns Cargo for a target, by the compiler of this way.
fn cargo_for(core: Core, verb: &str, folder: &Path, target: &str) -> Command {
    let mut command = match core {
        Core::Rustup => process::cargo(folder),
        // Through cargo, another toolchain's clippy would be found first.
        Core::Debian if verb == "clippy" => process::command(DEBIAN_CLIPPY, folder),
        Core::Debian => process::command(DEBIAN_CARGO, folder),
    };
    command.arg(verb);
    command.args(["--target", target]);
    if core == Core::Debian {
        command
            .env("RUSTC_BOOTSTRAP", "1")
            .env("CARGO", DEBIAN_CARGO)
            .env("RUSTC", DEBIAN_RUSTC)
            .env_remove("RUSTUP_TOOLCHAIN")
            .env_remove("LD_LIBRARY_PATH");
    }
    command
}

/// Chooses for another system's target as [`choose`] does for the boards': what was asked for, else what is
/// there, else rustup, else Debian's packages.
pub fn choose_for(asked: Option<Core>, target: &str) -> Result<Core> {
    let core = match asked {
        Some(core) => core,
        None if rustup_core_is_installed(target) => Core::Rustup,
        None if debian_is_installed() => Core::Debian,
        None if process::is_installed("rustup") && add_by_rustup(target)? => Core::Rustup,
        None => Core::Debian,
    };
    if core == Core::Debian {
        install_debian()?;
    }
    have(core, target)?;
    eprintln!("std for {target}: by {core}");
    Ok(core)
}

/// Makes sure that this way can build for another target: rustup downloads its `core`, Debian's compiler
/// builds it.
pub fn have(core: Core, target: &str) -> Result<()> {
    if core == Core::Debian || rustup_core_is_installed(target) || add_by_rustup(target)? {
        return Ok(());
    }
    bail!("`rustup target add {target}` failed; `--core debian` builds it from sources")
}

/// Returns where the board's builds go.
pub fn build_folder(core: Core) -> PathBuf {
    places::own().join(format!("board-{core}"))
}

fn rustup_core_is_installed(target: &str) -> bool {
    let sysroot = process::output(process::command("rustc", places::root()).args(["--print", "sysroot"]));
    sysroot.is_ok_and(|sysroot| {
        let folder = Path::new(sysroot.trim()).join("lib/rustlib").join(target).join("lib");
        std::fs::read_dir(folder).is_ok_and(|mut files| {
            files.any(|file| file.is_ok_and(|f| f.file_name().to_string_lossy().starts_with("libcore-")))
        })
    })
}

fn add_by_rustup(target: &str) -> Result<bool> {
    let mut command = process::command("rustup", places::root());
    command.args(["target", "add", target]);
    Ok(process::run_bounded(&mut command, RUSTUP_LIMIT)? && rustup_core_is_installed(target))
}

fn debian_is_installed() -> bool {
    let sysroot = Command::new(DEBIAN_RUSTC).args(["--print", "sysroot"]).output();
    sysroot.is_ok_and(|sysroot| {
        let folder = String::from_utf8_lossy(&sysroot.stdout);
        Path::new(folder.trim()).join("lib/rustlib/src/rust/library/core/src/lib.rs").is_file()
    }) && [DEBIAN_CARGO, DEBIAN_CLIPPY].iter().all(|program| Path::new(program).is_file())
        && process::is_installed("ld.lld")
}

fn install_debian() -> Result<()> {
    if !debian_is_installed() {
        setup::apt_install(&DEBIAN_PACKAGES)?;
        if !debian_is_installed() {
            bail!("Debian's compiler was installed, yet it has no sources of `core`");
        }
    }
    Ok(())
}
