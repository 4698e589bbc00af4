//! The device: messages over a port ([`link`]), the runs made with them ([`session`]), and how accurate its answers are ([`accuracy`]).

pub mod accuracy;
pub mod link;
pub mod session;
