//! A person in motion: from markers and force plates to the frames of a tree whose base is tracked.
//!
//! Lives here: trials of one person brought to a model of hers ([`people`]), every frame's pose and
//! coordinates ([`coordinates`]), strides ([`strides`]), the delay between plates and cameras
//! ([`alignment`]), frames that the plates did not measure wholly ([`contact`]) or that something beside the
//! plates pushes in ([`Unmeasured`]), zeros of plates (`zeros`), whether they are level ([`Tilt`]), where
//! feet say that plates are (`footprints`), and whether motion and forces can be of one person. May not live
//! here: files, poses of single frames, and rows.

pub mod alignment;
pub mod another;
pub mod anthropometry;
mod compared;
pub mod contact;
pub mod coordinates;
mod cut_off;
mod error;
mod footprints;
pub mod gaps;
mod level;
pub mod noise;
pub mod people;
mod plausible;
mod poses;
pub mod strides;
#[cfg(test)]
mod tests;
mod tilt;
pub mod track;
mod unmeasured;
mod zeros;

pub use error::PersonError;
pub use footprints::{Footprint, footprints};
pub use people::{PeopleOptions, Person};
pub use tilt::Tilt;
pub use track::{TrackReport, Tracked};
pub use unmeasured::Unmeasured;
