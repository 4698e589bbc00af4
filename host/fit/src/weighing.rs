//! The weights of rows: the covariance of all noise, and what noise in the coefficients adds to the normal
//! equations.

use nalgebra::DMatrix;

use super::residual_spectrum::{Band, bands};
use super::variance_components::{Sample, explain};
use super::{BlockResidual, Estimate, Filter, SignalNoise, Whitening};

/// A parameter counts in the covariance of the noise if it differs from zero by this many standard
/// deviations.
const SIGNIFICANT_SD: f64 = 2.0;
/// A variance that residuals and differences both show is no larger than this many standard deviations above
/// the residuals'.
const CERTAIN_SD: f64 = 3.0;

/// Noise of a group of unit σ, per sample: `white + ω² rising`, C × C each.
pub(super) struct Spectrum {
    pub(super) white: DMatrix<f64>,
    pub(super) rising: DMatrix<f64>,
}

/// Noise of channels and signals, and the whitening that follows from it.
#[derive(Clone, Debug)]
pub(super) struct Weighing {
    /// σ of the channels per sample.
    pub(super) sigma: Vec<f64>,
    /// The same with what noise of the signals leaves in the residuals.
    pub(super) total: Vec<f64>,
    /// 1 σ of the signals by groups; empty if they are taken as exact.
    pub(super) signals: Vec<f64>,
    /// By how much the square of one of these may be wrong, as a share of itself: differences and residuals
    /// disagree.
    pub(super) doubt: f64,
    pub(super) whitening: Whitening,
}

/// The residuals of an estimate.
pub(super) struct Residuals {
    /// By bands of frequency.
    pub(super) bands: Vec<Band>,
    /// Covariance of the parameters, zero of those that are not determined.
    pub(super) covariance: DMatrix<f64>,
}

impl Weighing {
    /// Returns the weighing by σ of the channels alone; a row represents `every` samples.
    pub(super) fn diagonal(sigma: Vec<f64>, every: f64) -> Self {
        let weights: Vec<f64> = sigma.iter().map(|s| every.sqrt() / s).collect();
        let whitening = Whitening::diagonal(&weights);
        Self { total: sigma.clone(), sigma, signals: Vec::new(), doubt: 0.0, whitening }
    }

    /// Returns true if noise of the signals counts.
    pub(super) fn is_compensated(&self) -> bool {
        !self.signals.is_empty()
    }

    /// Returns the same with its doubt: the σ of signals of another weighing may be right as well.
    pub(super) fn or(self, other: &Self) -> Self {
        let both = self.signals.iter().zip(&other.signals).filter(|(own, _)| **own > 0.0);
        let doubt = both.map(|(own, other)| ((other / own).powi(2) - 1.0).abs()).fold(0.0, f64::max);
        Self { doubt, ..self }
    }

    /// Returns the values that the rows say something of, the others zero. Of an estimate that is not
    /// compensated all that are determined count.
    pub(super) fn significant(estimate: &Estimate, all: bool) -> Vec<f64> {
        let values = estimate.values.iter().enumerate();
        values
            .map(|(j, value)| {
                let sd = estimate.covariance[(j, j)].max(0.0).sqrt();
                let counts = estimate.is_determined(j) && (all || value.abs() > SIGNIFICANT_SD * sd);
                if counts { *value } else { 0.0 }
            })
            .collect()
    }

    /// Returns the covariance of the residuals by bands of frequency.
    pub(super) fn covariance_of(
        residuals: &[BlockResidual],
        estimate: &Estimate,
        filter: &Filter,
    ) -> Residuals {
        let mut covariance = estimate.covariance.clone();
        for j in (0..estimate.len()).filter(|j| !estimate.is_determined(*j)) {
            covariance.row_mut(j).fill(0.0);
            covariance.column_mut(j).fill(0.0);
        }
        Residuals { bands: bands(residuals, filter), covariance }
    }

    /// Returns the weighing by all noise. `spectra` are those of groups of signals of unit σ; `residuals` is
    /// the covariance of what an estimate leaves, by bands, where some σ is not stated: that of the channels
    /// unless `sigma_given`, and those of the signals, as far as they bound it, unless `signals_given`.
    /// `None` if there is no such covariance.
    pub(super) fn with_signals(
        &self,
        groups: &[&SignalNoise],
        spectra: &[Spectrum],
        residuals: Option<&[Band]>,
        (sigma_given, signals_given): (bool, bool),
        filter: &Filter,
    ) -> Option<Self> {
        let channels = self.sigma.len();
        // Variance after the filter, of which white noise leaves its gain.
        let rise = filter.derivative_noise_gain / filter.noise_gain;
        let (sigma, signals) = match residuals {
            None => (self.sigma.clone(), groups.iter().map(|g| g.size()).collect()),
            Some(left) => components(left, spectra, groups, (&self.sigma, sigma_given), signals_given),
        };
        let own = |i: usize, j: usize| if i == j { sigma[i] * sigma[i] } else { 0.0 };
        let mut white = DMatrix::from_fn(channels, channels, own);
        let mut rising = DMatrix::zeros(channels, channels);
        for (spectrum, sigma) in spectra.iter().zip(&signals) {
            white += &spectrum.white * (sigma * sigma);
            rising += &spectrum.rising * (sigma * sigma);
        }
        let every = f64::from(filter.every);
        let whitening = Whitening::of_spectrum(&white, &rising, every, filter.row_period_s())?;
        let total = (0..channels).map(|c| (white[(c, c)] + rise * rising[(c, c)]).sqrt()).collect();
        Some(Self { sigma, total, signals, doubt: 0.0, whitening })
    }
}

/// Returns σ of the channels and of the signals by groups that explain the covariance of residuals.
///
/// What is stated counts as stated. Of the rest, differences of the signals show no less than the noise, as
/// vibration is in them too; the residuals bound it from above. A channel's variance v of the deviation s is
/// the mean of what it may be, `v + s²/v`, that of the inverse χ² distribution; too small a one would
/// outweigh all others.
fn components(
    left: &[Band],
    spectra: &[Spectrum],
    groups: &[&SignalNoise],
    (sigma, sigma_given): (&[f64], bool),
    signals_given: bool,
) -> (Vec<f64>, Vec<f64>) {
    let channels = sigma.len();
    let own = |c: usize| DMatrix::from_fn(channels, channels, |i, j| f64::from(u8::from(i == c && j == c)));
    let of_band = |band: &'_ Band| {
        let spread = spectra.iter().map(|s| &s.white * band.white + &s.rising * band.rising);
        (0..channels).map(|c| own(c) * band.white).chain(spread).collect()
    };
    let samples: Vec<Sample> = left
        .iter()
        .map(|band| Sample { covariance: &band.covariance, count: band.count, components: of_band(band) })
        .collect();
    let mut signals: Vec<f64> = groups.iter().map(|g| g.size()).collect();
    let start = |signals: &[f64]| -> Vec<f64> { sigma.iter().chain(signals).map(|s| s * s).collect() };
    let mut free = vec![!sigma_given; channels];
    free.extend(groups.iter().map(|g| g.stated.is_none()));
    if let Some(found) = explain(&samples, &start(&signals), &free).filter(|_| !signals_given) {
        for (k, (sigma, group)) in signals.iter_mut().zip(groups).enumerate() {
            if group.stated.is_none() {
                let k = channels + k;
                *sigma = sigma.min((found.variance[k] + CERTAIN_SD * found.deviation[k]).sqrt());
            }
        }
    }
    if sigma_given {
        return (sigma.to_vec(), signals);
    }
    free[channels..].fill(false);
    let sigma = match explain(&samples, &start(&signals), &free) {
        Some(found) => {
            let own = found.variance.iter().zip(&found.deviation).take(channels);
            own.map(|(v, deviation)| (v + deviation * deviation / v.max(*deviation)).sqrt()).collect()
        }
        None => sigma.to_vec(),
    };
    (sigma, signals)
}
