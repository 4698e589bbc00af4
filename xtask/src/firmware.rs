//! The verb `firmware`: builds the board's release binary.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::places::{self, FIRMWARE, TARGET};
use crate::process;
use crate::toolchain::{self, Core};

/// What to build.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// Features of the board crate, separated by commas.
    #[arg(long, value_delimiter = ',')]
    pub features: Vec<String>,
}

/// Builds and prints the path on standard output. Without features both images are built, and the standard one's path is printed.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    let core = toolchain::choose(core)?;
    if options.features.is_empty() {
        build_watch(core)?;
    }
    let features: Vec<&str> = options.features.iter().map(String::as_str).collect();
    println!("{}", build(core, &features)?.display());
    Ok(())
}

/// Builds the board's main binary. Without features it also goes where the simulator looks for it.
pub fn build(core: Core, features: &[&str]) -> Result<PathBuf> {
    let elf = build_binary(core, FIRMWARE, features)?;
    if features.is_empty() {
        copy(&elf, &places::firmware_elf())?;
    }
    Ok(elf)
}

/// What `cargo build` is told for an image that identifies nothing but one body.
const BODY_ONLY: &str = "--no-default-features";

/// Builds the board's main binary for one body alone, and leaves the one that the simulator finds as it is.
pub fn build_body_only(core: Core) -> Result<PathBuf> {
    build_binary(core, FIRMWARE, &[BODY_ONLY])
}

/// The feature of the image that watches robots.
pub const WATCH: &str = "watch";

/// Builds the board's image that watches robots; it also goes where the simulator looks for it.
pub fn build_watch(core: Core) -> Result<PathBuf> {
    let elf = build_watch_apart(core)?;
    copy(&elf, &places::watch_elf())?;
    Ok(elf)
}

/// Builds the same beside [`build_apart`]'s, and leaves the one that the simulator finds as it is.
pub fn build_watch_apart(core: Core) -> Result<PathBuf> {
    build_binary(core, FIRMWARE, &[WATCH])
}

/// Builds the board's main binary and leaves the one that the simulator finds as it is.
pub fn build_apart(core: Core) -> Result<PathBuf> {
    build_binary(core, FIRMWARE, &[])
}

/// Builds one binary of the board crate with these features, or options of `cargo build`, and keeps its ELF where builds with other features do not replace it.
pub fn build_binary(core: Core, binary: &str, features: &[&str]) -> Result<PathBuf> {
    let mut command = toolchain::board_cargo(core, "build", &places::board());
    command.args(["--release", "--bin", binary]);
    let (options, features): (Vec<&str>, Vec<&str>) = features.iter().partition(|f| f.starts_with("--"));
    command.args(&options);
    if !features.is_empty() {
        command.arg("--features").arg(features.join(","));
    }
    process::run(&mut command)?;
    let built = toolchain::build_folder(core).join(TARGET).join("release").join(binary);
    let mut name = format!("{binary}-{core}");
    for part in options.iter().map(|option| option.trim_start_matches('-')).chain(features) {
        name = format!("{name}-{part}");
    }
    let kept = places::own().join("elf").join(name).with_extension("elf");
    copy(&built, &kept)?;
    Ok(kept)
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    if let Some(folder) = to.parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::copy(from, to).with_context(|| format!("cannot copy {} to {}", from.display(), to.display()))?;
    Ok(())
}
