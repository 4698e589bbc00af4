//! The verb `firmware`: builds a board's release binary.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::places::{
    self, BOARD, FIRMWARE, KERNEL_BITS, PICO, PICO_FIRMWARE, PICO_TARGET, STM32, STM32_FIRMWARE, TARGET,
};
use crate::process;
use crate::toolchain::{self, Core};

/// A board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Board {
    /// QEMU's, with simulated sensors.
    #[default]
    #[value(name = "mps2-an386")]
    Emulated,
    /// Olimex or WeAct with an STM32F405.
    #[value(name = "stm32f405")]
    F405,
    /// Nucleo-F446RE.
    #[value(name = "stm32f446")]
    F446,
    /// BlackPill with an STM32F411.
    #[value(name = "stm32f411")]
    F411,
    /// Raspberry Pi Pico 2: the link to the host alone.
    #[value(name = "rp2350")]
    Pico,
}

/// Bought boards whose chips have half a megabyte of flash.
pub const SMALLER: [Board; 2] = [Board::F446, Board::F411];

impl Board {
    /// Returns what `cargo build` receives for this chip. Half a megabyte of flash has no room for what an
    /// STM32F405 keeps.
    fn features(self) -> &'static [&'static str] {
        match self {
            Self::Emulated | Self::F405 | Self::Pico => &[],
            Self::F446 => &[BODY_ONLY, "links", "f446"],
            Self::F411 => &[BODY_ONLY, "links", "f411"],
        }
    }
}

/// What to build.
#[derive(clap::Args, Clone, Default)]
pub struct Options {
    /// For which board.
    #[arg(long, value_enum, default_value_t)]
    pub board: Board,
    /// Features of the board crate, separated by commas.
    #[arg(long, value_delimiter = ',')]
    pub features: Vec<String>,
}

/// Builds and prints the path on standard output. Of the emulated board and the STM32F405 without features
/// both images are built, and the standard one's path is printed.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    let core = toolchain::choose(core)?;
    if options.board == Board::Emulated && options.features.is_empty() {
        build_watch(core)?;
    }
    if options.board == Board::F405 && options.features.is_empty() {
        build_for(Board::F405, core, &[WATCH])?;
    }
    let features: Vec<&str> = options.features.iter().map(String::as_str).collect();
    println!("{}", build_for(options.board, core, &features)?.display());
    Ok(())
}

/// Builds a board's image. Without features those of the emulated board and of the STM32F405 also go where
/// tests expect them, and with the watch alone the latter's.
pub fn build_for(board: Board, core: Core, features: &[&str]) -> Result<PathBuf> {
    if board == Board::Emulated {
        return build(core, features);
    }
    if board == Board::Pico {
        toolchain::have(core, PICO_TARGET)?;
        let bits = build_in(core, (PICO, PICO_TARGET), KERNEL_BITS, &["an505"])?;
        copy(&bits, &places::kernel_bits_elf())?;
        return build_in(core, (PICO, PICO_TARGET), PICO_FIRMWARE, features);
    }
    let features: Vec<&str> = board.features().iter().chain(features).copied().collect();
    let elf = build_in(core, (STM32, TARGET), STM32_FIRMWARE, &features)?;
    if features.is_empty() {
        copy(&elf, &places::stm32_elf())?;
    } else if board == Board::F405 && features == [WATCH] {
        copy(&elf, &places::stm32_watch_elf())?;
    }
    Ok(elf)
}

/// Builds the board's main binary. Without features it also goes where the simulator expects it.
pub fn build(core: Core, features: &[&str]) -> Result<PathBuf> {
    let elf = build_binary(core, FIRMWARE, features)?;
    if features.is_empty() {
        copy(&elf, &places::firmware_elf())?;
    }
    Ok(elf)
}

/// The arguments that `cargo build` receives for an image that identifies nothing but one body.
const BODY_ONLY: &str = "--no-default-features";

/// Builds the board's main binary for one body alone, and leaves the one that the simulator finds as it is.
pub fn build_body_only(core: Core) -> Result<PathBuf> {
    build_binary(core, FIRMWARE, &[BODY_ONLY])
}

/// The feature of the image that watches robots.
pub const WATCH: &str = "watch";

/// Builds the board's image that watches robots; it also goes where the simulator expects it.
pub fn build_watch(core: Core) -> Result<PathBuf> {
    let elf = build_watch_apart(core)?;
    copy(&elf, &places::watch_elf())?;
    Ok(elf)
}

/// Builds the board's image that watches robots beside that of [`build_apart`], and leaves the one that the
/// simulator finds as it is.
pub fn build_watch_apart(core: Core) -> Result<PathBuf> {
    build_binary(core, FIRMWARE, &[WATCH])
}

/// Builds the board's main binary and leaves the one that the simulator finds as it is.
pub fn build_apart(core: Core) -> Result<PathBuf> {
    build_binary(core, FIRMWARE, &[])
}

/// Builds one binary of the board crate with these features, or options of `cargo build`, and keeps its ELF
/// where builds with other features do not replace it.
pub fn build_binary(core: Core, binary: &str, features: &[&str]) -> Result<PathBuf> {
    build_in(core, (BOARD, TARGET), binary, features)
}

fn build_in(core: Core, (board, target): (&str, &str), binary: &str, features: &[&str]) -> Result<PathBuf> {
    let mut command = toolchain::board_cargo_for(core, "build", &places::board_named(board), target);
    command.args(["--release", "--bin", binary]);
    let (options, features): (Vec<&str>, Vec<&str>) = features.iter().partition(|f| f.starts_with("--"));
    command.args(&options);
    if !features.is_empty() {
        command.arg("--features").arg(features.join(","));
    }
    process::run(&mut command)?;
    let built = toolchain::build_folder(core).join(target).join("release").join(binary);
    let mut name = format!("{binary}-{core}");
    for part in options.iter().map(|option| option.trim_start_matches('-')).chain(features) {
        name = format!("{name}-{part}");
    }
    let kept = kept(&name);
    copy(&built, &kept)?;
    Ok(kept)
}

fn kept(name: &str) -> PathBuf {
    places::own().join("elf").join(name).with_extension("elf")
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    if let Some(folder) = to.parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::copy(from, to).with_context(|| format!("cannot copy {} to {}", from.display(), to.display()))?;
    Ok(())
}
