//! Modes of free vibration from uniform samples of a decay: natural frequencies, damping ratios and shapes
//! without scale.
//!
//! Lives here: first poles that stay the same over orders (`start`), their maximum likelihood by variable
//! projection (`decay_fit`), the search for as many components as the recording tells (`search`), what each
//! of them is (`roles`), shapes with their joint covariance (`shape`), the same from an IMU's signals
//! (`imu`), and what is wrong with a recording ([`ModalError`], [`Finding`]). Numbers in, numbers out. May
//! not live here: files, bodies, springs, screens.

mod amplitudes;
mod channels;
mod decay_fit;
mod findings;
mod harmonics;
mod imu;
mod input;
mod report;
mod roles;
mod search;
mod shape;
mod spectrum;
mod start;
#[cfg(test)]
mod tests;
mod triangle;
mod undamped;

use nalgebra::DMatrix;

pub use amplitudes::Amplitudes;
pub use findings::{Finding, Severity};
pub use imu::{Imu, platform_amplitudes};
pub use input::{FreeDecay, ModalError, Options};
pub use report::complex;
pub use roles::Role;
pub use shape::{Mode, Shapes, shapes};
pub use spectrum::{Spectrum, spectrum};
pub use triangle::Pole;
pub use undamped::{out_of_phase, undamped};

use amplitudes::{Noise, amplitudes as with_covariance};
use decay_fit::Fit;
use report::Evidence;
use roles::{LEAST_CYCLES, roles};
use search::{left, search};
use triangle::{Samples, residuals};

/// Steps of the fit to all samples; it begins where the fit to fewer ended.
const LAST_STEPS: usize = 8;

/// A component of the decay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component {
    /// The component's pole.
    pub pole: Pole,
    /// The meaning.
    pub role: Role,
    /// Energy by the noise's variance.
    pub strength: f64,
}

/// The result of a decay.
#[derive(Clone, Debug, PartialEq)]
pub struct Modes {
    /// The modes by rising frequency, only those that are known one by one; with their joint covariance.
    pub shapes: Shapes,
    /// Complex amplitudes of the same modes in the same order, with their joint covariance.
    pub amplitudes: Amplitudes,
    /// Everything that was fitted, modes and others.
    pub components: Vec<Component>,
    /// Standard deviation of each channel's noise, in its unit.
    pub noise: Vec<f64>,
    /// Correlation of noise between channels.
    pub noise_correlation: DMatrix<f64>,
    /// The findings, errors first.
    pub findings: Vec<Finding>,
}

impl Modes {
    /// Returns whether nothing was found that forbids to go on.
    pub fn is_sound(&self) -> bool {
        self.findings.iter().all(|finding| finding.severity() < Severity::Error)
    }
}

/// Identifies the modes of a free decay.
///
/// Standard deviations rest on the residuals: white noise of each channel, correlated between channels as
/// they show it, wider by the residuals' spectrum near a mode where that is higher than white.
///
/// # Errors
/// [`ModalError`] where no mode can be determined: numbers that are missing, clipped or frozen, nothing that
/// vibrates, a recording that is too short. What concerns single modes is among [`Modes::findings`].
pub fn identify(decay: &FreeDecay<'_>, options: &Options) -> Result<Modes, ModalError> {
    channels::check(decay, options)?;
    let samples = Samples::new(decay);
    let searched = search(&samples, options.modes.unwrap_or(options.most));
    let Some(first) = searched.fit else {
        let (hz, ratio) = searched.strongest;
        return Err(ModalError::NothingVibrates { hz, ratio });
    };
    let failed = |reason: &str| ModalError::Fit { modes: first.poles.len(), reason: reason.to_owned() };
    let mut poles = first.poles.clone();
    poles.sort_by(|a, b| a.natural().total_cmp(&b.natural()));
    let searched_fit = Fit::at(&searched.samples, poles.clone())
        .ok_or_else(|| failed("the modes are not distinguished at the lower rate"))?;
    let fit = Fit::refined(&samples, poles, LAST_STEPS)
        .ok_or_else(|| failed("the modes are not distinguished at the full rate"))?;
    let columns = residuals(&samples, &fit.poles, &fit.amplitudes);
    let (spectrum, levels) = left(&samples, Some(&fit));
    let noise = Noise::new(&fit, &columns, &spectrum);
    let all = with_covariance(&fit, &noise).ok_or_else(|| failed("two of them coincide; ask for fewer"))?;
    let strengths: Vec<f64> =
        (0..fit.poles.len()).map(|r| fit.strength(r, &coloured_levels(&fit, &noise, r))).collect();
    let roles = roles(&fit.poles, &all, &strengths, decay.duration_s(), options);
    check_length(decay, &fit, &roles)?;
    let kept: Vec<usize> = (0..roles.len()).filter(|r| roles[*r] == Role::Mode).collect();
    let kept_amplitudes = all.selected(&kept);
    let mut shapes = shapes(&kept_amplitudes, &options.scales)?;
    for (mode, r) in shapes.modes.iter_mut().zip(&kept) {
        mode.signal_to_noise = strengths[*r].sqrt();
    }
    let evidence = Evidence {
        decay,
        options,
        searched: (&searched.samples, &searched_fit),
        samples: &samples,
        fit: &fit,
        amplitudes: &all,
        roles: &roles,
        strengths: &strengths,
        coloured: &noise.coloured,
        columns: &columns,
        spectrum: &spectrum,
        levels: &levels,
    };
    let findings = evidence.findings(&shapes.modes);
    let component =
        |(r, pole): (usize, &Pole)| Component { pole: *pole, role: roles[r], strength: strengths[r] };
    Ok(Modes {
        shapes,
        amplitudes: kept_amplitudes,
        components: fit.poles.iter().enumerate().map(component).collect(),
        noise: fit.sigma.clone(),
        noise_correlation: noise.correlation.clone(),
        findings,
    })
}

/// Returns the variance of white noise that has the effect of the channels' noise near a component.
fn coloured_levels(fit: &Fit, noise: &Noise, component: usize) -> Vec<f64> {
    let levels: Vec<f64> = fit
        .sigma
        .iter()
        .zip(&noise.coloured[component])
        .map(|(sigma, ratio)| sigma * sigma * ratio)
        .collect();
    fit.above_rounding(&levels)
}

/// Refuses a recording in which nothing comes round often enough.
fn check_length(decay: &FreeDecay<'_>, fit: &Fit, roles: &[Role]) -> Result<(), ModalError> {
    if !roles.iter().all(|role| *role == Role::TooShort) {
        return Ok(());
    }
    let hz = fit.poles.iter().map(|pole| pole.hz()).fold(f64::MIN_POSITIVE, f64::max);
    let duration_s = decay.duration_s();
    let (cycles, needed_s) = (hz * duration_s, 5.0 / hz);
    Err(ModalError::TooShort { duration_s, hz, cycles, least: LEAST_CYCLES, needed_s })
}
