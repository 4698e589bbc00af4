//! `rigident vibration`: bodies on springs.

use std::process::ExitCode;

use super::vibration_arguments::{Vibration, VibrationCommand};
use super::{Failure, vibration_identify, vibration_postures, vibration_stiffness};

/// `rigident vibration`
pub(super) fn run(arguments: &Vibration) -> Result<ExitCode, Failure> {
    match &arguments.command {
        VibrationCommand::Identify(a) => vibration_identify::run(a),
        VibrationCommand::Stiffness(a) => vibration_stiffness::run(a),
        VibrationCommand::Postures(a) => vibration_postures::run(a),
        #[cfg(feature = "simulator")]
        VibrationCommand::Demo(a) => super::vibration_demo::run(a),
    }
}
