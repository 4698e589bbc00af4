//! Warnings and notes that follow from a fit. A warning asks for something, a note does not.

use std::collections::BTreeSet;

use super::context::Links;
use super::result::{ForgettingKind, Forgotten, ParameterState};
use super::states::{LARGEST_SHARE, LEAST_EXCITATION, scales};
use rigident_fit::FILTER_WIDTH_S;
use rigident_fit::figures::{counted, significant, unit_symbol};
use rigident_fit::outliers::LIMIT_SD;
use rigident_fit::{Autocorrelation, ChannelFit, Fit, Kind, NuisanceFit, PriorStatement, StatedNoise};

/// Rows beyond the unknowns from which on residuals that are half as large as stated are no chance: 0.5 % of
/// them.
const ENOUGH_SPARE_ROWS: usize = 12;
/// Residual variance over the stated one from which on the data or the rig file should be examined.
const MUCH_LARGER: f64 = 2.0;
/// Residual variance over the stated one below which the stated noise is too large,
const MUCH_SMALLER: f64 = 0.25;
/// and beyond which, either way, it is far off: a factor of three.
const FAR: f64 = 9.0;
/// A share of an interval that is worth a word.
const SIGNAL_NOISE: f64 = 0.5;
/// Residual over measurement from which on a model of links explains little of a channel.
const UNEXPLAINED: f64 = 0.5;

impl std::fmt::Display for Forgotten {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { kind, span_s, effective_s } = self;
        match kind {
            ForgettingKind::Window => write!(
                f,
                "the answer is that of the last {effective_s:.1} s of rows (`window_s` {span_s}) and of \
                 nothing before"
            ),
            ForgettingKind::Exponential => write!(
                f,
                "the answer rests on {effective_s:.1} s of rows (`forget_s` {span_s}): what the motion \
                 renews is forgotten with that time constant, what it does not renew is kept as it was last \
                 seen"
            ),
        }
    }
}

/// Returns notes and warnings about the residuals, the noise and what was left out. `of_links`: a model of
/// links is behind the rows, whose joints may be other than the measured ones.
pub(super) fn of_the_fit(fit: &Fit, of_links: bool, rate_sigma: f64) -> (Vec<String>, Vec<String>) {
    let (mut notes, mut warnings) = left_out(fit);
    match residual_noise(fit) {
        Remark::Warning(text) => warnings.push(text),
        Remark::Note(text) => notes.push(text),
        Remark::None => {}
    }
    warnings.extend(fit.stated_noise.iter().filter_map(stated_noise));
    warnings.extend(autocorrelation(fit));
    notes.extend(signal_noise(fit, rate_sigma));
    warnings.extend(unexplained(fit).filter(|_| of_links));
    warnings.extend(friction_of_another_law(fit));
    warnings.extend(model_error(fit));
    (notes, warnings)
}

enum Remark {
    Warning(String),
    Note(String),
    None,
}

/// Compares the residuals with the noise that was stated.
fn residual_noise(fit: &Fit) -> Remark {
    let ratio = fit.noise.variance_ratio;
    let small = fit.noise.sigma_given && ratio < MUCH_SMALLER;
    let rows = usize::try_from(fit.factor.rows()).unwrap_or(usize::MAX);
    let fitted = fit.data_alone().rank();
    if rows <= fitted || (small && rows < fitted + ENOUGH_SPARE_ROWS) {
        Remark::Warning(format!(
            "too few rows: {rows} equations for {} unknowns, which leaves nothing to check the noise by; \
             record for longer, or more poses",
            fit.parameters.len()
        ))
    } else if fit.noise.sigma_given && ratio > MUCH_LARGER {
        Remark::Warning(format!(
            "residuals are {:.1} times larger than the noise stated in the rig file{}: the intervals were \
             widened; look for a wrong sign, frame, delay or scale, bodies that are not rigid, friction that \
             is left out",
            ratio.sqrt(),
            if ratio > FAR { figures(fit, ratio) } else { String::new() }
        ))
    } else if fit.noise.sigma_given && fit.noise.variance_scale > 1.0 {
        Remark::Note(format!(
            "residuals are {:.1} times larger than the noise stated in the rig file: the intervals were \
             widened",
            ratio.sqrt()
        ))
    } else if small {
        let is_far = ratio < 1.0 / FAR;
        let said = format!(
            "residuals are {:.1} times smaller than the noise stated in the rig file{}: the intervals are \
             wider than need be",
            1.0 / ratio.max(1e-12).sqrt(),
            if is_far { figures(fit, ratio) } else { String::new() }
        );
        if is_far { Remark::Warning(said) } else { Remark::Note(said) }
    } else {
        Remark::None
    }
}

/// Returns the figures behind a ratio: of the channel whose residuals are the furthest off.
fn figures(fit: &Fit, ratio: f64) -> String {
    let off = |c: &&ChannelFit| {
        let own = c.residual_rms / c.residual_sigma * fit.noise.variance_scale.sqrt();
        if ratio > 1.0 { own } else { 1.0 / own }
    };
    let with_data = fit.channels.iter().filter(|c| !fit.residuals.is_empty() && off(c).is_finite());
    with_data.max_by(|a, b| off(a).total_cmp(&off(b))).map_or_else(String::new, |c| {
        format!(
            " ({}, filtered: {} {} found, {} expected)",
            c.channel.name,
            significant(c.residual_rms, 2),
            unit_symbol(&c.channel.unit),
            significant(c.residual_sigma / fit.noise.variance_scale.sqrt(), 2)
        )
    })
}

/// Tells of noise that is stated far too large or too small.
fn stated_noise(noise: &StatedNoise) -> Option<String> {
    let ratio = noise.far_off()?;
    let StatedNoise { name, unit, key, stated, found } = noise;
    let figure = |sigma: f64| format!("{} {}", significant(sigma, 2), unit_symbol(unit));
    let times = if ratio > 1.0 {
        format!("{} times more", significant(ratio, 2))
    } else {
        format!("{} times less, unless they were smoothed", significant(1.0 / ratio, 2))
    };
    Some(format!(
        "{name}: {key} of the rig file states a noise of {}, and the readings show {}, {times}; rows are \
         weighed by what is stated: correct it, or leave it out to have it found",
        figure(*stated),
        figure(*found)
    ))
}

/// Tells of samples that were rejected (warnings), and of filtered rows that count less (notes).
fn left_out(fit: &Fit) -> (Vec<String>, Vec<String>) {
    let outliers = fit.channels.iter().filter(|c| c.outliers > 0).map(|c| {
        format!(
            "{} of {} filtered rows of channel {} {} more than {LIMIT_SD} standard deviations off and {} \
             less",
            c.outliers,
            fit.counts.blocks,
            c.channel.name,
            if c.outliers == 1 { "is" } else { "are" },
            if c.outliers == 1 { "counts" } else { "count" },
        )
    });
    let rejected =
        fit.counts.rejected_by_signal.iter().filter(|(_, count)| *count > 0).map(|(signal, count)| {
            format!(
                "{} rejected because of {signal}: saturated, frozen or not finite; check that sensor and its \
             range",
                counted(usize::try_from(*count).unwrap_or(usize::MAX), "reading was", "readings were"),
            )
        });
    (outliers.collect(), rejected.collect())
}

/// Tells of residuals that stay correlated for longer than the filter explains.
fn autocorrelation(fit: &Fit) -> Option<String> {
    let mut found: Vec<(&str, Autocorrelation)> =
        fit.channels.iter().filter_map(|c| Some((c.channel.name.as_str(), c.autocorrelation?))).collect();
    found.sort_by(|a, b| b.1.factor.total_cmp(&a.1.factor));
    let (name, worst) = found.first()?;
    let factors: Vec<String> = found.iter().map(|(name, a)| format!("{:.1} ({name})", a.factor)).collect();
    let consequence = match fit.largest_inflation() {
        Some(largest) => format!(
            "Intervals count this and are wider for it by up to {largest:.1}; one that rested on the slowest \
             part alone would be wider by factors of"
        ),
        None => "Intervals do not count this and may be too narrow, as far as they rest on these channels, \
                 by factors up to"
            .to_owned(),
    };
    Some(format!(
        "residuals of {} stay correlated for longer than the filter explains (of {name}: autocorrelation \
         {:.2} about {} s apart, where white noise has 0.00 ± {:.2}). {consequence} {}; look for vibration, \
         drift, a wrong delay or a body that is not rigid",
        found.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", "),
        worst.mean,
        FILTER_WIDTH_S,
        2.0 * worst.chance,
        factors.join(", ")
    ))
}

/// Tells of intervals that are wide because of noise in the rows' own signals.
fn signal_noise(fit: &Fit, rate_sigma: f64) -> Option<String> {
    let shares = fit.signal_bias.iter().enumerate().filter_map(|(j, bias)| {
        let variance = fit.estimate.covariance(j, j)?;
        Some(bias.abs() / variance.sqrt()).filter(|share| share.is_finite())
    });
    let worst = shares.fold(0.0, f64::max);
    let sigma = if rate_sigma > 0.0 {
        format!(" (1 σ {} rad/s)", significant(rate_sigma, 2))
    } else {
        String::new()
    };
    (worst > SIGNAL_NOISE).then(|| {
        format!(
            "noise of the rates{sigma} is in the rows and does not average out: up to {:.0} % of an \
             interval is for it. Better gyros or encoders, or faster motion, make intervals narrower; a \
             longer recording does not",
            100.0 * worst
        )
    })
}

/// Tells of dry friction that follows another law than its columns.
fn friction_of_another_law(fit: &Fit) -> Option<String> {
    let far = |k: &&NuisanceFit| k.nuisance.is_of_friction() && k.is_contradicted();
    let drive = |k: &NuisanceFit| k.nuisance.name.splitn(3, '_').nth(2).map(str::to_owned);
    let drives: BTreeSet<String> = fit.nuisances.iter().filter(far).filter_map(drive).collect();
    (!drives.is_empty()).then(|| {
        format!(
            "dry friction of {} follows the speed in another way than its columns: try a Stribeck column for \
             it",
            drives.into_iter().collect::<Vec<_>>().join(", ")
        )
    })
}

/// Tells of what the model of the drives lacks, where it counts as noise.
fn model_error(fit: &Fit) -> Option<String> {
    let by = fit.noise.model_error.sqrt();
    (by > 1.0).then(|| {
        format!(
            "the model leaves efforts that follow the motion: friction, elasticity or cables that it lacks. \
             They count as noise, {} times larger than if it were white, so that no error of the rig has to \
             explain them",
            significant(by, 2)
        )
    })
}

/// Tells of channels that the model explains little of.
fn unexplained(fit: &Fit) -> Option<String> {
    let poor: Vec<String> = fit
        .channels
        .iter()
        .filter(|c| !fit.residuals.is_empty() && c.residual_rms > UNEXPLAINED * c.measured_rms)
        .map(|c| format!("{} {:.0} %", c.channel.name, 100.0 * c.residual_rms / c.measured_rms))
        .collect();
    (!poor.is_empty()).then(|| {
        format!(
            "the model explains little of some channels (residual over measurement, rms): {}; are their \
             signs, units and joints those of the model?",
            poor.join(", ")
        )
    })
}

/// Tells of known values that do not identify what they are about.
pub(super) fn of_known_values(fit: &Fit, links: Option<&Links>, states: &[ParameterState]) -> Vec<String> {
    let Some(prior) = &fit.prior else { return Vec::new() };
    let scales = scales(fit, links);
    let free_planes = prior.statements.iter().filter_map(|s| free_plane(fit, s));
    let loose = prior.statements.iter().filter_map(|s| too_loose(fit, &scales, states, s));
    free_planes.chain(loose).collect()
}

/// Tells of a plane of symmetry that says nothing of products of inertia, because the size of its link is not
/// known.
fn free_plane(fit: &Fit, statement: &PriorStatement) -> Option<String> {
    let names: Vec<&str> =
        statement.free.iter().filter_map(|j| Some(fit.parameters.get(*j)?.name.as_str())).collect();
    (!names.is_empty()).then(|| {
        format!(
            "{}: {} stay free: how far from zero they may be grows with the body's size, which is not known \
             without Ixx, Iyy and Izz; turn the body about all three axes, or state ixx_kgm2, iyy_kgm2 and \
             izz_kgm2 with `known`",
            statement.name,
            names.join(" and "),
        )
    })
}

fn too_loose(
    fit: &Fit,
    scales: &[Option<f64>],
    states: &[ParameterState],
    statement: &PriorStatement,
) -> Option<String> {
    let j = statement.parameter;
    let (state, u95, parameter) = (states.get(j)?, fit.estimate.u95(j), fit.parameters.get(j)?);
    if statement.is_symmetry || *state != ParameterState::NotIdentified || !u95.is_finite() {
        return None;
    }
    let (text, name) = (&statement.text, &parameter.name);
    let Some(scale) = scales.get(j).copied().flatten() else {
        return Some(format!(
            "{text} is in the answer, but {name} is not identified: the mass, against which that is judged, \
             is not known to {} %; state mass_kg with `known`",
            100.0 * LARGEST_SHARE
        ));
    };
    let mut least = LARGEST_SHARE * scale;
    if parameter.kind == Kind::Inertia && fit.spurious_information > 0.0 {
        let informed = (LEAST_EXCITATION * fit.spurious_information).sqrt().recip();
        least = least.min(fit.estimate.coverage_factor() * informed);
    }
    Some(format!(
        "{text} is too loose to identify {name}: with it the U95 is {}, and at most {} {} would do; state it \
         with a smaller σ if it is known that well",
        significant(u95, 2),
        significant(least, 2),
        unit_symbol(&parameter.unit),
    ))
}
