//! The device: messages over a port ([`link`]) and the runs made with them ([`session`]).

pub mod link;
#[cfg(feature = "simulator")]
pub mod session;
