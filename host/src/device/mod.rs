//! The device: messages over a port ([`link`]) and the runs made with them ([`session`]).

pub mod link;
pub mod session;
