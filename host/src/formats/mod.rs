//! What is kept in files: recordings, rig files, results, factors.
//!
//! Lives here: reading and writing, and every complaint about what was read, with file, line and column. May
//! not live here: what the numbers mean for a body ([`crate::identification`], [`crate::answer`]).

pub mod csv;
pub mod factor;
pub mod recording;
pub mod result;
pub mod rig;
