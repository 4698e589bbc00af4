//! `rigident vibration`: bodies on springs.

use std::process::ExitCode;

use super::vibration_arguments::{Vibration, VibrationCommand};
use super::{Failure, vibration_identify, vibration_postures};
use crate::fit::Fit;
use crate::fit::tare::Tare;
use crate::problem::suspension::bare::bare_platform;
use crate::rig::SuspensionTable;

/// `rigident vibration`
pub(super) fn run(arguments: &Vibration) -> Result<ExitCode, Failure> {
    match &arguments.command {
        VibrationCommand::Identify(a) => vibration_identify::run(a),
        VibrationCommand::Postures(a) => vibration_postures::run(a),
        #[cfg(feature = "simulator")]
        VibrationCommand::Demo(a) => super::vibration_demo::run(a),
    }
}

/// Takes the bare platform off what was found on the springs, if the rig file states it.
///
/// # Errors
/// Bad input: the platform cannot be taken off.
pub(super) fn take_platform_off(table: &SuspensionTable, found: &mut Fit) -> Result<(), Failure> {
    let Some(platform) = bare_platform(table) else { return Ok(()) };
    Tare::new(platform).and_then(|tare| tare.take_off(found)).map_err(Failure::input)
}
