//! Recordings, rig files, motion capture, live sources and tables of factors: all that is read from files and
//! sockets.
//!
//! [`recording`] holds the numbers of one rig in the notation, [`mod@rig`] what it was taken with,
//! [`motion_capture`] the trials of people, [`sources`] samples while they come, [`factor_table`] factors of
//! many recordings in one file, of which [`mod@union`] makes one; [`behind`] writes without waiting. What the
//! numbers mean for a body is decided
//! elsewhere.
//!
//! ```
//! use rigident_io::recording::Recording;
//! use rigident_io::rig::RigFile;
//!
//! let text = "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n0.0,0,0,-9.8,0,0,0\n0.1,0,0,-9.8,0,0,0\n";
//! let recording = Recording::from_csv_bytes("rest.csv", text.as_bytes(), &RigFile::default()).unwrap();
//! assert_eq!(recording.rows(), 2);
//! assert_eq!(recording.wrench.unwrap()[1][2], -9.8);
//! ```
#![forbid(unsafe_code)]

pub mod behind;
pub mod factor_table;
pub mod motion_capture;
mod parquet_file;
pub mod recording;
pub mod rig;
pub mod sources;
pub mod stop;
pub mod union;

#[cfg(test)]
#[path = "../../fit/src/examples.rs"]
#[allow(dead_code, reason = "tests of the fit use all of it")]
mod examples;
#[cfg(test)]
#[path = "../../cli/tests/integration/study_length.rs"]
mod study_length;
