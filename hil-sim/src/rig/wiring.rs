//! Faults between the sensors and the microcontroller.

use crate::devices::Device;

/// Tells what is wired wrongly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WiringFault {
    /// The converter and the IMU hang on each other's chip select.
    Exchanged,
    /// This sensor has no supply: it drives nothing.
    Unpowered(Device),
    /// The data-ready line of this sensor is open.
    Open(Device),
}

/// The wires.
#[derive(Clone, Debug, Default)]
pub(super) struct Wiring {
    faults: Vec<WiringFault>,
}

impl Wiring {
    pub(super) fn add(&mut self, fault: WiringFault) {
        self.faults.push(fault);
    }

    /// Returns which sensor answers to a chip select; `None`: nobody.
    pub(super) fn selected(&self, by: Device) -> Option<Device> {
        let exchanged = self.faults.contains(&WiringFault::Exchanged);
        let device = match by {
            Device::LoadCell if exchanged => Device::Imu,
            Device::Imu if exchanged => Device::LoadCell,
            other => other,
        };
        (!self.faults.contains(&WiringFault::Unpowered(device))).then_some(device)
    }

    /// Returns whether the microcontroller hears of a sample of this sensor.
    pub(super) fn tells(&self, of: Device) -> bool {
        !self.faults.contains(&WiringFault::Open(of)) && !self.faults.contains(&WiringFault::Unpowered(of))
    }
}
