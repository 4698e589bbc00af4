//! `rigident vibration`: bodies on springs.

pub(crate) mod arguments;
#[cfg(feature = "simulator")]
pub(crate) mod demo;
pub(crate) mod identify;
pub(crate) mod postures;
pub(crate) mod stiffness;

use std::process::ExitCode;
use std::sync::atomic::Ordering;

use crate::commands::vibration::arguments::{Vibration, VibrationCommand};
use crate::{ExitStatus, Failure};
use rigident::device::session::INTERRUPTED;

/// Runs `rigident vibration`.
pub(crate) fn run(arguments: &Vibration) -> Result<ExitCode, Failure> {
    let code = match &arguments.command {
        VibrationCommand::Identify(a) => identify::run(a),
        VibrationCommand::Stiffness(a) => stiffness::run(a),
        VibrationCommand::Postures(a) => postures::run(a),
        #[cfg(feature = "simulator")]
        VibrationCommand::Demo(a) => crate::commands::vibration::demo::run(a),
    }?;
    // These commands take seconds and are gone through with; that they were to be stopped is reported by the
    // status.
    let stopped = INTERRUPTED.load(Ordering::Relaxed);
    Ok(if stopped { ExitStatus::NotIdentified.into() } else { code })
}
