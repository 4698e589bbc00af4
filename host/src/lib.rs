//! Library of the host command line.

pub mod answer;
pub mod identification;
pub mod report;
