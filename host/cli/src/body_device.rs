//! A person's motions streamed to the firmware, and what it makes of them beside the host's.

use super::arguments::Mcu;
use super::link::configured;
use super::{Failure, Stages, simulated};
use rigident::answer::person::DeviceResult;
use rigident::device::accuracy::Accuracy;
use rigident::device::link::Client;
use rigident::device::session::tree::complaints;
use rigident::device::session::{Nobody, Session, Take, tracked};
use rigident::people::body_segments::{Motion, Study};
use rigident::people::person::Person;
use rigident::rows::tree::TreeSource;
use rigident_fit::{Factor, Fit, Silent, plain_factor};

/// Streams some motions to the firmware; returns what it made of them, and what to warn of.
pub(super) fn compared(
    mcu: Mcu,
    (person, study): (&Person, &Study),
    chosen: &[usize],
    answer: &Fit,
    stages: &Stages,
) -> Result<(DeviceResult, Vec<String>), Failure> {
    let mut result = DeviceResult { mcu: simulated::name(mcu).to_owned(), ..DeviceResult::default() };
    let (mut theirs, mut ours, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    for (done, k) in chosen.iter().enumerate() {
        stages.at("the microcontroller", done as f64 / chosen.len() as f64);
        let Some(motion) = study.motions.get(*k) else { continue };
        let source = motion.source(person).map_err(Failure::input)?;
        let (factor, frames) = streamed(mcu, motion, &source, &mut warnings)?;
        result.frames += frames;
        result.rows += factor.rows();
        theirs.push((*k, factor));
        ours.push((*k, plain_factor(&source, &motion.sigma, &Silent).map_err(Failure::input)?));
    }
    let [device, host] = [theirs, ours].map(|factors| study.together_by(factors));
    let (device, host) = (device.map_err(Failure::input)?.estimate, host.map_err(Failure::input)?.estimate);
    let accuracy = Accuracy::of(&device, &host);
    result.largest_difference_sd = accuracy.largest_difference_sd;
    result.share_of_allowed = accuracy.share_of_allowed;
    result.parameter = answer.parameters.get(accuracy.parameter).map_or_else(String::new, |p| p.name.clone());
    for (j, there) in device.unjudged().values.iter().enumerate() {
        let own_sd = answer.estimate.unjudged().covariance[(j, j)].sqrt();
        let from_answer = (there - answer.estimate.unjudged().values[j]).abs() / own_sd;
        result.from_answer_sd = result.from_answer_sd.max(from_answer);
    }
    warnings.extend(accuracy.complaint(&result.parameter));
    Ok((result, warnings))
}

/// Returns what the firmware makes of a motion, over the source's parameters, and how many frames it was sent.
fn streamed(
    mcu: Mcu,
    motion: &Motion,
    source: &TreeSource,
    warnings: &mut Vec<String>,
) -> Result<(Factor, u64), Failure> {
    let said = |error: &dyn std::fmt::Display| Failure::input(format!("{}: {error}", motion.name));
    let (settings, map) = tracked::settings(source).map_err(|e| said(&e))?;
    let frames = tracked::frames(source).map_err(|e| said(&e))?;
    let input = source.input();
    let left_out = tracked::left_out(&frames, input.model.links.len());
    let sent = frames.len() as u64;
    let (transport, gate) = simulated::frames(mcu, frames, input.rate_hz)?;
    let mut session = Session::open(Client::new(transport)).map_err(Failure::link)?;
    configured(&mut session, &settings)?;
    let take = session.follow_frames(&gate, map.nrows(), &mut Nobody).map_err(Failure::link)?;
    let Take { factor, broken, mut counters, interrupted, .. } = take;
    if let Some(broken) = broken {
        return Err(Failure::link(broken));
    }
    if interrupted {
        return Err(Failure::input(format!("{}: interrupted", motion.name)));
    }
    // Frames that could not be used were never sent.
    counters.frames.missing = counters.frames.missing.saturating_sub(left_out);
    let names: Vec<String> = input.model.links.iter().map(|link| link.name.clone()).collect();
    warnings.extend(
        complaints(&counters.frames, &names).into_iter().map(|what| format!("{}: {what}", motion.name)),
    );
    let factor = factor.ok_or_else(|| said(&"the microcontroller gave no factor"))?.factor;
    Ok((factor.substitute(&map), sent))
}
