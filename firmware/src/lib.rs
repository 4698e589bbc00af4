//! The portable application of the microcontroller.
//!
//! Lives here: the states and commands ([`App`]), what happens to every sample ([`sample_path`]) and frame
//! ([`frame_path`], [`watch_path`]), the device's end of the line, the sensor drivers, the ring that
//! interrupts fill ([`capture`]), whether the program goes on ([`progress`]), and the [`Instrument`] that
//! joins them. May not live here: pins, clocks, interrupts, anything of one board (that is
//! `firmware/boards`), or mathematics that the host needs too (that is `rigident_shared`).
//!
//! No heap, no I/O, no clock: bytes, samples and the time are handed in, bytes are taken out.
#![no_std]

mod app;
pub mod capture;
pub mod drivers;
mod estimate;
mod events;
pub mod frame_path;
mod instrument;
mod link;
mod log;
mod place;
#[cfg(any(feature = "plant-double", feature = "plant-panic"))]
mod planted;
pub mod progress;
mod rates;
pub mod sample_path;
mod settings;
pub mod storage;
mod version;
pub mod watch_path;

pub use app::{App, BringUpError, Sensor, SensorRates};
pub use events::EventRoom;
pub use instrument::{Buses, Event, Instrument};
pub use version::FIRMWARE_HASH;

/// Room for the estimator of whatever is configured. A board keeps it where it likes, away from its stack: it
/// is by far the largest thing the application has. [`Path::EMPTY`] is all zero bits.
#[derive(Clone, Default)]
#[repr(u8)]
#[allow(clippy::large_enum_variant, reason = "no heap")]
pub enum Path {
    /// Nothing is configured.
    #[default]
    Empty = 0,
    /// One body, or two links.
    Samples(sample_path::SamplePath) = 1,
    /// A tree of links, from frames.
    Frames(frame_path::FramePath) = 2,
    /// A robot that is watched, from frames.
    Watch(watch_path::WatchPath) = 3,
}

// One level of 128 parameters, its block, and what else a tree takes.
const _: () = assert!(size_of::<Path>() <= 64 * 1024);

impl Path {
    /// Nothing is configured.
    pub const EMPTY: Self = Self::Empty;

    fn samples(&self) -> Option<&sample_path::SamplePath> {
        match self {
            Self::Samples(path) => Some(path),
            _ => None,
        }
    }

    fn samples_mut(&mut self) -> Option<&mut sample_path::SamplePath> {
        match self {
            Self::Samples(path) => Some(path),
            _ => None,
        }
    }

    fn watch(&self) -> Option<&watch_path::WatchPath> {
        match self {
            Self::Watch(path) if cfg!(feature = "watch") => Some(path),
            _ => None,
        }
    }

    fn watch_mut(&mut self) -> Option<&mut watch_path::WatchPath> {
        match self {
            Self::Watch(path) if cfg!(feature = "watch") => Some(path),
            _ => None,
        }
    }

    fn frames(&self) -> Option<&frame_path::FramePath> {
        match self {
            Self::Frames(path) if cfg!(feature = "frames") => Some(path),
            _ => None,
        }
    }

    fn frames_mut(&mut self) -> Option<&mut frame_path::FramePath> {
        match self {
            Self::Frames(path) if cfg!(feature = "frames") => Some(path),
            _ => None,
        }
    }
}
