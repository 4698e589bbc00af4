//! Wine in a folder of this project's own: its prefix, the DLL that it lacks, and programs that run in it.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::places;
use crate::process;

/// Debian's packages beside the compiler.
pub const PACKAGES: [&str; 2] = ["gcc-mingw-w64-x86-64", "wine64"];
/// The paths of programs of that name: the first is Debian's, which is on no path.
const PROGRAMS: [&str; 2] = ["/usr/lib/wine/wine64", "/usr/bin/wine64"];
/// Windows' random numbers, which Rust's `std` asks for and Wine 8 has under an older name alone.
const RANDOM: &str = "#include <windows.h>
BOOLEAN NTAPI SystemFunction036(PVOID, ULONG);
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE buffer, SIZE_T length)
{ return SystemFunction036(buffer, (ULONG)length); }
";
const RANDOM_DLL: &str = "bcryptprimitives.dll";

/// Wine with a prefix of its own.
pub struct Wine {
    program: PathBuf,
    prefix: PathBuf,
}

impl Wine {
    /// Makes the prefix with what is missing in it, unless it is there.
    ///
    /// # Errors
    /// There is no Wine or no compiler for Windows, or a file cannot be written.
    pub fn new(folder: &Path) -> Result<Self> {
        let Some(program) = PROGRAMS.iter().map(PathBuf::from).find(|path| path.is_file()) else {
            bail!("there is no wine64: apt-get install wine64");
        };
        let wine = Self { program, prefix: folder.join("wine") };
        let system = wine.prefix.join("drive_c/windows/system32");
        if !system.join(RANDOM_DLL).is_file() {
            std::fs::create_dir_all(folder)?;
            process::run(wine.command(places::root()).args(["wineboot", "--init"]))?;
            let source = folder.join("bcryptprimitives.c");
            std::fs::write(&source, RANDOM)?;
            let mut compiler = process::command("x86_64-w64-mingw32-gcc", folder);
            compiler.args(["-shared", "-O1", "-o"]).arg(system.join(RANDOM_DLL)).arg(&source);
            process::run(compiler.arg("-ladvapi32")).context("cannot make the DLL that Wine lacks")?;
        }
        Ok(wine)
    }

    /// Returns the command of a program of Windows in a folder; the first argument is its path.
    pub fn command(&self, folder: &Path) -> Command {
        let mut command = process::command(&self.program, folder);
        self.surround(&mut command);
        command
    }

    /// Lets cargo run what it builds for a target in this Wine.
    pub fn runs_for(&self, command: &mut Command, target: &str) {
        let name = format!("CARGO_TARGET_{}_RUNNER", target.to_uppercase().replace('-', "_"));
        command.env(name, &self.program);
        self.surround(command);
    }

    /// Silences dialogues and messages of Wine's own.
    fn surround(&self, command: &mut Command) {
        command
            .env("WINEPREFIX", &self.prefix)
            .env("WINEDEBUG", "-all")
            .env("WINEDLLOVERRIDES", "mscoree,mshtml=")
            .env_remove("DISPLAY");
    }
}

/// Tells whether there is a Wine for programs of 64 bits.
pub fn is_installed() -> bool {
    PROGRAMS.iter().any(|path| Path::new(path).is_file())
}
