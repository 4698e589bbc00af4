//! `rigident calibrate joints`: offsets of joint angles from poses with flat soles.

use std::process::ExitCode;

use crate::commands::calibrate::arguments::CalibrateJoints;
use crate::commands::factor;
use crate::screen::outcome::{say, say_object};
use crate::screen::terms::in_own_terms;
use crate::{ExitStatus, Failure};
use rigident::application::{Caller, JointOptions, joint_offsets};
use rigident::joint_offsets::Noise;
use rigident::joint_offsets::result::Coarsest;
use rigident::joint_offsets::search::Method;
use rigident_io::recording::new_file::write_new_text;
use rigident_model::write;

/// The heading's largest σ, degrees.
const LARGEST_YAW_DEG: f64 = 180.0;

/// Runs `rigident calibrate joints`.
pub(crate) fn run(arguments: &CalibrateJoints) -> Result<ExitCode, Failure> {
    for path in [&arguments.output, &arguments.report].into_iter().flatten() {
        factor::absent(path)?;
    }
    if let Some(path) = &arguments.write_model {
        write::check_target(path).map_err(Failure::input)?;
    }
    let options = JointOptions {
        joints: arguments.joints.clone(),
        noise: noise(arguments)?,
        coarsest: Coarsest {
            rad: positive("--coarsest-u95-deg", arguments.coarsest_u95_deg)?.to_radians(),
            m: 1e-3 * positive("--coarsest-u95-mm", arguments.coarsest_u95_mm)?,
        },
        method: Method::from(arguments.method),
    };
    let CalibrateJoints { model, poses, contacts, .. } = arguments;
    let mut found = joint_offsets(model, poses, contacts, &options, &Caller::default())?;
    if let Some(path) = &arguments.output {
        write_new_text(path, &in_own_terms(&found.answer.rig_tables())).map_err(Failure::input)?;
    }
    if let Some(path) = &arguments.write_model {
        found.write_model(path)?;
    }
    if let Some(path) = &arguments.report {
        write_new_text(path, &in_own_terms(&found.page())).map_err(Failure::input)?;
    }
    if arguments.json {
        say_object(&found)?;
    } else {
        say(found.text());
        found.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    }
    Ok(ExitStatus::of(found.offsets.iter().all(|offset| offset.value.is_some())).into())
}

/// Returns the value of an option that must be greater than zero.
///
/// # Errors
/// Bad input: it is not.
pub(crate) fn positive(option: &str, value: f64) -> Result<f64, Failure> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(Failure::input(format!("{option} {value}: must be finite and greater than zero")))
}

fn noise(arguments: &CalibrateJoints) -> Result<Noise, Failure> {
    let from_zero = |option: &str, value: f64| {
        if value == 0.0 { Ok(0.0) } else { positive(option, value) }
    };
    let attitude = positive("--attitude-noise-deg", arguments.attitude_noise_deg)?;
    let yaw = arguments.yaw_noise_deg.map_or(Ok(attitude), |yaw| positive("--yaw-noise-deg", yaw))?;
    if yaw > LARGEST_YAW_DEG {
        return Err(Failure::input(format!(
            "--yaw-noise-deg {yaw}: must be at most {LARGEST_YAW_DEG}, from which on headings say nothing"
        )));
    }
    Ok(Noise {
        attitude_rad: attitude.to_radians(),
        yaw_rad: yaw.to_radians(),
        height_m: 1e-3 * positive("--height-noise-mm", arguments.height_noise_mm)?,
        floor_rad: from_zero("--floor-noise-deg", arguments.floor_noise_deg)?.to_radians(),
        encoder_rad: from_zero("--encoder-noise-deg", arguments.encoder_noise_deg)?.to_radians(),
        slide_m: 1e-3 * from_zero("--encoder-noise-mm", arguments.encoder_noise_mm)?,
        mounting_rad: from_zero("--mounting-noise-deg", arguments.mounting_noise_deg)?.to_radians(),
    })
}
