//! The device and the platform that moves it: the ports it may be on ([`ports`]) and who may open them
//! ([`permission`]), messages over one ([`link`]), the runs made with them ([`session`]), settings as files
//! ([`settings_file`]), drivers of platforms ([`platform`]), the board that a load cell was calibrated with
//! ([`calibrated_board`]), and how accurate its answers are ([`accuracy`]).

pub mod accuracy;
pub mod calibrated_board;
pub mod link;
pub mod permission;
pub mod platform;
pub mod ports;
pub mod session;
pub mod settings_file;

#[cfg(test)]
#[path = "../../cli/tests/integration/study_length.rs"]
mod study_length;
