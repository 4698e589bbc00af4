//! Moments of inertia that noise of the rates alone seems to inform of.

use super::Engine;
use crate::{Estimate, Kind};

/// A moment of inertia whose information is less than this many times what noise of the rates alone would
/// bring is not informed: noise in a coefficient attenuates the estimate by the inverse of this ratio.
pub const LEAST_EXCITATION: f64 = 20.0;

/// A moment of inertia whose information is at most this many times that is mostly noise: half of it and
/// more.
const MOSTLY_NOISE: f64 = 2.0;

impl Engine<'_> {
    /// Returns the information that noise of the rates alone brings to a moment of inertia in all row blocks,
    /// 1/(kg m²)².
    pub(super) fn spurious_information(&self, sigma: &[f64]) -> f64 {
        let filter = self.blocks.filter();
        self.blocks.len() as f64
            * f64::from(filter.every)
            * filter.derivative_noise_gain
            * self.source.rate_sigma().powi(2)
            / self.moment_sigma(sigma).powi(2)
    }

    /// Returns the estimate without the values of moments of inertia that are mostly noise of the rates: they
    /// are drawn to nothing already. A moment that is less attenuated than that moves the others, informed or
    /// not.
    pub(super) fn without_spurious(&self, estimate: &Estimate, spurious_information: f64) -> Estimate {
        let mut informed = estimate.clone();
        for (j, parameter) in self.source.parameters().iter().enumerate() {
            let information = 1.0 / estimate.covariance[(j, j)];
            if parameter.kind == Kind::Inertia && information <= MOSTLY_NOISE * spurious_information {
                informed.values[j] = 0.0;
            }
        }
        informed
    }

    /// Returns the least σ of the channels that measure a moment; of all if none does.
    pub(super) fn moment_sigma(&self, sigma: &[f64]) -> f64 {
        let least = |moments: bool| {
            let of = self.source.channels().iter().zip(sigma);
            of.filter(|(c, _)| !moments || c.unit == "N m").map(|(_, s)| *s).fold(f64::INFINITY, f64::min)
        };
        let moments = least(true);
        if moments.is_finite() { moments } else { least(false) }
    }
}
