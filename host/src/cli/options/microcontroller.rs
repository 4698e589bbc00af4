//! Which simulated microcontroller.

/// The microcontroller that runs the firmware.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mcu {
    /// Compiled into this program, with a virtual clock
    #[default]
    Inproc,
    /// The release binary on an emulated Cortex-M4F
    Qemu,
}
