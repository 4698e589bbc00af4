//! What is kept in files: recordings, rig files, results, factors.
//!
//! Lives here: reading and writing, and every complaint about what was read, with file, line and column. May
//! not live here: what the numbers mean for a body ([`crate::identification`], [`crate::answer`]).
//!
//! A recording is [`recording::Recording`] in memory, whichever of its two forms it came from: text
//! ([`csv`], with [`columns`] and [`time`]) or messages ([`mcap`]). [`convert`] goes between them.

pub mod columns;
pub mod convert;
pub mod csv;
pub mod error;
pub mod factor;
pub mod mcap;
pub mod new_file;
pub mod recording;
pub mod result;
pub mod rig;
pub mod spelling;
pub mod time;
