//! The place of a sensor that is absent.

use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};

/// A sensor that a board has no way to: every transfer fails.
pub struct Absent;

impl ErrorType for Absent {
    type Error = ErrorKind;
}

impl SpiDevice for Absent {
    fn transaction(&mut self, _: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        Err(ErrorKind::Other)
    }
}
