//! The orientations that the plate can be tilted to: for each orientation, whether some position keeps the
//! limits.
//!
//! Lives here: [`level`] and [`Spot`] (the best position in one orientation, found by descent), the exact
//! answer for the legs' lengths alone ([`shells`]), the map ([`Map`]). May not live here: drawing (the
//! command does that).

mod map;
mod settle;
pub mod shells;

pub use map::{Map, MapError, Reach, Span};
pub use settle::{Spot, level, settled};
