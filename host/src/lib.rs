//! Library of the host command line.

pub mod answer;
pub mod identification;
