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
mod products;
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

use products::with_products;
use report::Evidence;
use search::{BESIDE, search};
use triangle::{Held, Samples};

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
    let mut poles = first.poles.clone();
    poles.sort_by(|a, b| a.natural().total_cmp(&b.natural()));
    let both = (&samples, &searched.samples);
    let alone = Evidence::new(decay, options, both, poles)?;
    let most = options.modes.unwrap_or(options.most) + BESIDE;
    let of_all = (alone.fit.poles.as_slice(), alone.roles.as_slice());
    match with_products(&searched.samples, of_all, &alone.strengths, most) {
        Some((mut poles, holding)) => {
            poles.sort_by(|a, b| a.natural().total_cmp(&b.natural()));
            // Noise of a mean over n samples is √n times less.
            let by = (samples.rate_hz / holding.rate_hz).sqrt();
            let held = holding.held.iter().map(|own| Held { weight: own.weight * by, ..*own });
            let all = samples.holding(held.collect());
            result(&Evidence::new(decay, options, (&all, &holding), poles)?)
        }
        None => result(&alone),
    }
}

/// Returns the modes, and what was found about them.
fn result(evidence: &Evidence<'_>) -> Result<Modes, ModalError> {
    let (fit, roles, strengths) = (&evidence.fit, &evidence.roles, &evidence.strengths);
    let kept: Vec<usize> = (0..roles.len()).filter(|r| roles[*r] == Role::Mode).collect();
    let amplitudes = evidence.amplitudes.selected(&kept);
    let mut shapes = shapes(&amplitudes, &evidence.options.scales)?;
    for (mode, r) in shapes.modes.iter_mut().zip(&kept) {
        mode.signal_to_noise = strengths[*r].sqrt();
    }
    let component =
        |(r, pole): (usize, &Pole)| Component { pole: *pole, role: roles[r], strength: strengths[r] };
    Ok(Modes {
        findings: evidence.findings(&shapes.modes),
        shapes,
        amplitudes,
        components: fit.poles.iter().enumerate().map(component).collect(),
        noise: fit.sigma.clone(),
        noise_correlation: evidence.noise.correlation.clone(),
    })
}
