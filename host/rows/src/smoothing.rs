//! Zero-phase smoothing of tracked coordinates and of wrenches by one kernel, and how wide it should be.
//!
//! The kernel is the one that rows are filtered by, `(1 − x²)⁸` on its width: symmetric, so nothing is
//! delayed. Coordinates are smoothed on their frames, wrenches on their own samples at the times of the
//! frames: the same low-pass on both sides.

use rigident_shared::conditioning::Kernel;

use rigident_fit::parallel;
use rigident_io::motion_capture::ground::GroundWrench;

/// Cut-off times width: where `(1 − x²)⁸` lets 1/√2 of the amplitude pass.
const CUT_OFF_TIMES_WIDTH: f64 = 1.1455;
/// Room for the kernel.
const TAPS: usize = 1024;
/// Cut-offs that are compared of people, Hz.
pub const CUT_OFFS_HZ: [f64; 9] = [3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 15.0];
/// A cut-off above this share of the rate smooths nothing.
pub const HIGHEST: f64 = 0.25;

/// A kernel on evenly spaced samples.
#[derive(Clone, Debug)]
pub struct Smoother {
    /// The cut-off, Hz.
    pub cut_off_hz: f64,
    smooth: Vec<f64>,
    slope: Vec<f64>,
}

impl Smoother {
    /// Returns the smoother of this cut-off (−3 dB), for samples at a rate; `None` if it would take fewer
    /// than three of them or more than there is room for.
    pub fn new(cut_off_hz: f64, rate_hz: f64) -> Option<Self> {
        let kernel = Kernel::<f64, TAPS>::new(rate_hz, width_s(cut_off_hz), 1).ok()?;
        (kernel.smooth().len() >= 3).then(|| Self {
            cut_off_hz,
            smooth: kernel.smooth().to_vec(),
            slope: kernel.derivative().to_vec(),
        })
    }

    /// Returns the number of samples on either side.
    pub fn half(&self) -> usize {
        self.smooth.len() / 2
    }

    /// Returns the weights of value and slope (per second), sample by sample.
    pub fn weights(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.smooth.iter().copied().zip(self.slope.iter().copied())
    }

    /// Returns value and slope (per second) in the middle of as many samples as there are weights.
    pub fn at(&self, samples: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
        let sum = |weights: &[f64]| weights.iter().zip(samples.clone()).map(|(w, s)| w * s).sum();
        (sum(&self.smooth), sum(&self.slope))
    }

    /// Returns the logarithm of the generalised cross-validation of a series: `mean (x − h∗x)² / (1 − h₀)²`;
    /// `None` if it is too short.
    fn cross_validation(&self, series: &[f32]) -> Option<f64> {
        let middle = self.smooth.get(self.half()).copied()?;
        let windows = series.windows(self.smooth.len());
        let (mut sum, mut count) = (0.0, 0_usize);
        for window in windows.filter(|w| w.iter().all(|v| v.is_finite())) {
            // About the middle, so that a large constant costs no digits.
            let own = window[self.half()];
            let left: f64 = self.smooth.iter().zip(window).map(|(w, v)| w * f64::from(v - own)).sum();
            sum += left * left;
            count += 1;
        }
        let value = sum / count.max(1) as f64 / (1.0 - middle).powi(2);
        (count > 0 && value > 0.0).then(|| value.ln())
    }
}

/// Returns the width of the kernel with a cut-off, s.
pub fn width_s(cut_off_hz: f64) -> f64 {
    CUT_OFF_TIMES_WIDTH / cut_off_hz
}

/// Returns the cut-off of a kernel of a width, Hz.
pub fn cut_off_hz(width_s: f64) -> f64 {
    CUT_OFF_TIMES_WIDTH / width_s
}

/// Returns the cut-off, Hz, that predicts left-out samples of the given number of series best: least mean
/// logarithm of their generalised cross-validation (P. Craven and G. Wahba 1979; for human movement H.
/// Woltring 1986).
///
/// Candidates above a quarter of the rate are not examined. The fourth candidate is the answer where no
/// series is long enough.
pub fn best_cut_off(
    count: usize,
    series: impl Fn(usize) -> Vec<f32> + Sync,
    rate_hz: f64,
    candidates_hz: &[f64],
) -> f64 {
    let candidates = candidates_hz.iter().filter(|f| **f <= HIGHEST * rate_hz);
    let smoothers: Vec<Smoother> = candidates.filter_map(|f| Smoother::new(*f, rate_hz)).collect();
    let of = |k: usize| -> Vec<Option<f64>> {
        let own = series(k);
        smoothers.iter().map(|smoother| smoother.cross_validation(&own)).collect()
    };
    let all = parallel::map(parallel::threads(), count, of);
    let mean = |(k, smoother): (usize, &Smoother)| {
        let each: Vec<f64> = all.iter().filter_map(|own| own[k]).collect();
        (!each.is_empty()).then(|| (each.iter().sum::<f64>() / each.len() as f64, smoother.cut_off_hz))
    };
    let best = smoothers.iter().enumerate().filter_map(mean).min_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or(candidates_hz.get(3).copied().unwrap_or(CUT_OFFS_HZ[3]), |(_, cut_off)| cut_off)
}

/// Returns a plate's wrench smoothed at an instant; `None` near either end, or where a sample under the
/// kernel is not finite.
///
/// The kernel's variance is `h²/19`, h half its width: where samples are means over T, it is narrower by
/// their `T²/12`.
pub fn smoothed_at(plate: &GroundWrench, cut_off_hz: f64, time_s: f64) -> Option<[f64; 6]> {
    let wide = width_s(cut_off_hz) / 2.0;
    let half = (wide * wide - plate.mean_s * plate.mean_s * 19.0 / 12.0).max(0.25 * wide * wide).sqrt();
    let place = |t: f64| (t - plate.first_s) * plate.rate_hz;
    let (from, to) = (place(time_s - half).ceil(), place(time_s + half).floor());
    if from < 0.0 || to >= plate.wrench.len() as f64 || to <= from {
        return None;
    }
    let (mut sum, mut weights) = ([0.0; 6], 0.0);
    let first = from as usize;
    for (k, sample) in plate.wrench.get(first..=to as usize)?.iter().enumerate() {
        let x = (plate.first_s + (first + k) as f64 / plate.rate_hz - time_s) / half;
        let weight = (1.0 - x * x).max(0.0).powi(8);
        weights += weight;
        sum.iter_mut().zip(sample).for_each(|(s, v)| *s += weight * f64::from(*v));
    }
    let out = sum.map(|s| s / weights);
    out.iter().all(|v| v.is_finite()).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(frequency: f64, rate: f64, count: usize) -> Vec<f64> {
        (0..count).map(|k| (std::f64::consts::TAU * frequency * k as f64 / rate).sin()).collect()
    }

    #[test]
    fn a_sine_at_the_cut_off_keeps_half_its_power_on_both_sides() {
        for (cut_off, rate) in [(6.0, 100.0), (10.0, 120.0), (6.0, 1000.0)] {
            let samples = sine(cut_off, rate, 4000);
            let smoother = Smoother::new(cut_off, rate).unwrap();
            let n = 2 * smoother.half() + 1;
            let out: Vec<f64> = samples.windows(n).map(|w| smoother.at(w.iter().copied()).0).collect();
            let power = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>() / v.len() as f64;
            assert!((power(&out) / power(&samples) - 0.5).abs() < 0.01, "{}", power(&out));
            let mut plate = GroundWrench {
                name: String::new(),
                corners_m: None,
                rate_hz: rate,
                first_s: 0.0,
                mean_s: 0.0,
                wrench: samples.iter().map(|v| [*v as f32; 6]).collect(),
            };
            let middle = 2000;
            let time_s = middle as f64 / rate;
            let own = smoother.at(samples[middle - n / 2..=middle + n / 2].iter().copied()).0;
            let other = smoothed_at(&plate, cut_off, time_s).unwrap()[3];
            // Plates keep single precision.
            assert!((own - other).abs() < f64::from(f32::EPSILON), "{own} {other}");
            // Means of neighbours are smoothed as much.
            plate.wrench = plate
                .wrench
                .chunks_exact(6)
                .map(|six| [six.iter().map(|v| v[0]).sum::<f32>() / 6.0; 6])
                .collect();
            (plate.rate_hz, plate.first_s, plate.mean_s) = (rate / 6.0, 2.5 / rate, 6.0 / rate);
            if plate.rate_hz > 10.0 * cut_off {
                let means = smoothed_at(&plate, cut_off, time_s).unwrap()[3];
                assert!((own - means).abs() < 2e-4, "{own} {means}");
            }
        }
    }

    #[test]
    fn the_cut_off_follows_the_noise() {
        let mut state = 7_u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1_u64 << 31) as f64 - 0.5
        };
        let clean = sine(2.0, 100.0, 1000);
        let little: Vec<f32> = clean.iter().map(|v| (v + 1e-4 * noise()) as f32).collect();
        let much: Vec<f32> = clean.iter().map(|v| (v + 0.1 * noise()) as f32).collect();
        let (low, high) = (
            best_cut_off(1, |_| much.clone(), 100.0, &CUT_OFFS_HZ),
            best_cut_off(1, |_| little.clone(), 100.0, &CUT_OFFS_HZ),
        );
        assert!(low < high && low >= 3.0, "{low} {high}");
    }
}
