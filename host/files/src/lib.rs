//! The one way in and the one way out: files are read whole within limits, and written once.
//!
//! Lives here: reading of regular files up to a size, new files that are whole or not there, texts as fields
//! of a table. May not live here: what is in them.
#![forbid(unsafe_code)]

pub mod csv;
pub mod new_file;
mod read;

pub use read::{
    MOST_OF_MESH, MOST_OF_RECORDING, MOST_OF_TEXT, open, open_or_pipe, read, read_or_pipe, read_text,
};
