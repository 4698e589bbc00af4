//! All that makes intervals wider than white noise alone, in the order of docs/estimation.md.

use super::conclusion::BeyondWhite;
use super::{Conclusion, Engine, Pass};
use crate::lack_of_fit::LackOfFit;
use crate::rig_rows::shifted;
use crate::{Estimate, Factor, NuisanceFit};

/// Findings beyond white noise, one after the other.
pub(super) struct Found {
    /// Noise that is slow, and what a model of drives lacks; `None` where rows are forgotten.
    beyond: Option<BeyondWhite>,
    /// Error of each parameter that noise of the signals makes which is not compensated; empty: none.
    pub bias: Vec<f64>,
    /// Error of each parameter that a change of the body during the recording makes.
    change: Vec<f64>,
    /// Information that noise of the rates alone brings to a moment of inertia.
    pub spurious_information: f64,
}

impl Found {
    /// Returns the factor on the standard deviation of each parameter for autocorrelated residuals; empty:
    /// none.
    pub(super) fn inflation(&self) -> &[f64] {
        self.beyond.as_ref().map_or(&[], |beyond| &beyond.inflation)
    }

    /// Returns true if rows are any noisier than white.
    fn is_any(&self) -> bool {
        self.beyond.as_ref().is_some_and(BeyondWhite::is_any)
            || is_shift(&self.bias)
            || is_shift(&self.change)
    }

    /// Returns rows over all columns as noisy as was found: `R φ = z + n` with
    /// `cov n = 1 + R⁻ᵀ (J − J_white) R⁻¹`, then `b bᵀ` and `d dᵀ` on the estimate.
    fn noisier(&self, white: &Factor, scale: f64) -> Factor {
        let slow = self.beyond.as_ref().filter(|beyond| !beyond.inflation.is_empty());
        let slow = slow.map_or_else(|| white.clone(), |beyond| beyond.noisier(white, scale));
        let biased = shifted(&slow, &self.bias);
        shifted(&biased, &self.change)
    }
}

fn is_shift(of: &[f64]) -> bool {
    of.iter().any(|own| *own != 0.0)
}

/// A solution with everything counted.
pub(super) struct Widened {
    pub factor: Factor,
    pub solved: Option<Factor>,
    /// Rows over all columns, without what is known beforehand.
    pub rows: Factor,
    pub estimate: Estimate,
    /// The factor on each standard deviation; empty: none is larger.
    pub by: Vec<f64>,
}

impl Engine<'_> {
    /// Returns what makes intervals wider than white noise alone: `beyond` that, where no rows are forgotten,
    /// noise of signals, and a change.
    pub(super) fn found(
        &self,
        pass: &Pass,
        conclusion: &Conclusion,
        beyond: Option<BeyondWhite>,
        lack_of_fit: &LackOfFit,
    ) -> Found {
        let (bias, spurious_information) = self.signal_bias(pass, conclusion);
        Found {
            beyond,
            bias,
            change: (0..self.parameters).map(|j| lack_of_fit.shift(j)).collect(),
            spurious_information,
        }
    }

    /// Returns what noise of the signals moves each parameter by, and what it informs of moments of inertia,
    /// where it is not compensated: what is moves no estimate and informs of nothing.
    fn signal_bias(&self, pass: &Pass, conclusion: &Conclusion) -> (Vec<f64>, f64) {
        let weighing = &pass.weighing;
        let Some(noise) = self.noise.as_ref().filter(|_| !weighing.is_compensated()) else {
            return (Vec::new(), 0.0);
        };
        let unscaled = &conclusion.unscaled;
        let spurious = conclusion.share * self.spurious_information(&weighing.sigma);
        let informed = self.without_spurious(unscaled, spurious);
        let known = |j: usize| if informed.is_determined(j) { informed.values[j] } else { 0.0 };
        let informed: Vec<f64> = (0..self.parameters).map(known).collect();
        let pull = noise.pull(weighing, &informed) * conclusion.share;
        ((&unscaled.covariance * pull).iter().map(|b| -b).collect(), spurious)
    }

    /// Returns a solution with everything that was found counted, then what is known of errors beforehand:
    ///
    /// ```text
    /// cov φ̂ = (H + Σ⁻¹)⁻¹, φ alone: H of the rows with the noise found, Σ of the errors' columns
    /// ```
    ///
    /// so that none of it scales what is known beforehand.
    pub(super) fn widened(&self, white: Solution, found: &Found, scale: f64, with_errors: bool) -> Widened {
        let Solution { factor, solved, rows, estimate } = white;
        if !found.is_any() {
            return Widened { factor, solved, rows, estimate, by: Vec::new() };
        }
        let rows = found.noisier(&rows, scale);
        let own = self.without_errors(&rows, with_errors);
        let after = self.estimate(&own, 1.0, estimate.noise);
        let by = wider(&estimate, &after);
        let factor = factor.inflate(&estimate.values, &by);
        Widened { factor, solved: Some(own), rows, estimate: after, by }
    }

    /// Returns a solution of rows that are forgotten, whose errors are no columns: their contributions, and
    /// the bias, are added to each variance.
    pub(super) fn widened_by_errors(
        &self,
        white: Solution,
        found: &Found,
        errors: &[NuisanceFit],
    ) -> Widened {
        let Solution { factor, solved, rows, estimate } = white;
        let of = |j: usize| {
            let all = estimate.covariance[(j, j)].max(0.0).sqrt();
            let brought = errors.iter().map(|k| k.contributions.get(j).map_or(0.0, |sd| sd * sd));
            let bias = found.bias.get(j).copied().unwrap_or(0.0);
            let with = all.hypot(bias).hypot(brought.sum::<f64>().sqrt());
            if all > 0.0 { with / all } else { 1.0 }
        };
        let by: Vec<f64> = (0..self.parameters).map(of).collect();
        if by.iter().all(|by| *by <= 1.0) {
            return Widened { factor, solved, rows, estimate, by: Vec::new() };
        }
        Widened {
            factor: factor.inflate(&estimate.values, &by),
            solved: solved.map(|rows| rows.inflate(&estimate.values, &by)),
            rows,
            estimate: estimate.inflate(&by),
            by,
        }
    }
}

/// A solution of rows whose noise is white.
pub(super) struct Solution {
    pub factor: Factor,
    pub solved: Option<Factor>,
    /// Rows over all columns, without what is known beforehand.
    pub rows: Factor,
    pub estimate: Estimate,
}

/// Returns by how much the standard deviations of one estimate are larger than those of another, 1 or more.
fn wider(before: &Estimate, after: &Estimate) -> Vec<f64> {
    let of = |j: usize| {
        let ratio = (after.covariance[(j, j)] / before.covariance[(j, j)]).sqrt();
        let both = before.is_determined(j) && after.is_determined(j);
        if both && ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
    };
    (0..before.len()).map(of).collect()
}
