use std::io;
use std::path::PathBuf;

/// The reason why a microcontroller could not be started.
#[derive(Debug, thiserror::Error)]
pub enum RunnerError {
    /// The emulator is not installed.
    #[error(
        "the emulator {} is not installed; type `apt-get install qemu-system-arm`, or use `--mcu inproc`",
        program.display()
    )]
    EmulatorMissing {
        /// The program that was searched for.
        program: PathBuf,
    },
    /// There is no firmware to run.
    #[error(
        "no firmware at {}; type `cargo xtask firmware` to build it, or name one in RIGIDENT_FIRMWARE_ELF",
        path.display()
    )]
    FirmwareMissing {
        /// The path where it was expected.
        path: PathBuf,
    },
    /// The file is there, but it is not a firmware image with a log table.
    #[error(
        "{} is not a firmware image ({reason}); type `cargo xtask firmware` to build one",
        path.display()
    )]
    NotFirmware {
        /// The file.
        path: PathBuf,
        /// The fault in it.
        reason: String,
    },
    /// The machine refused something.
    #[error("{doing}: {source}")]
    Io {
        /// The operation under way.
        doing: &'static str,
        /// The answer.
        source: io::Error,
    },
}

impl RunnerError {
    pub(super) fn io(doing: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { doing, source }
    }
}
