//! The simulated microcontroller.

use rigident::device::microcontroller::Microcontroller;

/// The microcontroller that runs the firmware.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mcu {
    /// Compiled into this program, with a virtual clock
    #[default]
    Inproc,
    /// The release binary on an emulated Cortex-M4F
    Qemu,
}

impl From<Mcu> for Microcontroller {
    fn from(mcu: Mcu) -> Self {
        match mcu {
            Mcu::Inproc => Self::InProcess,
            Mcu::Qemu => Self::Emulated,
        }
    }
}
