//! From a factor to an answer.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Instant;

use super::bare_platform::take_platform_off;
use super::tare::{Fixture, ReadWith, take_off, tare};
use super::{Caller, Error, Identified, Notice, Report, Tree};
use rigident_identify::answer::Source;

use rigident_fit::pool::{PooledFactor, disagreement_in_words};
use rigident_fit::prior::KnownValues;
use rigident_fit::{Fit, Parameter};
use rigident_io::rig::RigFile;
use rigident_vibration::suspension::bare::is_stated;

/// The way a factor is solved.
#[derive(Clone, Debug, Default)]
pub struct SolveOptions {
    /// Rig file: its `[body]` and `[truth]`, and what recordings of a tare were taken with.
    pub rig: Option<PathBuf>,
    /// Take the bare platform off, which `[suspension.platform]` of the rig file states.
    pub without_platform: bool,
    /// Runs with the bare fixture, which is taken off.
    pub tare: Vec<Fixture>,
    /// The prior knowledge.
    pub known: KnownValues,
    /// The parameters that must be identified: any of m, mc, I, offset, or single names; empty: all.
    pub asked: Vec<String>,
}

/// Solves a factor.
///
/// # Errors
/// Fails if the options do not fit the factor, or if the caller stops the job.
pub fn solve(
    factor: &PooledFactor,
    options: &SolveOptions,
    caller: &Caller<'_>,
) -> Result<Identified, Error> {
    caller.stoppable(|| solved(factor, options, caller))
}

fn solved(pooled: &PooledFactor, options: &SolveOptions, caller: &Caller<'_>) -> Result<Identified, Error> {
    let started = Instant::now();
    let rig = options.rig.as_deref().map(RigFile::load).transpose()?.unwrap_or_default();
    let mut found = pooled.fit();
    check_rig(&found, &rig)?;
    let source = Source {
        recording: pooled.recordings(),
        rows: found.counts.samples,
        mcu: "host".to_owned(),
        ..Source::default()
    };
    let mut report = Report { asked: options.asked.clone(), ..Report::of_factor(&rig, source) };
    let disagreement = pooled.unexplained_disagreement();
    report.warnings.extend(disagreement.map(|ratio| disagreement_in_words("the merged runs", ratio)));
    report.notes.extend(rigident_present::merged::assumptions(pooled));
    if options.asked.iter().any(|word| word.trim().starts_with("offset"))
        && let Some(why) = pooled.without_offset_in_words()
    {
        return Err(Error::NoOffset(why));
    }
    let with = ReadWith { rig: options.rig.as_deref(), calibration: None, tree: &Tree::default() };
    if let Some(tare) = tare(&options.tare, with, (&mut report.notes, &mut report.warnings), caller)? {
        take_off(&tare, &mut found, &mut report.notes)?;
    }
    let stated = rig.suspension.as_ref().filter(|table| is_stated(table));
    match (stated, options.without_platform) {
        (Some(table), true) => take_platform_off(table, &mut found)?,
        (None, true) => return Err(Error::NoPlatform),
        (Some(_), false) => report.notes.push(caller.words(&Notice::PlatformNotTakenOff)),
        (None, false) => {}
    }
    options.known.apply(&mut found)?;
    let mut answered = report.conclude(found, caller)?;
    answered.answer.elapsed_s = started.elapsed().as_secs_f64();
    Ok(answered)
}

/// Refuses a rig file whose links are not those that the parameters are of.
fn check_rig(found: &Fit, rig: &RigFile) -> Result<(), Error> {
    let named = found.parameters.iter().filter_map(Parameter::link);
    let of_factor: BTreeSet<&str> = named.filter(|link| !link.is_empty()).collect();
    let of_rig: BTreeSet<&str> = rig.link.iter().map(|link| link.name.as_str()).collect();
    let of_a_body = rig.body.is_some() || rig.truth.is_some();
    let fits = match (of_factor.is_empty(), of_rig.len()) {
        (true, links) => links < 2,
        (false, 0) => !of_a_body,
        (false, _) => of_factor.is_subset(&of_rig),
    };
    if fits {
        return Ok(());
    }
    let words = |links: &BTreeSet<&str>| match links.len() {
        0 => "one body".to_owned(),
        _ => format!("the links {}", links.iter().copied().collect::<Vec<_>>().join(", ")),
    };
    Err(Error::OtherLinks { factor: words(&of_factor), rig: words(&of_rig) })
}
