//! Spectra: of a recording for a picture, of residuals for the checks. The transform is rustfft's, as lengths
//! of recordings are no powers of two and the checks use the whole spectrum of up to 60 000 samples again and
//! again.

use std::f64::consts::TAU;

use nalgebra::DMatrix;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

use super::input::{FreeDecay, ModalError, Options};

/// Independent frequencies for one level of noise, at low frequencies and at high ones.
const LEAST_BLOCK: usize = 20;
const MOST_BLOCK: usize = 96;
/// Independent frequencies on each side of one, around which noise is measured.
const LEAST_SIDE: usize = 6;

/// Amplitude spectral density of each channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// Frequencies, Hz, from zero to half the rate.
    pub hz: Vec<f64>,
    /// One row for each frequency and one column for each channel, in the channel's unit / √Hz, one-sided.
    pub density: DMatrix<f64>,
}

/// Returns the amplitude spectral density (P. Welch 1967): segments of the given length that overlap by half,
/// each without its mean and under Hann's window, powers averaged. One segment if the recording is shorter
/// than that.
///
/// # Errors
/// [`ModalError`] if numbers are missing or the segment has no length.
pub fn spectrum(decay: &FreeDecay<'_>, segment_s: f64) -> Result<Spectrum, ModalError> {
    super::channels::check(decay, &Options::default())?;
    let (samples, channels) = decay.samples.shape();
    let length = (segment_s * decay.rate_hz).round();
    if !(length.is_finite() && length >= 8.0) {
        return Err(ModalError::Input(format!("a segment of {segment_s} s has less than eight samples")));
    }
    let length = (length as usize).min(samples);
    let window: Vec<f64> =
        (0..length).map(|k| 0.5 - 0.5 * (TAU * (k as f64 + 0.5) / length as f64).cos()).collect();
    let energy: f64 = window.iter().map(|w| w * w).sum();
    let bins = length / 2 + 1;
    let mut power = DMatrix::zeros(bins, channels);
    let starts: Vec<usize> = (0..=samples - length).step_by((length / 2).max(1)).collect();
    let mut planner = FftPlanner::new();
    let transform = planner.plan_fft_forward(length);
    for channel in 0..channels {
        for start in &starts {
            let part = decay.samples.column(channel).rows(*start, length).into_owned();
            let mean = part.mean();
            let mut line: Vec<Complex<f64>> =
                part.iter().zip(&window).map(|(v, w)| Complex::new((v - mean) * w, 0.0)).collect();
            transform.process(&mut line);
            for (sum, value) in power.column_mut(channel).iter_mut().zip(&line) {
                *sum += value.norm_sqr();
            }
        }
    }
    let to_density = |(row, sum): (usize, f64)| {
        let sides = if row == 0 || 2 * row == length { 1.0 } else { 2.0 };
        (sides * sum / (energy * decay.rate_hz * starts.len() as f64)).sqrt()
    };
    let density = DMatrix::from_fn(bins, channels, |row, channel| to_density((row, power[(row, channel)])));
    Ok(Spectrum { hz: (0..bins).map(|k| k as f64 * decay.rate_hz / length as f64).collect(), density })
}

/// Powers of columns, scaled so that white noise of variance σ² has the mean σ² at each frequency.
#[derive(Clone, Debug)]
pub(super) struct Periodogram {
    /// One row for each frequency, one column for each channel.
    power: DMatrix<f64>,
    /// Hz from row to row.
    step_hz: f64,
    /// Rows for each independent frequency.
    padding: usize,
}

impl Periodogram {
    /// Transforms columns with zeros added up to `padding` times their length; under Hann's window if asked
    /// for.
    pub(super) fn new(columns: &DMatrix<f64>, rate_hz: f64, padding: usize, hann: bool) -> Self {
        let (samples, channels) = columns.shape();
        let length = samples * padding;
        let window = |k: usize| {
            if hann { 0.5 - 0.5 * (TAU * (k as f64 + 0.5) / samples as f64).cos() } else { 1.0 }
        };
        let energy: f64 = (0..samples).map(|k| window(k).powi(2)).sum();
        let mut planner = FftPlanner::new();
        let transform = planner.plan_fft_forward(length);
        let mut power = DMatrix::zeros(length / 2, channels);
        for channel in 0..channels {
            let column = columns.column(channel);
            let mut line: Vec<Complex<f64>> =
                column.iter().enumerate().map(|(k, v)| Complex::new(v * window(k), 0.0)).collect();
            line.resize(length, Complex::new(0.0, 0.0));
            transform.process(&mut line);
            for (power, value) in power.column_mut(channel).iter_mut().zip(&line) {
                *power = value.norm_sqr() / energy;
            }
        }
        Self { power, step_hz: rate_hz / length as f64, padding }
    }

    pub(super) fn rows(&self) -> usize {
        self.power.nrows()
    }

    pub(super) fn hz(&self, row: usize) -> f64 {
        row as f64 * self.step_hz
    }

    /// Returns the number of independent frequencies.
    pub(super) fn independent(&self) -> usize {
        (self.rows() / self.padding).max(1)
    }

    /// Returns the sum over channels of power by the channel's level.
    pub(super) fn sum(&self, row: usize, level: &[f64]) -> f64 {
        self.power.row(row).iter().zip(level).map(|(p, l)| p / l.max(f64::MIN_POSITIVE)).sum()
    }

    /// Powers of the channels at a row.
    pub(super) fn at(&self, row: usize) -> Vec<f64> {
        self.power.row(row).iter().copied().collect()
    }

    /// Returns the rows of independent frequencies nearest to one: the same number on both sides, so that a
    /// slope does not count, at most `side` and at least [`LEAST_SIDE`] if there are as many. Not those
    /// closer than 1.5 of them to any of `away`, and not zero.
    fn near(&self, hz: f64, side: usize, away: &[f64]) -> Vec<usize> {
        let width = self.padding as f64 * self.step_hz;
        let is_free = |row: &usize| away.iter().all(|other| (self.hz(*row) - other).abs() > 1.5 * width);
        let free: Vec<usize> = (self.padding..self.rows()).step_by(self.padding).filter(is_free).collect();
        let place = free.partition_point(|row| self.hz(*row) < hz);
        let half = place.min(free.len() - place).clamp(LEAST_SIDE, side.max(LEAST_SIDE));
        free[place.saturating_sub(half)..(place + half).min(free.len())].to_vec()
    }

    /// Returns the mean power of each channel around a frequency: the variance of white noise that would do
    /// the same there.
    pub(super) fn mean_near(&self, hz: f64, side: usize, away: &[f64]) -> Vec<f64> {
        let rows = self.near(hz, side, away);
        let mean = |channel: usize| {
            rows.iter().map(|row| self.power[(*row, channel)]).sum::<f64>() / rows.len().max(1) as f64
        };
        (0..self.power.ncols()).map(mean).collect()
    }

    /// Returns the level of noise of each channel over all frequencies.
    pub(super) fn level(&self) -> Vec<f64> {
        self.middle(&(self.padding..self.rows()).step_by(self.padding).collect::<Vec<_>>())
    }

    /// Levels of noise over blocks of frequencies that grow with frequency, as the levels of most noise
    /// change by the octave.
    pub(super) fn levels(&self) -> Levels {
        let picked: Vec<usize> = (self.padding..self.rows()).step_by(self.padding).collect();
        let (mut hz, mut level) = (Vec::new(), Vec::new());
        let mut first = 0;
        while first < picked.len() {
            let length = (first / 2).clamp(LEAST_BLOCK, MOST_BLOCK);
            // What is too little for a block of its own goes to the last one.
            let rest = picked.len() - first;
            let block = &picked[first..first + if rest < 2 * length { rest } else { length }];
            hz.push(block.iter().map(|row| self.hz(*row)).sum::<f64>() / block.len() as f64);
            level.push(self.middle(block));
            first += block.len();
        }
        Levels { hz, level }
    }

    /// Returns the median power of each channel over rows, by that of noise of level one, `ln 2`: lines do
    /// not move it.
    fn middle(&self, rows: &[usize]) -> Vec<f64> {
        let of = |channel: usize| {
            let mut powers: Vec<f64> = rows.iter().map(|row| self.power[(*row, channel)]).collect();
            median(&mut powers) / std::f64::consts::LN_2
        };
        (0..self.power.ncols()).map(of).collect()
    }
}

/// Levels of noise over frequency.
#[derive(Clone, Debug)]
pub(super) struct Levels {
    hz: Vec<f64>,
    level: Vec<Vec<f64>>,
}

impl Levels {
    /// Returns the level of each channel at a frequency, between the blocks on a straight line of logarithms.
    pub(super) fn at(&self, hz: f64) -> Vec<f64> {
        let after = self.hz.partition_point(|h| *h < hz);
        let (low, high) = (after.saturating_sub(1), after.min(self.hz.len().saturating_sub(1)));
        let (Some(below), Some(above)) = (self.level.get(low), self.level.get(high)) else {
            return Vec::new();
        };
        let span = self.hz[high] - self.hz[low];
        let share = if span > 0.0 { ((hz - self.hz[low]) / span).clamp(0.0, 1.0) } else { 0.0 };
        let between = |(a, b): (&f64, &f64)| {
            if *a > 0.0 && *b > 0.0 { (a.ln() + share * (b / a).ln()).exp() } else { a + share * (b - a) }
        };
        below.iter().zip(above).map(between).collect()
    }
}

/// Returns the middle one; it sorts.
pub(super) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { 0.0 } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}
