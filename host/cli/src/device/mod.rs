//! The parts that commands with a device share: the link, an experiment as it runs and its end.

#[cfg(not(target_family = "wasm"))]
pub(crate) mod experiment;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod link;
pub(crate) mod report;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod tracking_error;
