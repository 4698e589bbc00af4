//! A source of frames of a tree in motion: one transfer, one frame ([`rigident_shared::wire::tree_frame`]).

use embedded_hal::spi::{Operation, SpiDevice};
use rigident_shared::wire::tree_frame::{MAX_TREE_FRAME, TrackedFrame, TreeFrame, TreeFrameError};

/// Tells why there is no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// The bus failed.
    Bus,
    /// The received bytes are no frame, or damaged.
    Damaged,
    /// The frame is of a tree with this number of links.
    Links(u8),
}

/// Tells what frames bring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameKind {
    /// The motion of links; the base carries an IMU.
    Imu,
    /// The motion of links; cameras track the base.
    Tracked,
}

/// A frame of the one kind or the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AnyFrame<'a> {
    /// The base carries an IMU.
    Imu(TreeFrame<'a>),
    /// Cameras track the base.
    Tracked(TrackedFrame<'a>),
}

impl<'a> AnyFrame<'a> {
    /// Returns the frame of the wanted kind that `bytes` begin with.
    ///
    /// # Errors
    /// See [`TreeFrame::decode`].
    pub fn decode(bytes: &'a [u8], links: usize, kind: FrameKind) -> Result<Self, TreeFrameError> {
        match kind {
            FrameKind::Imu => TreeFrame::decode(bytes, links).map(Self::Imu),
            FrameKind::Tracked => TrackedFrame::decode(bytes, links).map(Self::Tracked),
        }
    }

    /// Returns the frame's number.
    pub fn number(&self) -> u32 {
        match self {
            Self::Imu(frame) => frame.number,
            Self::Tracked(frame) => frame.number,
        }
    }
}

/// The source, and room for one frame.
pub struct FrameSource<SPI> {
    spi: SPI,
    bytes: [u8; MAX_TREE_FRAME],
}

impl<SPI: SpiDevice> FrameSource<SPI> {
    /// Makes a source on this bus. Nothing is sent yet.
    pub fn new(spi: SPI) -> Self {
        Self { spi, bytes: [0; MAX_TREE_FRAME] }
    }

    /// Clocks out the frame that was signalled, of a tree of the given number of links and of this kind.
    ///
    /// # Errors
    /// [`FrameError`]: there is none that can be used.
    pub fn read(&mut self, links: usize, kind: FrameKind) -> Result<AnyFrame<'_>, FrameError> {
        let length = match kind {
            FrameKind::Imu => TreeFrame::bytes(links),
            FrameKind::Tracked => TrackedFrame::bytes(links),
        };
        let bytes = self.bytes.get_mut(..length).ok_or(FrameError::Bus)?;
        bytes.fill(0);
        self.spi.transaction(&mut [Operation::TransferInPlace(bytes)]).map_err(|_| FrameError::Bus)?;
        AnyFrame::decode(bytes, links, kind).map_err(|error| match error {
            TreeFrameError::Damaged => FrameError::Damaged,
            TreeFrameError::Links(count) => FrameError::Links(count),
        })
    }
}
