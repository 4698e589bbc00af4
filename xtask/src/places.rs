//! Where things are in the project.

use std::path::{Path, PathBuf};

/// Name of the emulated board's folder.
pub const BOARD: &str = "mps2-an386";
/// The board's main binary.
pub const FIRMWARE: &str = "rigident-mps2-an386";
/// The target triple of every board.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// The project's folder.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."))
}

/// The emulated board's folder, a workspace of its own.
pub fn board() -> PathBuf {
    root().join("firmware/boards").join(BOARD)
}

/// Where the simulator looks for the firmware when it is not told.
pub fn firmware_elf() -> PathBuf {
    board().join("target").join(TARGET).join("release").join(FIRMWARE)
}

/// Where the simulator looks for the image that watches robots: beside the other.
pub fn watch_elf() -> PathBuf {
    firmware_elf().with_file_name(format!("{FIRMWARE}-watch"))
}

/// The fuzz targets' folder, a workspace of its own.
pub fn fuzz() -> PathBuf {
    root().join("fuzz")
}

/// Where builds of the host workspace go.
pub fn target() -> PathBuf {
    let named = std::env::var_os("CARGO_TARGET_DIR").map(PathBuf::from);
    named.and_then(|folder| std::path::absolute(folder).ok()).unwrap_or_else(|| root().join("target"))
}

/// Where this tool keeps what it installs and builds apart from the host's builds.
pub fn own() -> PathBuf {
    target().join("xtask")
}
