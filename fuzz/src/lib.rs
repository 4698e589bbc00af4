//! Checks that fuzz targets share with tests.

#[cfg(feature = "host")]
pub mod host_decoders;
