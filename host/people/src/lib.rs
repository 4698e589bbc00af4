//! People in motion: from markers to poses, from poses and force plates to rows, and from rows to segments.
//!
//! [`inverse_kinematics`] fits a skeleton to markers, [`person`] makes rows of a person's trials, and
//! [`body_segments`] judges how far the data give each segment's own parameters.
#![forbid(unsafe_code)]

pub mod body_segments;
pub mod inverse_kinematics;
pub mod person;
