//! Sensors that people own, as streams of samples: force sensors, robots, IMUs and bridges, over the network
//! or a line.
//!
//! Lives here: addresses ([`url`]), the protocols, one file each ([`ati`], [`rtde`], [`foxglove`], [`xsens`],
//! [`lines`]), every one with a decoder that knows bytes and no sockets, beside the source that reads them;
//! the thread that listens ([`feed`]); how a source's clock goes against this computer's ([`clock`]). May not
//! live here: what is identified, files, screens.
//!
//! A source brings samples of some groups of columns, in SI units, each with the time of its own clock, if it
//! has one. Signs are the sensor's own: the rig file's `wrench_sign` is applied where streams are brought
//! together.

pub mod ati;
pub mod clock;
pub mod feed;
pub mod foxglove;
pub mod lines;
mod open;
pub mod rtde;
mod sequence;
mod socket;
mod source;
pub mod url;
pub mod xsens;

pub use open::open;
pub use sequence::{Order, Sequence};
pub use source::{Losses, OwnClock, Role, Row, Source, SourceError};
