//! Why a job with a device has no answer.

use std::path::PathBuf;

use rigident_shared::wire::{ErrorCode, SettingName, Settings};

use rigident_device::link::LinkError;
use rigident_device::microcontroller::MicrocontrollerError;
use rigident_device::session::frames::NoFrames;
use rigident_device::session::tree::DeviceTreeError;
use rigident_device::session::two_links::TwoLinkError;
use rigident_device::session::{SessionError, SettingsError};
use rigident_device::stop_criterion::StopError;

/// The fastest that firmware takes readings, 1/s.
const MOST_RATE_HZ: u32 = 4000;

/// Why a job with a device has no answer.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// The link.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The run.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The microcontroller.
    #[error(transparent)]
    Microcontroller(#[from] MicrocontrollerError),
    /// The rig file lacks something that the device needs.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The tree is none for the device.
    #[error(transparent)]
    Tree(#[from] DeviceTreeError),
    /// The two links are none for the device.
    #[error(transparent)]
    TwoLinks(#[from] TwoLinkError),
    /// The recording makes no frames.
    #[error(transparent)]
    Frames(#[from] NoFrames),
    /// The stop criterion.
    #[error(transparent)]
    Stop(#[from] StopError),
    /// The device takes no readings so fast, or has no room for the filter.
    #[error(
        "the device does not take rate_hz = {rate_hz} with a filter of {filter_width_s} s and a row every \
         {row_every} readings: it takes up \
         to {MOST_RATE_HZ} readings a second, and as many as its filter has room for; nothing was changed"
    )]
    TooFast {
        /// Readings a second.
        rate_hz: f32,
        /// Width of the filter, s.
        filter_width_s: f32,
        /// Readings from one row to the next.
        row_every: u16,
    },
    /// The device takes no such setting.
    #[error(
        "the device does not take the setting {0:?}; nothing was changed: look at it in the rig file or \
         settings file"
    )]
    Setting(SettingName),
    /// A recording without the wrench that the device estimates from; holds its file.
    #[error(
        "{}: the device estimates from the wrench of a load cell (fx_n to mz_nm), and there is none; \
         `identify()` takes joint \
         torques",
        .0.display()
    )]
    NoWrench(PathBuf),
    /// A recording that makes no rows on springs; holds its file.
    #[error("{}: no rows on springs come of it", .0.display())]
    NotOnSprings(PathBuf),
    /// Frames are for a simulated microcontroller.
    #[error(
        "`mcu` {port}: frames of {} come over the device's sensor bus, which is simulated here: say inproc \
         or qemu{}",
        if *on_springs { "bodies on springs" } else { "a tree" },
        if *on_springs { "" } else { ". A port takes recordings of one body and of two links" }
    )]
    FramesOverPort {
        /// The port.
        port: String,
        /// The frames are of bodies on springs, not of a tree.
        on_springs: bool,
    },
    /// A run broke off, in words.
    #[error("{0}")]
    Broken(String),
    /// The device gave no factor.
    #[error("the microcontroller gave no factor")]
    NoFactor,
    /// The rows are not those of a load cell.
    #[error("the rows are not those of a load cell")]
    NoLoadCell,
    /// The bare platform is to be taken off twice.
    #[error("`tare`: [suspension.platform] of the rig file is taken off already; leave one of them out")]
    PlatformTwice,
}

impl DeviceError {
    /// Returns why a device does not take settings.
    pub fn of_settings(error: LinkError, settings: &Settings) -> Self {
        match error {
            LinkError::Refused {
                code: ErrorCode::BadSetting(SettingName::Rate | SettingName::Filter),
                ..
            } => Self::TooFast {
                rate_hz: settings.rate_hz,
                filter_width_s: settings.filter_width_s,
                row_every: settings.row_every,
            },
            LinkError::Refused { code: ErrorCode::BadSetting(name), .. } => Self::Setting(name),
            other => Self::Link(other),
        }
    }

    /// Returns true if the link or the hardware failed, false if something was asked for that cannot be.
    pub fn is_of_the_link(&self) -> bool {
        match self {
            Self::Link(_) | Self::Session(_) | Self::Broken(_) => true,
            Self::Microcontroller(error) => error.is_of_the_link(),
            _ => false,
        }
    }
}
