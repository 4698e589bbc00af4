//! The places of things in the project.

use std::path::{Path, PathBuf};

/// Name of the emulated board's folder.
pub const BOARD: &str = "mps2-an386";
/// The board's main binary.
pub const FIRMWARE: &str = "rigident-mps2-an386";
/// Name of the folder of boards that one can buy.
pub const STM32: &str = "stm32f405";
/// Name of these boards' binary.
pub const STM32_FIRMWARE: &str = "rigident-stm32f405";
/// Name of the Pico 2's folder.
pub const PICO: &str = "rp2350";
/// Name of the Pico 2's binary.
pub const PICO_FIRMWARE: &str = "rigident-rp2350";
/// Name of the Pico 2's binary for the emulated board with the same core.
pub const KERNEL_BITS: &str = "kernel-bits";
/// The target triple of its core.
pub const PICO_TARGET: &str = "thumbv8m.main-none-eabihf";
/// The target triple of the boards with a Cortex-M4F.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Returns the project's folder.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."))
}

/// Returns the emulated board's folder, a workspace of its own.
pub fn board() -> PathBuf {
    board_named(BOARD)
}

/// Returns a board's folder by its name.
pub fn board_named(name: &str) -> PathBuf {
    root().join("firmware/boards").join(name)
}

/// Returns where cargo leaves a board's binary by itself.
fn binary(board: &str, target: &str, name: &str) -> PathBuf {
    board_named(board).join("target").join(target).join("release").join(name)
}

/// Returns where tests expect the image that is flashed.
pub fn stm32_elf() -> PathBuf {
    binary(STM32, TARGET, STM32_FIRMWARE)
}

/// Returns where tests expect the one that watches robots: beside it.
pub fn stm32_watch_elf() -> PathBuf {
    stm32_elf().with_file_name(format!("{STM32_FIRMWARE}-watch"))
}

/// Returns where the simulator expects the firmware if no other place is given.
pub fn firmware_elf() -> PathBuf {
    binary(BOARD, TARGET, FIRMWARE)
}

/// Returns where tests expect the check of the kernels on the Pico's core.
pub fn kernel_bits_elf() -> PathBuf {
    binary(PICO, PICO_TARGET, KERNEL_BITS)
}

/// Returns where the simulator expects the image that watches robots: beside the other.
pub fn watch_elf() -> PathBuf {
    firmware_elf().with_file_name(format!("{FIRMWARE}-watch"))
}

/// Returns the fuzz targets' folder, a workspace of its own.
pub fn fuzz() -> PathBuf {
    root().join("fuzz")
}

/// Returns where builds of the host workspace go.
pub fn target() -> PathBuf {
    let named = std::env::var_os("CARGO_TARGET_DIR").map(PathBuf::from);
    named.and_then(|folder| std::path::absolute(folder).ok()).unwrap_or_else(|| root().join("target"))
}

/// Returns where cargo leaves a program of the profile that developers and tests build.
pub fn built(program: &str) -> PathBuf {
    target().join("debug").join(program)
}

/// Returns where cargo leaves the program that people use.
pub fn released(program: &str) -> PathBuf {
    target().join("release").join(program)
}

/// Returns where this tool keeps what it installs and builds apart from the host's builds.
pub fn own() -> PathBuf {
    target().join("xtask")
}
