//! A source of frames of a tree in motion: one transfer, one frame ([`rigident_shared::wire::tree_frame`]).

use embedded_hal::spi::{Operation, SpiDevice};
use rigident_shared::wire::tree_frame::{MAX_TREE_FRAME, TreeFrame, TreeFrameError, tree_frame_bytes};

/// Tells why there is no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// The bus failed.
    Bus,
    /// The bytes that came are no frame, or damaged.
    Damaged,
    /// It is of a tree with so many links.
    Links(u8),
}

/// The source, and room for one frame.
pub struct FrameSource<SPI> {
    spi: SPI,
    bytes: [u8; MAX_TREE_FRAME],
}

impl<SPI: SpiDevice> FrameSource<SPI> {
    /// On this bus. Nothing is sent yet.
    pub fn new(spi: SPI) -> Self {
        Self { spi, bytes: [0; MAX_TREE_FRAME] }
    }

    /// Clocks out the frame that was signalled, of a tree of so many links.
    ///
    /// # Errors
    /// [`FrameError`]: there is none that can be used.
    pub fn read(&mut self, links: usize) -> Result<TreeFrame<'_>, FrameError> {
        let bytes = self.bytes.get_mut(..tree_frame_bytes(links)).ok_or(FrameError::Bus)?;
        bytes.fill(0);
        self.spi.transaction(&mut [Operation::TransferInPlace(bytes)]).map_err(|_| FrameError::Bus)?;
        TreeFrame::decode(bytes, links).map_err(|error| match error {
            TreeFrameError::Damaged => FrameError::Damaged,
            TreeFrameError::Links(count) => FrameError::Links(count),
        })
    }
}
