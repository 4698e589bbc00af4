//! The view while an experiment runs: one object, drawn in a terminal ([`draw`]) and sent to Foxglove
//! ([`foxglove`]).
//!
//! Lives here: the object [`View`], made of an answer and of what is counted on the way, and what is made of
//! it. May not live here: where readings come from, threads that fit them, keys of a terminal (`cli`).

#[cfg(not(target_family = "wasm"))]
pub mod draw;
pub mod foxglove;
mod view;

pub use view::{Answered, Band, Counted, LinkHealth, ParameterView, SensorHealth, View};
