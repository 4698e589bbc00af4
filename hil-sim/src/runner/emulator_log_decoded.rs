//! Decodes the emulated firmware's log by the format strings in its image.

use std::io::{self, Read};
use std::path::Path;

use defmt_decoder::{DecodeError, Table};

use super::emulator_log::{Log, LogLine};
use super::error::RunnerError;

/// The format strings of a firmware image.
pub(super) struct Decoder(Table);

impl Decoder {
    /// Reads them from an image.
    ///
    /// # Errors
    /// [`RunnerError::NotFirmware`] if there are none.
    pub(super) fn new(image: &[u8], path: &Path) -> Result<Self, RunnerError> {
        let refuse = |reason: String| RunnerError::NotFirmware { path: path.to_owned(), reason };
        Table::parse(image)
            .map_err(|e| refuse(e.to_string()))?
            .ok_or_else(|| refuse("it has no log table".to_owned()))
            .map(Self)
    }

    /// Decodes until the emulator closes its output.
    pub(super) fn follow(
        &self,
        output: &mut impl Read,
        log: &Log,
        mut each: impl FnMut(&LogLine),
    ) -> io::Result<()> {
        let mut decoder = self.0.new_stream_decoder();
        let mut chunk = [0; 1024];
        loop {
            let n = match output.read(&mut chunk) {
                Ok(0) => return Ok(()),
                Ok(n) => n,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                Err(e) => return Err(e),
            };
            decoder.received(&chunk[..n]);
            loop {
                let line = match decoder.decode() {
                    Ok(frame) => LogLine {
                        level: frame.level().map_or("print", |level| level.as_str()),
                        message: frame.display_message().to_string(),
                    },
                    Err(DecodeError::UnexpectedEof) => break,
                    Err(DecodeError::Malformed) => {
                        LogLine { level: "error", message: "a log frame that cannot be decoded".to_owned() }
                    }
                };
                each(&line);
                log.push(line);
            }
        }
    }
}
