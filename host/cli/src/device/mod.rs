//! The parts that commands with a device share: the link, an experiment as it runs and its end.

pub(crate) mod experiment;
pub(crate) mod link;
pub(crate) mod report;
pub(crate) mod tracking_error;
