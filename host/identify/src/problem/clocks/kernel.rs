//! The local cubic that every stream goes through.
//!
//! Lives here: weights of a value and of a slope at an instant. May not live here: what the numbers mean.
//!
//! At the instant t the cubic in `x = (t_i − t)/h` is fitted by least squares with the weights `(1 − x²)²` on
//! `|x| < 1`; value and slope at t are linear in the samples. Cubics pass without error whatever the spacing,
//! so jitter of the stamps leaves no trace; of a sine the value loses `0.00125 (ω h)⁴`: 9e-5 at 2.35 Hz and h
//! = 35 ms.

use std::ops::Range;

use nalgebra::{Matrix4, Vector4};

/// Fewest samples in a window.
pub const LEAST_SAMPLES: usize = 5;
/// Fewest samples on either side of the instant: nothing is extrapolated.
const LEAST_BESIDE: usize = 2;

/// Weights of the samples under a window.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// The samples.
    pub range: Range<usize>,
    /// `Σ value_i y_i` is the fitted value.
    pub value: Vec<f64>,
    /// `Σ slope_i y_i` is the fitted slope, per second.
    pub slope: Vec<f64>,
}

impl Weights {
    /// The samples under the window at an instant, ns, of ascending sample times. `None` where there are too
    /// few, or a gap longer than half the window.
    pub fn window(time_ns: &[i64], at_ns: i64, half_ns: i64) -> Option<Range<usize>> {
        let from = time_ns.partition_point(|t| *t <= at_ns - half_ns);
        let under = time_ns.get(from..)?;
        let count = under.iter().take_while(|t| **t < at_ns + half_ns).count();
        let before = under.iter().take_while(|t| **t < at_ns).count();
        let under = under.get(..count)?;
        let enough = count >= LEAST_SAMPLES && before >= LEAST_BESIDE && count >= before + LEAST_BESIDE;
        let whole = under.windows(2).all(|pair| pair[1] - pair[0] <= half_ns);
        (enough && whole).then_some(from..from + count)
    }

    /// Weights at an instant for ascending sample times, ns; `None` where there is no [`Self::window`].
    pub fn at(time_ns: &[i64], at_ns: i64, half_ns: i64) -> Option<Self> {
        let range = Self::window(time_ns, at_ns, half_ns)?;
        let under = time_ns.get(range.clone())?;
        let half = half_ns as f64;
        let x = |t: &i64| (t - at_ns) as f64 / half;
        let bell = |x: f64| (1.0 - x * x).powi(2);
        let mut moments = [0.0; 7];
        for t in under {
            let x = x(t);
            let mut power = bell(x);
            for moment in &mut moments {
                *moment += power;
                power *= x;
            }
        }
        let gram = Matrix4::from_fn(|i, j| moments[i + j]);
        let factor = gram.cholesky()?;
        let unit = |k: usize| factor.solve(&Vector4::ith(k, 1.0));
        let weights = |c: Vector4<f64>, scale: f64| -> Vec<f64> {
            under
                .iter()
                .map(|t| {
                    let x = x(t);
                    scale * bell(x) * (c[0] + x * (c[1] + x * (c[2] + x * c[3])))
                })
                .collect()
        };
        Some(Self { range, value: weights(unit(0), 1.0), slope: weights(unit(1), 1e9 / half) })
    }

    /// The fitted value of a column.
    pub fn apply(&self, column: &[f64]) -> f64 {
        let samples = column.get(self.range.clone()).unwrap_or_default();
        samples.iter().zip(&self.value).map(|(y, w)| y * w).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jittered(count: i64, period_ns: i64) -> Vec<i64> {
        (0..count).map(|k| k * period_ns + (k * k * 7919) % (period_ns / 20)).collect()
    }

    #[test]
    fn cubics_pass_without_error_and_with_their_slope() {
        let times = jittered(60, 10_000_000);
        let cubic = |t: f64| 2.0 - 3.0 * t + 40.0 * t * t - 70.0 * t * t * t;
        let slope = |t: f64| -3.0 + 80.0 * t - 210.0 * t * t;
        let column: Vec<f64> = times.iter().map(|t| cubic(*t as f64 * 1e-9)).collect();
        for at in [120_000_001_i64, 304_444_444, 200_000_000] {
            let weights = Weights::at(&times, at, 35_000_000).unwrap();
            let t = at as f64 * 1e-9;
            assert!((weights.apply(&column) - cubic(t)).abs() < 1e-12);
            let samples = &column[weights.range.clone()];
            let got: f64 = samples.iter().zip(&weights.slope).map(|(y, w)| y * w).sum();
            assert!((got - slope(t)).abs() < 1e-9, "{got}");
        }
    }

    /// The series of the kernel's transfer function, from its fourth moment: what the module page states.
    #[test]
    fn a_sine_loses_the_stated_share_at_any_rate() {
        for period in [1_433_000_i64, 3_934_000, 10_090_000] {
            let times = jittered(2_000_000_000 / period, period);
            let (half, frequency) = (35_000_000_i64, 2.35);
            let omega = std::f64::consts::TAU * frequency;
            let column: Vec<f64> = times.iter().map(|t| (omega * *t as f64 * 1e-9).sin()).collect();
            // A crest.
            let at = (2.25 / frequency * 1e9) as i64;
            let lost = 1.0 - Weights::at(&times, at, half).unwrap().apply(&column);
            let stated = 0.00125 * (omega * half as f64 * 1e-9).powi(4);
            assert!((lost / stated - 1.0).abs() < 0.35, "{period}: {lost:e} {stated:e}");
        }
    }

    #[test]
    fn a_gap_or_an_end_gives_nothing() {
        let mut times = jittered(100, 1_000_000);
        times.drain(40..60);
        assert!(Weights::at(&times, 50_000_000, 15_000_000).is_none());
        assert!(Weights::at(&times, 500_000, 15_000_000).is_none());
        assert!(Weights::at(&times, 20_000_000, 15_000_000).is_some());
        assert!(Weights::at(&times[..4], 1_500_000, 15_000_000).is_none());
    }
}
