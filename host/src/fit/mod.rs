//! The information factor on the host, and what is done with it.

pub mod factor_file;
