//! Microcontrollers for the cases: the release image on the emulated board, or the same firmware here.

use std::io;
use std::time::Duration;

use rigident::device::link::Transport;
use rigident_shared::wire::bus::{Event, PollAnswer};
use rigident_sim::link::{ByteLink, FaultyLink, LinkFaults};
use rigident_sim::runner::{InProcess, Mcu, Qemu, QemuOptions, SensorBus};

/// The place where a case runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The release image on the emulated board.
    Board,
    /// The firmware compiled into this process.
    Process,
}

/// Boots a device with this bus behind its drivers.
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
pub struct Line {
    link: FaultyLink<Wired>,
    /// Reads that brought something until the device restarts, and what makes the next one.
    restart: Option<(usize, Reboot)>,
}

/// Boots the device anew.
pub type Reboot = Box<dyn FnOnce() -> Result<Box<dyn Mcu>, String> + Send>;

impl Line {
    /// Puts a device on a faulty line. The same seed makes the same faults of the same traffic.
    pub fn new(mcu: Box<dyn Mcu>, faults: LinkFaults) -> Self {
        Self { link: FaultyLink::new(Wired(mcu), faults, 1), restart: None }
    }

    /// Makes the device restart after this many reads that brought something.
    pub fn restarting(self, after: usize, reboot: Reboot) -> Self {
        Self { restart: Some((after, reboot)), ..self }
    }
}

/// A bus of which the board does not see every third sample of the load cell: it was busy.
pub struct Busy<B> {
    bus: B,
    samples: u64,
}

impl<B> Busy<B> {
    /// Makes the device of this bus.
    pub fn on(bus: B) -> Self {
        Self { bus, samples: 0 }
    }
}

impl<B: SensorBus> SensorBus for Busy<B> {
    fn poll(&mut self) -> PollAnswer {
        let answer = self.bus.poll();
        if answer.event != Event::LoadCellReady {
            return answer;
        }
        self.samples += 1;
        // The first tenth of a second is not missed: it is brought up meanwhile.
        if self.samples > 50 && self.samples.is_multiple_of(3) { self.bus.poll() } else { answer }
    }
    fn transfer_load_cell(&mut self, bytes: &mut [u8]) {
        self.bus.transfer_load_cell(bytes);
    }
    fn transfer_imu(&mut self, bytes: &mut [u8]) {
        self.bus.transfer_imu(bytes);
    }
}

impl Transport for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.link.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let n = self.link.read(buffer, timeout)?;
        match self.restart.take() {
            Some((0, reboot)) => self.link.inner().0 = reboot().map_err(io::Error::other)?,
            Some((left, reboot)) => self.restart = Some((left - usize::from(n > 0), reboot)),
            None => {}
        }
        Ok(n)
    }
}
