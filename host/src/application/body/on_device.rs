//! A person's motions streamed to the firmware, and what it makes of them beside the host's.

use crate::application::device::configured_over;
use crate::application::{BodyError, Caller, DeviceError, Error};
use rigident_device::accuracy::Accuracy;
use rigident_device::microcontroller::Microcontroller;
use rigident_device::session::tree::complaints;
use rigident_device::session::{Nobody, Take, tracked};
use rigident_fit::{Factor, Fit, Progress, Silent, plain_factor};
use rigident_identify::answer::person::DeviceResult;
use rigident_people::body_segments::{Motion, Study};
use rigident_people::person::Person;
use rigident_rows::tree::TreeSource;

/// Streams the chosen motions to the firmware; returns what it made of them beside their fit, and what to
/// warn of.
///
/// # Errors
/// A motion makes no frames, or does not fit onto the device; [`Error::Device`] if the link fails.
pub fn compared(
    mcu: &Microcontroller,
    (person, study): (&Person, &Study),
    chosen: &[usize],
    fit: &Fit,
    caller: &Caller<'_>,
) -> Result<(DeviceResult, Vec<String>), Error> {
    let mut result = DeviceResult { mcu: mcu.name().to_owned(), ..DeviceResult::default() };
    let (mut theirs, mut ours, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    for (done, k) in chosen.iter().enumerate() {
        caller.stage("the microcontroller", done as f64 / chosen.len() as f64);
        let Some(motion) = study.motions.get(*k) else { continue };
        let source = motion.source(person)?;
        let (factor, frames) = streamed(mcu, motion, &source, &mut warnings)?;
        result.frames += frames;
        result.rows += factor.rows();
        theirs.push((*k, factor));
        ours.push((*k, plain_factor(&source, &motion.sigma, &Silent)?));
    }
    let (device, host) = (study.together_by(theirs)?.estimate, study.together_by(ours)?.estimate);
    let accuracy = Accuracy::of(&device, &host);
    result.largest_difference_sd = accuracy.largest_difference_sd;
    result.share_of_allowed = accuracy.share_of_allowed;
    result.parameter = fit.parameters.get(accuracy.parameter).map_or_else(String::new, |p| p.name.clone());
    let own = fit.estimate.unjudged();
    for (j, there) in device.unjudged().values.iter().enumerate() {
        let from_answer = (there - own.values[j]).abs() / own.covariance[(j, j)].sqrt();
        result.from_answer_sd = result.from_answer_sd.max(from_answer);
    }
    warnings.extend(accuracy.complaint(&result.parameter));
    Ok((result, warnings))
}

/// Returns what the firmware makes of a motion, over the source's parameters, and how many frames it was
/// sent.
fn streamed(
    mcu: &Microcontroller,
    motion: &Motion,
    source: &TreeSource,
    warnings: &mut Vec<String>,
) -> Result<(Factor, u64), Error> {
    let of_motion = |error: DeviceError| Error::from(error).of(&motion.name);
    let (settings, map) = tracked::settings(source).map_err(|e| of_motion(e.into()))?;
    let frames = tracked::frames(source).map_err(|e| of_motion(e.into()))?;
    let input = source.input();
    let left_out = tracked::left_out(&frames, input.model.links.len());
    let sent = frames.len() as u64;
    let (line, gate) = mcu.frames(frames, input.rate_hz).map_err(DeviceError::from)?;
    let mut session = configured_over(line, &settings)?;
    let take = session.follow_frames(&*gate, map.nrows(), &mut Nobody).map_err(DeviceError::from)?;
    let Take { factor, broken, mut counters, interrupted, .. } = take;
    if let Some(broken) = broken {
        return Err(DeviceError::Broken(broken).into());
    }
    if interrupted {
        return Err(BodyError::Interrupted(motion.name.clone()).into());
    }
    // Frames that could not be used were never sent.
    counters.frames.missing = counters.frames.missing.saturating_sub(left_out);
    let names: Vec<String> = input.model.links.iter().map(|link| link.name.clone()).collect();
    warnings.extend(
        complaints(&counters.frames, &names).into_iter().map(|what| format!("{}: {what}", motion.name)),
    );
    let factor = factor.ok_or_else(|| of_motion(DeviceError::NoFactor))?.factor;
    Ok((factor.substitute(&map), sent))
}
