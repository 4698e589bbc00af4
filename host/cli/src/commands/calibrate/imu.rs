//! `rigident calibrate imu`: an IMU by the motion that the platform drove it through.

use std::process::ExitCode;

use crate::commands::calibrate::arguments::CalibrateImu;
use crate::screen::outcome::{say, say_in_one_line};
use crate::{ExitStatus, Failure};
use rigident::application::DrivenImu;

/// Runs `rigident calibrate imu`.
pub(crate) fn run(arguments: &CalibrateImu) -> Result<ExitCode, Failure> {
    let driven = DrivenImu::read(&arguments.recording, arguments.rig.as_deref())?;
    let program = arguments.programme.program(&driven.geometry)?;
    driven.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    let found = driven.calibrate(&program)?;
    if arguments.json {
        say_in_one_line(&found)?;
    } else {
        say(&found);
    }
    Ok(ExitStatus::of(found.is_whole()).into())
}
