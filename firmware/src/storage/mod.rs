//! The data that outlive a restart: the settings of the last run and checkpoints of its factor, in flash.
//!
//! Lives here: the form of a record ([`record`]), the two journals in flash ([`Store`]), and when what is
//! written. May not live here: flash controllers (a board's), what a run is (`app`).
//! [`crate::Instrument::tend`] joins the three.
//!
//! Two journals, each of two erase sectors or more, hold records one after the other, and the last whole one
//! counts:
//!
//! - *settings*: one record for each `Configure`, with the number of the run that it begins;
//! - *checkpoints*: what has been absorbed, each with the number of its run. One of another run is void, so
//!   that a run ends with the one write that begins the next.
//!
//! A sector is erased at start-up or at `Configure` alone, for on the first boards that stops the processor
//! for a second. While samples are taken a checkpoint is only appended to what was prepared, and when that is
//! full there are no more: `Guarded` refuses to erase then, whatever the journal asks for. The interval
//! between checkpoints doubles as room is used up, so that a run of any length has some.

#[cfg(feature = "storage")]
mod journal;
#[cfg_attr(not(feature = "storage"), allow(dead_code, reason = "without a store nothing is kept"))]
mod keeping;
#[cfg(feature = "storage")]
pub mod record;
#[cfg(feature = "storage")]
mod store;

#[cfg(feature = "storage")]
pub(crate) use keeping::Duty;
pub(crate) use keeping::{Keeping, Resumption};
#[cfg(feature = "storage")]
pub use store::{CheckpointHead, Layout, LayoutError, Store, StoreError};
