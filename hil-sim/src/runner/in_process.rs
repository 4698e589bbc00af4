//! The firmware compiled into this process.

use std::io;
use std::thread;
use std::time::{Duration, Instant};

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use rigident_firmware::{Event, Instrument, Sensor};
use rigident_shared::wire::bus::{self, PollAnswer};

use super::sensor_bus::{PacedRig, SensorBus, lock};
use super::{Mcu, Pacing};
use crate::devices::Device;
use crate::rig::SharedRig;

/// How long an idle firmware sleeps before it looks at its sensors again.
const NAP: Duration = Duration::from_micros(200);

/// A microcontroller that is part of this process. It works while its owner reads, and only then.
pub struct InProcess {
    instrument: Instrument<RigSpi, RigSpi, NoWait>,
    sensors: PacedRig,
    now_ns: u64,
}

impl InProcess {
    /// Boots the firmware with the rig's sensors behind its drivers.
    #[must_use]
    pub fn new(rig: SharedRig, pacing: Pacing) -> Self {
        let spi = |device| RigSpi { rig: rig.clone(), device, bytes: Vec::new() };
        let instrument = Instrument::new("in-process", spi(Device::LoadCell), spi(Device::Imu), NoWait);
        let now_ns = lock(&rig).now_ns();
        Self { instrument, sensors: PacedRig::new(rig, pacing), now_ns }
    }

    /// What a board does between two looks at its queues; whether there was an event.
    fn step(&mut self) -> bool {
        let PollAnswer { event, time_ns } = self.sensors.poll();
        self.now_ns = time_ns;
        self.instrument.tick(time_ns);
        let sensor = match event {
            bus::Event::LoadCellReady => Sensor::LoadCell,
            bus::Event::ImuReady => Sensor::Imu,
            bus::Event::Idle | bus::Event::Exit => return false,
        };
        self.instrument.on_event(Event { sensor, capture_time_ns: time_ns });
        true
    }
}

impl Mcu for InProcess {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.instrument.on_bytes(bytes, self.now_ns);
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let deadline = Instant::now() + timeout;
        loop {
            let n = self.instrument.poll_tx(buffer);
            if n > 0 || buffer.is_empty() {
                return Ok(n);
            }
            // Nothing is waiting to be sent, so a sample's output finds room: in lock-step none is lost.
            let busy = self.step();
            if self.instrument.tx_pending() > 0 {
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

/// A sensor of the rig as its driver sees it.
struct RigSpi {
    rig: SharedRig,
    device: Device,
    bytes: Vec<u8>,
}

impl ErrorType for RigSpi {
    type Error = std::convert::Infallible;
}

impl SpiDevice for RigSpi {
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
        lock(&self.rig).transfer(self.device, &mut self.bytes);
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
