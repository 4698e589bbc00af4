//! Bodies and trees of links on springs: from free decay to modes, and from modes and postures to rows.
//!
//! [`modal_analysis`] separates the modes of a decaying motion; [`suspension`] makes rows of them, of still
//! postures and of driven motion, for the one fit in [`rigident_fit`].
#![forbid(unsafe_code)]

pub mod modal_analysis;
pub mod suspension;

#[cfg(test)]
#[path = "../../cli/tests/integration/study_length.rs"]
mod study_length;
