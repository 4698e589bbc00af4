//! The verb `macos`: checks the types of the program for Apple's systems on this one.
//!
//! Apple's headers are not here, so the C of SQLite and zstd is not compiled: a compiler that leaves empty
//! files takes its place. What runs, and whether it links, only a Mac can show: the release workflow builds
//! and tests there.

use anyhow::{Result, ensure};

use crate::places;
use crate::process;
use crate::toolchain::{self, Core};

const TARGETS: [&str; 2] = ["aarch64-apple-darwin", "x86_64-apple-darwin"];
/// Leaves an empty file of the name behind `-o`, or the archive's.
const NO_COMPILER: &str = "#!/bin/sh
for word in \"$@\"; do
  if [ \"$last\" = -o ]; then : > \"$word\"; fi
  case \"$word\" in *.a) : > \"$word\";; esac
  last=$word
done
";

/// Says what is checked.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Macs with Intel's processors, too.
    #[arg(long)]
    pub all: bool,
}

/// Checks the program for Macs.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    ensure!(cfg!(unix), "the stand-in for a C compiler is a shell's script: run this on Linux or macOS");
    let folder = places::target().join("macos");
    std::fs::create_dir_all(&folder)?;
    let compiler = folder.join("no-compiler");
    std::fs::write(&compiler, NO_COMPILER)?;
    process::run(process::command("chmod", &folder).arg("+x").arg(&compiler))?;
    for target in &TARGETS[..if options.all { 2 } else { 1 }] {
        let core = toolchain::choose_for(core, target)?;
        let mut command = toolchain::system_cargo(core, "check", target);
        command.args(["-p", "rigident-cli", "--lib", "--bins"]);
        let variable = target.replace('-', "_");
        command.env(format!("CC_{variable}"), &compiler).env(format!("AR_{variable}"), &compiler);
        // Else Apple's own program would be asked where they are.
        command.env("SDKROOT", &folder).env("CARGO_TARGET_DIR", &folder);
        process::run(&mut command)?;
    }
    Ok(())
}
