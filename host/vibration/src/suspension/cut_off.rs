//! The frequency that poses are smoothed at.
//!
//! One kernel is on both sides of the equation, which is exact at any cut-off; but noise, differentiated
//! twice, grows as the square of the frequency and makes bodies small. So the cut-off is as low as the
//! motion allows; and lower, if that leaves noise a small share of the acceleration.

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Highest frequency that is checked, Hz.
const HIGHEST_HZ: f64 = 60.0;
/// Lowest cut-off, Hz.
const LOWEST_HZ: f64 = 0.25;
/// Power of acceleration above the cut-off is less than this share of all.
const LEFT_OUT: f64 = 1e-2;
/// Power of less than this many times the noise's is noise.
const ABOVE_NOISE: f64 = 20.0;
/// The cut-off over the highest frequency that is to pass.
const ROOM: f64 = 1.2;
/// Noise has at most this share of the power of acceleration below the cut-off, in the coordinate where it
/// has least.
const NOISE_SHARE: f64 = 0.02;

/// The spectrum of a coordinate: powers at multiples of a step.
pub(super) struct Lines {
    step_hz: f64,
    powers: Vec<f64>,
    /// Mean power of white noise.
    noise: f64,
}

impl Lines {
    /// Returns the spectrum of numbers at a rate, less their mean, with a Hann window.
    pub(super) fn of(own: &[f64], rate_hz: f64) -> Self {
        let n = own.len().max(1);
        let mean = own.iter().sum::<f64>() / n as f64;
        let window = |k: usize| 0.5 - 0.5 * (std::f64::consts::TAU * (k as f64 + 0.5) / n as f64).cos();
        let mut all: Vec<Complex<f64>> =
            own.iter().enumerate().map(|(k, v)| Complex::from(window(k) * (v - mean))).collect();
        FftPlanner::new().plan_fft_forward(all.len()).process(&mut all);
        let step_hz = rate_hz / n as f64;
        let count = (HIGHEST_HZ.min(0.2 * rate_hz) / step_hz) as usize;
        let powers: Vec<f64> = all.iter().skip(1).take(count).map(Complex::norm_sqr).collect();
        let mut top: Vec<f64> = powers.iter().skip(3 * powers.len() / 4).copied().collect();
        top.sort_by(f64::total_cmp);
        // The median of powers of noise is ln 2 of their mean.
        let noise = top.get(top.len() / 2).copied().unwrap_or(0.0) / std::f64::consts::LN_2;
        Self { step_hz, powers, noise }
    }

    /// Returns frequencies, Hz, and the power of acceleration, of what is no noise.
    fn accelerations(&self) -> impl DoubleEndedIterator<Item = (f64, f64)> {
        let all = self.powers.iter().enumerate().filter(|(_, p)| **p > ABOVE_NOISE * self.noise);
        all.map(|(k, p)| ((k + 1) as f64 * self.step_hz, p - self.noise)).map(|(hz, p)| (hz, p * hz.powi(4)))
    }

    /// Returns the highest frequency at which the coordinate accelerates visibly, Hz; zero: at none.
    fn highest_hz(&self) -> f64 {
        let whole: f64 = self.accelerations().map(|(_, power)| power).sum();
        let mut left = 0.0;
        let found = self.accelerations().rev().find(|(_, power)| {
            left += power;
            left > LEFT_OUT * whole
        });
        found.map_or(0.0, |(hz, _)| hz)
    }

    /// Returns the highest frequency up to `cut_off_hz`, Hz, below which noise is a small share of the
    /// acceleration, and the strongest vibration passes; `None` if there is none.
    fn quiet_hz(&self, cut_off_hz: f64) -> Option<f64> {
        let (strongest, _) = self.accelerations().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let (mut all, mut noise, mut found) = (0.0, 0.0, None);
        for (k, power) in self.powers.iter().enumerate() {
            let hz = (k + 1) as f64 * self.step_hz;
            all += power * hz.powi(4);
            noise += self.noise * hz.powi(4);
            if hz > cut_off_hz {
                break;
            }
            if noise <= NOISE_SHARE * all && hz >= ROOM * strongest {
                found = Some(hz);
            }
        }
        found
    }
}

/// Returns the cut-off for coordinates of these spectra, Hz. Where noise is large whatever the cut-off, no
/// motion is left out.
pub(super) fn cut_off_hz(all: &[Lines]) -> f64 {
    let cut_off = ROOM * all.iter().map(Lines::highest_hz).fold(LOWEST_HZ, f64::max);
    all.iter().filter_map(|lines| lines.quiet_hz(cut_off)).max_by(f64::total_cmp).unwrap_or(cut_off)
}
