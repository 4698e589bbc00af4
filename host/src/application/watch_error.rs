//! Why a link is not watched.

use rigident_shared::wire::SettingName;

use rigident_device::session::watched;

/// Why a link is not watched.
#[derive(Debug, thiserror::Error)]
pub enum WatchError {
    /// The rate of false alarms is none that could be kept.
    #[error("`false_alarms_per_hour` {0}: give a number above 0, at most 60")]
    FalseAlarms(f64),
    /// The time to settle is too short or too long, s.
    #[error("`settle_s` {0}: give 1 to 3600 s")]
    Settle(f64),
    /// Nothing describes the robot.
    #[error("the firmware watches a robot whose description it is given: `model` FILE")]
    NoModel,
    /// The robot cannot be watched.
    #[error(transparent)]
    Robot(#[from] watched::WatchError),
    /// A simulated microcontroller has no line.
    #[error("`baud` {baud}: {mcu} has no line with a rate; leave it out")]
    NoLine {
        /// The rate that was asked for.
        baud: u32,
        /// The microcontroller.
        mcu: &'static str,
    },
    /// The line is too slow for the robot's frames.
    #[error(
        "{port}: {rate_hz:.0} frames a second of {links} links and {feet} sensors of forces are {need:.0} \
         baud, and the line carries {baud}, of \
         which a twentieth is for the rest: give it a higher rate (`baud`, up to 3000000), record fewer \
         frames a second (60 at least), or weld \
         links that do not move"
    )]
    SlowLine {
        /// The port.
        port: String,
        /// Frames a second.
        rate_hz: f64,
        /// Links of the robot.
        links: usize,
        /// The robot's force sensors.
        feet: usize,
        /// The rate that the frames need, baud.
        need: f64,
        /// The rate of the line, baud.
        baud: u32,
    },
    /// The device's firmware was built without.
    #[error(
        "this device runs an image without the feature `watch`, as the standard one is: flash the other one"
    )]
    NotBuiltIn,
    /// The device's line does not go up to that rate.
    #[error("`baud`: the device's line does not go up to that rate; take a lower one")]
    LineRate,
    /// A number of a link is none.
    #[error("the firmware does not take link {0} of the model: a number is none")]
    Link(u8),
    /// The device refuses something else.
    #[error("the firmware does not take the setting {0:?}")]
    Setting(SettingName),
}
