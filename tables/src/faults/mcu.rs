//! Microcontrollers for the cases: the release image on the emulated board, or the same firmware here.

use std::io;
use std::time::Duration;

use rigident::device::link::Transport;
use rigident_sim::link::{ByteLink, FaultyLink, LinkFaults};
use rigident_sim::runner::{InProcess, Mcu, Qemu, QemuOptions, SensorBus};

/// Where a case runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The release image on the emulated board.
    Board,
    /// The firmware compiled into this process.
    Process,
}

/// A device with this bus behind its drivers.
pub fn boot(place: Place, bus: Box<dyn SensorBus>) -> Result<Box<dyn Mcu>, String> {
    Ok(match place {
        Place::Board => {
            Box::new(Qemu::spawn_on(&QemuOptions::default(), bus).map_err(|error| error.to_string())?)
        }
        Place::Process => Box::new(InProcess::on(bus)),
    })
}

/// A device at the end of a good line.
pub struct Wired(pub Box<dyn Mcu>);

impl ByteLink for Wired {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.read(buffer, timeout)
    }
}

/// A device at the end of a line with faults.
pub struct Line(FaultyLink<Wired>);

impl Line {
    /// The same seed makes the same faults of the same traffic.
    pub fn new(mcu: Box<dyn Mcu>, faults: LinkFaults) -> Self {
        Self(FaultyLink::new(Wired(mcu), faults, 1))
    }
}

impl Transport for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.read(buffer, timeout)
    }
}
