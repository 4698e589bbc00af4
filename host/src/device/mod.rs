//! The device: the ports it may be on ([`ports`]) and who may open them ([`permission`]), messages over one ([`link`]), the runs
//! made with them ([`session`]), settings as files ([`settings_file`]), and how accurate its answers are ([`accuracy`]).

pub mod accuracy;
pub mod link;
pub mod permission;
pub mod ports;
pub mod session;
pub mod settings_file;
