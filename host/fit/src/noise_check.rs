//! The residuals against the noise that was stated: what scales the covariance, and how it is known.

use super::Noise;

/// Rows of one run, as far as their residuals are concerned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowSet {
    /// Scalar rows.
    pub rows: u64,
    /// Channels: the number of rows in a block.
    pub channels: usize,
    /// Variance of the whitened, filtered noise per row.
    pub noise_gain: f64,
    /// True if every σ was given; else it is from the residuals.
    pub sigma_given: bool,
}

/// The evidence of the residuals about the noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// The way the noise is known.
    pub noise: Noise,
    /// Residual variance relative to what σ lets expect; 1 where every σ comes from the residuals.
    pub variance_ratio: f64,
    /// The covariance is multiplied by this.
    pub variance_scale: f64,
}

/// Degrees of freedom that the noise of a channel needs to be that channel's own; what it lacks it borrows
/// from the other channels, forces and moments apart.
pub(super) const OWN_FREEDOM: f64 = 4.0;

/// Noise is far from what is stated if it is this many times larger or smaller.
const FAR: f64 = 3.0;

/// Noise of a sensor or channel as the rig file states it, beside what differences of its readings show.
#[derive(Clone, Debug, PartialEq)]
pub struct StatedNoise {
    /// Name of the sensor or channel.
    pub name: String,
    /// Unit of σ in ASCII.
    pub unit: String,
    /// The key of the rig file.
    pub key: &'static str,
    /// 1 σ per sample as stated.
    pub stated: f64,
    /// 1 σ per sample as the readings show it; zero if they show none, or none that is white.
    pub found: f64,
}

impl StatedNoise {
    /// Returns how many times larger the noise found is than the one stated, if that is far from one.
    pub fn far_off(&self) -> Option<f64> {
        let ratio = self.found / self.stated;
        (ratio > 0.0 && ratio.is_finite() && !(FAR.recip()..=FAR).contains(&ratio)).then_some(ratio)
    }
}

impl RowSet {
    /// Returns how the noise is known where these residuals, to which `fitted` parameters were fitted, have
    /// shown its scale.
    pub(super) fn noise_of_scale(&self, fitted: f64) -> Noise {
        let channels = self.channels.max(1) as f64;
        let left = (self.independent() - fitted / channels).max(1.0);
        Noise::Estimated { degrees_of_freedom: channels * left }
    }

    /// Returns the effective independent readings of each channel; filtered ones are worth `noise_gain` each.
    fn independent(&self) -> f64 {
        self.rows as f64 / self.channels.max(1) as f64 * self.noise_gain.min(1.0)
    }
}

/// Judges the residual sum of squares of all rows, to which `fitted` parameters were fitted.
///
/// A whitened, filtered row of set i has the variance `gain_i`, so
/// `E[RSS] = Σ rows_i gain_i · (rows − fitted) / rows`. Residuals larger than the stated noise can make them
/// scale the covariance.
pub fn judge(sets: &[RowSet], residual_sum_of_squares: f64, fitted: f64) -> Judgement {
    let rows: f64 = sets.iter().map(|s| s.rows as f64).sum();
    let expected: f64 = sets.iter().map(|s| s.rows as f64 * s.noise_gain).sum();
    let channels = sets.iter().map(|s| s.channels).max().unwrap_or(1).max(1) as f64;
    let left = |readings: f64| {
        let own = readings - fitted / channels;
        own.max(OWN_FREEDOM.min(0.5 * channels * own)).max(1.0)
    };
    let dof = left(sets.iter().map(RowSet::independent).sum());
    let estimated: f64 = sets.iter().filter(|s| !s.sigma_given).map(RowSet::independent).sum();
    let noise = if sets.iter().all(|s| s.sigma_given) {
        Noise::Given
    } else {
        Noise::Estimated { degrees_of_freedom: left(estimated) }
    };
    let variance_ratio = if sets.iter().any(|s| s.sigma_given) {
        residual_sum_of_squares / ((rows - fitted).max(1.0) * expected / rows.max(1.0))
    } else {
        1.0
    };
    let surprising = 1.0 + 4.0 * (2.0 / (channels * dof)).sqrt();
    let is_larger = variance_ratio > surprising;
    let variance_scale = if is_larger { variance_ratio } else { 1.0 };
    // A scale that the residuals have shown is as certain as these are many.
    let of_scale = Noise::Estimated { degrees_of_freedom: channels * dof };
    let noise = if is_larger { noise.less_certain(of_scale) } else { noise };
    Judgement { noise, variance_ratio, variance_scale }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// σ from residuals is as certain as the independent readings that are left over: a tenth of 1200 in each
    /// of two sets of six channels, less the sixteen parameters.
    #[test]
    fn noise_from_residuals_is_student_s() {
        let set = RowSet { rows: 1200, channels: 6, noise_gain: 0.1, sigma_given: false };
        let judged = judge(&[set, set], 300.0, 16.0);
        assert_eq!((judged.variance_ratio, judged.variance_scale), (1.0, 1.0));
        let Noise::Estimated { degrees_of_freedom } = judged.noise else { panic!("{judged:?}") };
        assert!((degrees_of_freedom - (40.0 - 16.0 / 6.0)).abs() < 1e-12);
    }

    #[test]
    fn stated_noise_scales_the_covariance_only_where_residuals_exceed_it() {
        let set = RowSet { rows: 10_000, channels: 1, noise_gain: 1.0, sigma_given: true };
        // The residual variance of 10 000 rows has a standard deviation of 1.4 %; four of them are
        // surprising.
        assert_eq!(judge(&[set], 10_000.0 * 1.05, 3.0).variance_scale, 1.0);
        let larger = judge(&[set], 10_000.0 * 1.07, 3.0);
        assert!((larger.variance_scale - 1.07).abs() < 1e-3);
        assert_eq!(larger.noise, Noise::Estimated { degrees_of_freedom: 9_997.0 });
        // Eight are few: t is 2.31.
        let few = RowSet { rows: 11, ..set };
        let scaled = judge(&[few], 110.0, 3.0);
        assert!(scaled.variance_scale > 10.0 && (scaled.noise.coverage_factor() - 2.306).abs() < 1e-3);
    }
}
