//! The firmware compiled into this process.

use std::io;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use rigident_firmware::storage::Store;
use rigident_firmware::{Buses, Event, Instrument, Path, Sensor};
use rigident_shared::wire::bus::{self, PollAnswer};

use super::bus_flash::{BusFlash, SharedBus, lock, store};
use super::sensor_bus::{PacedRig, SensorBus};
use super::{Mcu, Pacing};
use crate::devices::Device;
use crate::rig::SharedRig;

/// The time that an idle firmware sleeps before it checks its sensors again.
const NAP: Duration = Duration::from_micros(200);

/// A microcontroller that is part of this process. It works while its owner reads, be it into an empty
/// buffer, and only then.
pub struct InProcess {
    instrument: Instrument<Box<Path>, BusSpi, BusSpi, BusSpi, NoWait>,
    sensors: SharedBus,
    store: Option<Store<BusFlash>>,
    now_ns: u64,
}

impl InProcess {
    /// Boots the firmware with the rig's sensors behind its drivers.
    #[must_use]
    pub fn new(rig: SharedRig, pacing: Pacing) -> Self {
        let now_ns = super::lock(&rig).now_ns();
        Self { now_ns, ..Self::on(Box::new(PacedRig::new(rig, pacing))) }
    }

    /// Boots the firmware with `bus` behind its sensor drivers.
    #[must_use]
    pub fn on(bus: Box<dyn SensorBus>) -> Self {
        let sensors: SharedBus = Arc::new(Mutex::new(bus));
        let spi = |device| BusSpi { bus: Arc::clone(&sensors), device, bytes: Vec::new() };
        let buses = Buses {
            load_cell: spi(On::Sensor(Device::LoadCell)),
            imus: [spi(On::Sensor(Device::Imu)), spi(On::Sensor(Device::SecondImu))],
            frames: spi(On::Frames),
        };
        let instrument = Instrument::new("in-process", Box::new(Path::EMPTY), buses, NoWait);
        let store = store(Arc::clone(&sensors));
        Self { instrument, sensors, store, now_ns: 0 }
    }

    fn tend(&mut self) {
        if let Some(store) = &mut self.store {
            self.instrument.tend(store);
        }
    }

    /// Returns what a board does between two checks of its queues; whether there was an event.
    fn step(&mut self) -> bool {
        let PollAnswer { event, time_ns } = lock(&self.sensors).poll();
        self.now_ns = time_ns;
        self.instrument.tick(time_ns);
        let sensor = match event {
            bus::Event::LoadCellReady => Sensor::LoadCell,
            bus::Event::ImuReady => Sensor::Imu,
            bus::Event::SecondImuReady => Sensor::SecondImu,
            bus::Event::FrameReady => Sensor::Frames,
            bus::Event::Idle | bus::Event::Exit => return false,
        };
        self.instrument.on_event(Event { sensor, capture_time_ns: time_ns });
        self.tend();
        true
    }
}

impl Mcu for InProcess {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        // What is stored is known before the first word.
        self.tend();
        // Byte by byte, as a line brings them: what one asks of the flash is done before the next.
        for byte in bytes {
            self.instrument.on_bytes(std::slice::from_ref(byte), self.now_ns);
            self.tend();
        }
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let deadline = Instant::now() + timeout;
        loop {
            let n = self.instrument.poll_tx(buffer);
            if n > 0 {
                return Ok(n);
            }
            // Nothing is waiting to be sent, so a sample's output finds room: in lock-step none is lost.
            let busy = self.step();
            if self.instrument.tx_pending() > 0 && !buffer.is_empty() {
                continue;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(0);
            }
            if !busy {
                thread::sleep(left.min(NAP));
            }
        }
    }

    fn name(&self) -> &'static str {
        "inproc"
    }
}

/// The device of a transfer.
#[derive(Clone, Copy)]
enum On {
    Sensor(Device),
    Frames,
}

/// A sensor on the bus as its driver sees it.
struct BusSpi {
    bus: SharedBus,
    device: On,
    bytes: Vec<u8>,
}

impl ErrorType for BusSpi {
    type Error = std::convert::Infallible;
}

impl SpiDevice for BusSpi {
    fn transaction(&mut self, parts: &mut [Operation<'_, u8>]) -> Result<(), Self::Error> {
        self.bytes.clear();
        for part in parts.iter() {
            let from = self.bytes.len();
            let clocked = match part {
                Operation::Read(input) => input.len(),
                Operation::Write(output) => {
                    self.bytes.extend_from_slice(output);
                    output.len()
                }
                Operation::Transfer(input, output) => {
                    self.bytes.extend_from_slice(output);
                    input.len().max(output.len())
                }
                Operation::TransferInPlace(both) => {
                    self.bytes.extend_from_slice(both);
                    both.len()
                }
                Operation::DelayNs(_) => 0,
            };
            self.bytes.resize(from + clocked, 0);
        }
        let mut bus = lock(&self.bus);
        match self.device {
            On::Sensor(Device::LoadCell) => bus.transfer_load_cell(&mut self.bytes),
            On::Sensor(Device::Imu) => bus.transfer_imu(&mut self.bytes),
            On::Sensor(Device::SecondImu) => bus.transfer_second_imu(&mut self.bytes),
            On::Frames => bus.transfer_frame(&mut self.bytes),
        }
        drop(bus);
        let mut answer = self.bytes.iter();
        for part in parts {
            let (input, clocked): (&mut [u8], usize) = match part {
                Operation::Read(input) => {
                    let n = input.len();
                    (input, n)
                }
                Operation::Write(output) => (&mut [], output.len()),
                Operation::Transfer(input, output) => {
                    let n = input.len().max(output.len());
                    (input, n)
                }
                Operation::TransferInPlace(both) => {
                    let n = both.len();
                    (both, n)
                }
                Operation::DelayNs(_) => (&mut [], 0),
            };
            let mut slots = input.iter_mut();
            for byte in answer.by_ref().take(clocked) {
                if let Some(slot) = slots.next() {
                    *slot = *byte;
                }
            }
        }
        Ok(())
    }
}

/// Simulated sensors settle at once: nothing is waited for.
struct NoWait;

impl DelayNs for NoWait {
    fn delay_ns(&mut self, _: u32) {}
}
