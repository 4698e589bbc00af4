//! `rigident vibration`: bodies on springs.

use std::process::ExitCode;
use std::sync::atomic::Ordering;

use super::vibration_arguments::{Vibration, VibrationCommand};
use super::{ExitStatus, Failure, vibration_identify, vibration_postures, vibration_stiffness};
use rigident::device::session::INTERRUPTED;

/// `rigident vibration`
pub(super) fn run(arguments: &Vibration) -> Result<ExitCode, Failure> {
    let code = match &arguments.command {
        VibrationCommand::Identify(a) => vibration_identify::run(a),
        VibrationCommand::Stiffness(a) => vibration_stiffness::run(a),
        VibrationCommand::Postures(a) => vibration_postures::run(a),
        #[cfg(feature = "simulator")]
        VibrationCommand::Demo(a) => super::vibration_demo::run(a),
    }?;
    // These commands take seconds and are gone through with; that they were to be stopped is reported by the
    // status.
    let stopped = INTERRUPTED.load(Ordering::Relaxed);
    Ok(if stopped { ExitStatus::NotIdentified.into() } else { code })
}
