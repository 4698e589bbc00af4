//! A build without the decoder reads the log, so that the emulator does not wait, and keeps nothing of it.

use std::io::{self, Read};
use std::path::Path;

use super::emulator_log::{Log, LogLine};
use super::error::RunnerError;

/// Stands in for the format strings of a firmware image.
pub(super) struct Decoder;

impl Decoder {
    /// Takes any image.
    pub(super) fn new(_image: &[u8], _path: &Path) -> Result<Self, RunnerError> {
        Ok(Self)
    }

    /// Reads until the emulator closes its output.
    pub(super) fn follow(
        &self,
        output: &mut impl Read,
        _log: &Log,
        _each: impl FnMut(&LogLine),
    ) -> io::Result<()> {
        io::copy(output, &mut io::sink()).map(drop)
    }
}
