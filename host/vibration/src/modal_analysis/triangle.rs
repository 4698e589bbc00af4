//! Rows of a decay, and the triangle that orthogonal reflections make of them.
//!
//! A pole gives the columns `c = e^{−αt} cos νt` and `s = e^{−αt} sin νt`, and `t c`, `t s`, of which its
//! derivatives consist. Of `[1 c₁ s₁ … | t c₁ t s₁ … | y]` only the triangle is stored, in which residuals and
//! projections are as exact as in the rows; held poles come after the others, without derivatives.

use nalgebra::DMatrix;

use super::input::FreeDecay;

/// A decaying vibration `e^{−αt} cos(νt + …)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pole {
    /// Decay rate α, 1/s; negative if it grows.
    pub decay: f64,
    /// Damped angular frequency ν, rad/s.
    pub angular: f64,
}

impl Pole {
    /// Returns the damped frequency, Hz.
    pub fn hz(&self) -> f64 {
        self.angular / std::f64::consts::TAU
    }

    /// Returns the undamped natural angular frequency `ω = √(α² + ν²)`, rad/s.
    pub fn natural(&self) -> f64 {
        self.decay.hypot(self.angular)
    }

    /// Returns the damping ratio `ζ = α / ω`.
    pub fn damping(&self) -> f64 {
        self.decay / self.natural()
    }
}

/// Uniform samples, one row each.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    pub(super) rate_hz: f64,
    pub(super) y: DMatrix<f64>,
    /// Poles that are in the samples beside those that are searched, with unknown amplitudes.
    pub(super) held: Vec<Held>,
}

/// A pole that is in the samples, with unknown amplitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Held {
    pub(super) pole: Pole,
    /// The inverse of the amplitudes' size beforehand, by the noise of a sample; zero where nothing is known.
    pub(super) weight: f64,
}

impl Samples {
    /// Takes over a recording without its means, which the fit's offsets then hold.
    pub(super) fn new(decay: &FreeDecay<'_>) -> Self {
        let mut y = decay.samples.clone();
        for mut column in y.column_iter_mut() {
            let mean = column.mean();
            column.add_scalar_mut(-mean);
        }
        Self { rate_hz: decay.rate_hz, y, held: Vec::new() }
    }

    /// Returns the same samples with other poles that are known to be in them.
    pub(super) fn holding(&self, held: Vec<Held>) -> Self {
        Self { rate_hz: self.rate_hz, y: self.y.clone(), held }
    }

    /// Returns the poles that are searched, then those that are held.
    fn with_held<'a>(&'a self, poles: &'a [Pole]) -> impl Iterator<Item = &'a Pole> {
        poles.iter().chain(self.held.iter().map(|own| &own.pole))
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.y.nrows() as f64 / self.rate_hz
    }

    /// Returns means of the given number of samples each: an exponential stays one, with the same pole, and
    /// white noise stays white.
    pub(super) fn averaged(&self, factor: usize) -> Self {
        let rows = self.y.nrows() / factor;
        let mean = |row: usize, channel: usize| self.y.column(channel).rows(row * factor, factor).mean();
        let y = DMatrix::from_fn(rows, self.y.ncols(), mean);
        Self { rate_hz: self.rate_hz / factor as f64, y, held: self.held.clone() }
    }

    pub(super) fn part(&self, first: usize, rows: usize) -> Self {
        let y = self.y.rows(first, rows).into_owned();
        Self { rate_hz: self.rate_hz, y, held: self.held.clone() }
    }

    /// Returns the root mean square of each channel.
    pub(super) fn sizes(&self) -> Vec<f64> {
        self.y.column_iter().map(|column| column.norm() / (self.y.nrows().max(1) as f64).sqrt()).collect()
    }
}

/// Returns the number of columns of the offset and of the poles, held ones included.
pub(super) fn linear(poles: usize, held: usize) -> usize {
    1 + 2 * (poles + held)
}

/// Returns the number of columns of the offset, of the poles and of the derivatives of those not held.
pub(super) fn all(poles: usize, held: usize) -> usize {
    linear(poles, held) + 2 * poles
}

/// Returns the upper triangle of `[1 c s … | held c s … | t c t s … | y]`.
pub(super) fn triangle(samples: &Samples, poles: &[Pole]) -> DMatrix<f64> {
    let (rows, channels) = samples.y.shape();
    let width = all(poles.len(), samples.held.len()) + channels;
    let chunk = (4 * width).max(64);
    let mut upper = DMatrix::<f64>::zeros(width, width);
    let mut first = 0;
    while first < rows {
        let count = chunk.min(rows - first);
        let mut stacked = DMatrix::zeros(width + count, width);
        stacked.rows_mut(0, width).copy_from(&upper);
        for k in 0..count {
            fill(&mut stacked, width + k, samples, first + k, poles);
        }
        upper = stacked.qr().unpack_r();
        first += count;
    }
    if samples.held.iter().all(|own| own.weight <= 0.0) {
        return upper;
    }
    let before = 1 + 2 * poles.len();
    let mut stacked = DMatrix::zeros(width + 2 * samples.held.len(), width);
    stacked.rows_mut(0, width).copy_from(&upper);
    for (k, own) in samples.held.iter().enumerate() {
        for side in [0, 1] {
            stacked[(width + 2 * k + side, before + 2 * k + side)] = own.weight;
        }
    }
    stacked.qr().unpack_r()
}

fn fill(stacked: &mut DMatrix<f64>, row: usize, samples: &Samples, sample: usize, poles: &[Pole]) {
    let t = sample as f64 / samples.rate_hz;
    let held = samples.held.len();
    let (derivatives, last) = (linear(poles.len(), held), all(poles.len(), held));
    stacked[(row, 0)] = 1.0;
    for (r, pole) in samples.with_held(poles).enumerate() {
        let size = (-pole.decay * t).exp();
        let (sine, cosine) = (pole.angular * t).sin_cos();
        stacked[(row, 1 + 2 * r)] = size * cosine;
        stacked[(row, 2 + 2 * r)] = size * sine;
        if r < poles.len() {
            stacked[(row, derivatives + 2 * r)] = t * size * cosine;
            stacked[(row, derivatives + 1 + 2 * r)] = t * size * sine;
        }
    }
    for channel in 0..samples.y.ncols() {
        stacked[(row, last + channel)] = samples.y[(sample, channel)];
    }
}

/// Returns what is left of the samples without offsets and decays.
pub(super) fn residuals(samples: &Samples, poles: &[Pole], amplitudes: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, channels) = samples.y.shape();
    let mut left = samples.y.clone();
    for sample in 0..rows {
        let t = sample as f64 / samples.rate_hz;
        for channel in 0..channels {
            left[(sample, channel)] -= amplitudes[(0, channel)];
        }
        for (r, pole) in samples.with_held(poles).enumerate() {
            let size = (-pole.decay * t).exp();
            let (sine, cosine) = (pole.angular * t).sin_cos();
            for channel in 0..channels {
                let (a, b) = (amplitudes[(1 + 2 * r, channel)], amplitudes[(2 + 2 * r, channel)]);
                left[(sample, channel)] -= size * (a * cosine + b * sine);
            }
        }
    }
    left
}
