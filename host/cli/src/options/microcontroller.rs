//! The simulated microcontroller, and the image that it runs.

/// The microcontroller that runs the firmware.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mcu {
    /// Compiled into this program, with a virtual clock
    #[default]
    Inproc,
    /// The release binary on an emulated Cortex-M4F
    Qemu,
}

/// Names the images of the firmware for the emulated board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Image {
    /// Of bodies and trees.
    Standard,
    /// That watches robots, too.
    Watch,
}
