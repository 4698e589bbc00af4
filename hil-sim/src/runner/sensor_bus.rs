//! The sensors as a board without an SPI peripheral reaches them.

use std::sync::{MutexGuard, PoisonError};
use std::time::Instant;

use rigident_shared::wire::bus::{Event, PollAnswer};

use super::Pacing;
use crate::devices::Device;
use crate::flash::SharedFlash;
use crate::rig::{BusEvent, Rig, SharedRig};

/// The device that answers the emulated board's bus. Every method returns at once: the machine that asks
/// stands still.
pub trait SensorBus: Send {
    /// Returns the next event, or the time if there is none.
    fn poll(&mut self) -> PollAnswer;
    /// Makes one transfer with the load cell's converter selected, in place.
    fn transfer_load_cell(&mut self, bytes: &mut [u8]);
    /// Makes one transfer with the IMU selected, in place.
    fn transfer_imu(&mut self, bytes: &mut [u8]);
    /// Makes one transfer with the second link's IMU selected, in place. Where there is none the line stays
    /// low.
    fn transfer_second_imu(&mut self, bytes: &mut [u8]) {
        bytes.fill(0);
    }
    /// Makes one request to the flash, in place. Where there is none the line stays low.
    fn transfer_flash(&mut self, bytes: &mut [u8]) {
        bytes.fill(0);
    }
    /// Makes one transfer with the source of frames selected, in place. Where there is none the line stays
    /// low.
    fn transfer_frame(&mut self, bytes: &mut [u8]) {
        bytes.fill(0);
    }
}

/// A bus with a flash that outlives its microcontroller.
pub struct WithFlash<B> {
    bus: B,
    flash: SharedFlash,
}

impl<B: SensorBus> WithFlash<B> {
    /// Joins this bus and this flash.
    pub fn new(bus: B, flash: SharedFlash) -> Self {
        Self { bus, flash }
    }
}

impl<B: SensorBus> SensorBus for WithFlash<B> {
    fn poll(&mut self) -> PollAnswer {
        self.bus.poll()
    }
    fn transfer_load_cell(&mut self, bytes: &mut [u8]) {
        self.bus.transfer_load_cell(bytes);
    }
    fn transfer_imu(&mut self, bytes: &mut [u8]) {
        self.bus.transfer_imu(bytes);
    }
    fn transfer_second_imu(&mut self, bytes: &mut [u8]) {
        self.bus.transfer_second_imu(bytes);
    }
    fn transfer_frame(&mut self, bytes: &mut [u8]) {
        self.bus.transfer_frame(bytes);
    }
    fn transfer_flash(&mut self, bytes: &mut [u8]) {
        self.flash.lock().transfer(bytes);
    }
}

/// A rig behind the bus, its clock paced.
pub struct PacedRig {
    rig: SharedRig,
    pacing: Pacing,
    /// Wall-clock instant and rig time at which the two clocks were set equal.
    origin: (Instant, u64),
}

impl PacedRig {
    /// Puts a rig behind the bus.
    pub fn new(rig: SharedRig, pacing: Pacing) -> Self {
        let now_ns = lock(&rig).now_ns();
        Self { rig, pacing, origin: (Instant::now(), now_ns) }
    }
}

/// Returns the rig, also after a panic of another of its users: its state is whole between calls.
pub(crate) fn lock(rig: &SharedRig) -> MutexGuard<'_, Rig> {
    rig.lock().unwrap_or_else(PoisonError::into_inner)
}

impl SensorBus for PacedRig {
    fn poll(&mut self) -> PollAnswer {
        let mut rig = lock(&self.rig);
        let event = match self.pacing {
            Pacing::LockStep => rig.next_event(),
            Pacing::RealTime => {
                let (instant, then_ns) = self.origin;
                let elapsed_ns = u64::try_from(instant.elapsed().as_nanos()).unwrap_or(u64::MAX);
                rig.next_event_before(then_ns.saturating_add(elapsed_ns))
            }
        };
        match event {
            BusEvent::Idle => PollAnswer { event: Event::Idle, time_ns: rig.now_ns() },
            BusEvent::LoadCellReady(time_ns) => PollAnswer { event: Event::LoadCellReady, time_ns },
            BusEvent::ImuReady(time_ns) => PollAnswer { event: Event::ImuReady, time_ns },
            BusEvent::SecondImuReady(time_ns) => PollAnswer { event: Event::SecondImuReady, time_ns },
        }
    }

    fn transfer_load_cell(&mut self, bytes: &mut [u8]) {
        lock(&self.rig).transfer(Device::LoadCell, bytes);
    }

    fn transfer_imu(&mut self, bytes: &mut [u8]) {
        lock(&self.rig).transfer(Device::Imu, bytes);
    }

    fn transfer_second_imu(&mut self, bytes: &mut [u8]) {
        lock(&self.rig).transfer(Device::SecondImu, bytes);
    }
}
