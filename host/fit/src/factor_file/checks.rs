//! Checks of what a factor file holds beside the numbers of its rows.

use rigident_shared::printable;

use super::rigs::Rigs;
use super::{FactorFileError, FactorSource, Header, LARGEST, MOST_PARAMETERS, StoredParameter, UNFIT_NAME};
use crate::Basis;

/// Refuses a header that cannot be reckoned with.
pub(super) fn check(header: &Header) -> Result<(), FactorFileError> {
    let positive = |v: f64| (LARGEST.recip()..LARGEST).contains(&v);
    let not_negative = |v: f64| (0.0..LARGEST).contains(&v);
    let refuse = |what| Err(FactorFileError::Header(what));
    if header.rows == 0 || header.sources.iter().all(|s| s.rows == 0) {
        return Err(FactorFileError::Empty);
    }
    let mut names: Vec<&str> = header.parameters.iter().map(|p| p.name.as_str()).collect();
    names.sort_unstable();
    if names.is_empty() || names.contains(&"") || names.windows(2).any(|pair| pair[0] == pair[1]) {
        return refuse("no parameters, or some without a name of their own");
    }
    if header
        .parameters
        .iter()
        .flat_map(|p| &p.made_of)
        .any(|(_, weight)| weight.is_nan() || weight.abs() >= LARGEST)
    {
        return refuse("a parameter made of something that is no number");
    }
    if !(0.0..=1e-3).contains(&header.rounding) {
        return refuse("an impossible rounding");
    }
    if !not_negative(header.disagreement) {
        return refuse("an impossible disagreement");
    }
    for source in &header.sources {
        if source.channels.is_empty()
            || !positive(source.noise_gain)
            || !not_negative(source.spurious_information)
        {
            return refuse("a run without channels or with impossible noise");
        }
        if source
            .channels
            .iter()
            .any(|c| !positive(c.sigma) || !not_negative(c.gain_sigma) || !not_negative(c.measured_rms))
        {
            return refuse("a channel with an impossible σ");
        }
    }
    Ok(())
}

/// Refuses more degrees of freedom than parameters can have.
pub(super) fn check_freedom(header: &Header) -> Result<(), FactorFileError> {
    let runs = header.sources.iter().map(FactorSource::runs).fold(0, u64::saturating_add);
    let most = runs.saturating_mul(MOST_PARAMETERS as u64);
    if header.eliminated > most || header.comparisons > most {
        return Err(FactorFileError::Header("more degrees of freedom than its runs have parameters"));
    }
    Ok(())
}

/// Refuses names that could steer what they are shown by, or end a comment in a program that they are written
/// into.
pub(super) fn check_names(
    parameters: &[StoredParameter],
    sources: &[FactorSource],
    rigs: &Rigs<f64>,
    overlapping: &[String],
) -> Result<(), FactorFileError> {
    let of_parameter = |p: &StoredParameter| {
        [&p.name, &p.unit, &p.frame, p.owner.name()].into_iter().all(|text| printable::is_name(text))
            && p.made_of.iter().all(|(name, _)| printable::is_name(name))
    };
    let of_run = |s: &FactorSource| {
        let mut warnings = s.checks.iter().flat_map(|checks| &checks.warnings);
        printable::is_name(&s.recording)
            && s.channels.iter().all(|c| printable::is_name(&c.name) && printable::is_name(&c.unit))
            && s.labels.iter().flat_map(|(key, value)| [key, value]).all(|text| printable::is_name(text))
            && warnings.all(|text| printable::are_lines(text))
    };
    let of_rigs = rigs.rigs.iter().flat_map(|rig| &rig.errors).map(|error| &error.name);
    let bases = rigs.bases.iter().map(|basis| match basis {
        Basis::Stated(text) | Basis::Class(text) | Basis::Calibration(text) => text,
    });
    let mut texts = rigs.texts.iter().chain(&rigs.differing).chain(of_rigs).chain(bases);
    // Each holds two names.
    let pairs = overlapping.iter().all(|text| text.split(" and ").all(printable::is_name));
    let fit = pairs
        && parameters.iter().all(of_parameter)
        && sources.iter().all(of_run)
        && texts.all(|text| printable::is_name(text));
    if fit { Ok(()) } else { Err(FactorFileError::Header(UNFIT_NAME)) }
}
