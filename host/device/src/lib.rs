//! The device and the platform that moves it: the ports it may be on ([`ports`]) and who may open them
//! ([`permission`]), messages over one ([`link`]), firmware without a board ([`microcontroller`]), the runs
//! made with them ([`session`]) and what they are to reach ([`stop_criterion`]), settings as files
//! ([`settings_file`]), drivers of platforms ([`platform`]), the board that a load cell was calibrated with
//! ([`calibrated_board`]), how accurate its answers are ([`accuracy`]), its messages in words ([`words`],
//! [`events`]), and what is to be done where there is none ([`doctor`]).

pub mod accuracy;
pub mod calibrated_board;
pub mod doctor;
pub mod events;
pub mod link;
pub mod microcontroller;
pub mod permission;
pub mod platform;
pub mod ports;
pub mod session;
pub mod settings_file;
pub mod stop_criterion;
pub mod words;

#[cfg(test)]
#[path = "../../cli/tests/integration/study_length.rs"]
mod study_length;
