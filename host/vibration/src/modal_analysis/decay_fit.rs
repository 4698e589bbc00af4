//! Maximum likelihood of poles, amplitudes and offsets under white noise, by variable projection.
//!
//! `y_c(t) = offset_c + Σ_r e^{−α_r t} (a_rc cos ν_r t + b_rc sin ν_r t) + noise of σ_c`. For given poles the
//! rest is linear, so that only the poles are searched: least is `Σ_c N ln SSE_c` (σ_c² = SSE_c / N put in),
//! by Levenberg's and Marquardt's steps with the projected derivatives (L. Kaufman 1975; G. Golub, V. Pereyra
//! 1973).

use nalgebra::{DMatrix, DVector};

use super::triangle::{Pole, Samples, all, linear, triangle};

/// Residuals below this part of a channel are rounding.
const ROUNDING: f64 = 1e-13;
/// Column that hardly differs from those before it.
const DEPENDENT: f64 = 1e-11;
/// Steps that did not help, after which the fit is as good as it gets.
const FAILURES: usize = 9;

/// Poles with what belongs to them.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) poles: Vec<Pole>,
    /// Triangle of the rows, see [`triangle`].
    pub(super) upper: DMatrix<f64>,
    /// Number of the samples' held poles.
    held: usize,
    /// Offsets in the first row; then `a` and `b` of each pole, those of held ones last; one column for each
    /// channel.
    pub(super) amplitudes: DMatrix<f64>,
    /// Standard deviation of each channel's noise, by its degrees of freedom.
    pub(super) sigma: Vec<f64>,
    /// `Σ_c N ln(SSE_c / N)`.
    pub(super) objective: f64,
    /// The noise below which a channel's residual is rounding.
    floor: Vec<f64>,
}

impl Fit {
    /// Solves for amplitudes at given poles; nothing if the rows do not tell the poles apart.
    pub(super) fn at(samples: &Samples, poles: Vec<Pole>) -> Option<Self> {
        let upper = triangle(samples, &poles);
        let held = samples.held.len();
        let (p, q, channels) = (linear(poles.len(), held), all(poles.len(), held), samples.y.ncols());
        let independent = (0..p).all(|k| upper[(k, k)].abs() > DEPENDENT * upper.column(k).norm());
        let count = samples.y.nrows();
        if !independent || count <= p + 2 || upper.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let right = upper.view((0, q), (p, channels)).into_owned();
        let amplitudes = upper.view((0, 0), (p, p)).solve_upper_triangular(&right)?;
        let floor: Vec<f64> =
            (0..channels).map(|c| ROUNDING * upper.column(q + c).norm() / (count as f64).sqrt()).collect();
        let squares = (0..channels).map(|c| upper.view((p, q + c), (q - p + c + 1, 1)).norm_squared());
        let squares: Vec<f64> = squares.collect();
        let spent = p as f64 + 2.0 * poles.len() as f64 / channels as f64;
        let freedom = (count as f64 - spent).max(1.0);
        let level = |(square, floor): (&f64, &f64)| square / count as f64 + floor * floor;
        let logarithms: f64 =
            squares.iter().zip(&floor).map(level).map(|v| v.max(f64::MIN_POSITIVE).ln()).sum();
        let objective = count as f64 * logarithms;
        let sigma =
            squares.iter().zip(&floor).map(|(s, f)| (s / freedom + f * f).sqrt().max(1e-150)).collect();
        Some(Self { poles, upper, held, amplitudes, sigma, objective, floor })
    }

    /// Returns the numbers of columns before the derivatives, and before the channels.
    pub(super) fn columns(&self) -> (usize, usize) {
        (linear(self.poles.len(), self.held), all(self.poles.len(), self.held))
    }

    /// Returns whether a channel's residual is nothing but rounding.
    pub(super) fn is_rounding(&self, channel: usize) -> bool {
        self.sigma[channel] <= 20.0 * self.floor[channel].max(1e-150)
    }

    /// Levels of noise, at least what counts as rounding.
    pub(super) fn above_rounding(&self, levels: &[f64]) -> Vec<f64> {
        levels.iter().zip(&self.floor).map(|(level, floor)| level.max((20.0 * floor).powi(2))).collect()
    }

    /// Returns whether all residuals are nothing but rounding.
    pub(super) fn is_exact(&self) -> bool {
        (0..self.sigma.len()).all(|channel| self.is_rounding(channel))
    }

    /// Returns `S_c` of a channel: the derivatives of its rows by (α₁ ν₁ α₂ …) in the columns `t c`, `t s`:
    /// `∂/∂α = −a tc − b ts`, `∂/∂ν = b tc − a ts`.
    pub(super) fn derivative(&self, channel: usize) -> DMatrix<f64> {
        let count = self.poles.len();
        let mut s = DMatrix::zeros(2 * count, 2 * count);
        for r in 0..count {
            let (a, b) = (self.amplitudes[(1 + 2 * r, channel)], self.amplitudes[(2 + 2 * r, channel)]);
            s[(2 * r, 2 * r)] = -a;
            s[(2 * r + 1, 2 * r)] = -b;
            s[(2 * r, 2 * r + 1)] = b;
            s[(2 * r + 1, 2 * r + 1)] = -a;
        }
        s
    }

    /// Returns the information on the poles with amplitudes and offsets free, and the right side of the step.
    fn normal(&self) -> (DMatrix<f64>, DVector<f64>) {
        let (p, q) = self.columns();
        let free = self.upper.view((p, p), (q - p, q - p));
        let mut information = DMatrix::zeros(q - p, q - p);
        let mut right = DVector::zeros(q - p);
        for (channel, sigma) in self.sigma.iter().enumerate() {
            let jacobian = free * self.derivative(channel) / *sigma;
            let residual = self.upper.view((p, q + channel), (q - p, 1)) / *sigma;
            information += jacobian.tr_mul(&jacobian);
            right += jacobian.tr_mul(&residual).column(0);
        }
        (information, right)
    }

    /// Returns the covariance of (α₁ ν₁ α₂ …) under white noise; nothing if they are not determined.
    pub(super) fn pole_covariance(&self) -> Option<DMatrix<f64>> {
        scaled_inverse(&self.normal().0)
    }

    /// Returns how much of the likelihood hangs on each pole's amplitudes: `Σ_c x_cᵀ V⁻¹ x_c / level_c`
    /// over `(a, b)`, V their covariance at unit noise and fixed poles; held ones are counted after the
    /// others. It is χ² with two degrees of freedom for each channel if the pole is not there.
    pub(super) fn strength(&self, pole: usize, level: &[f64]) -> f64 {
        let Some(weight) = self.amplitudes_known_to(pole).and_then(|own| own.try_inverse()) else {
            return 0.0;
        };
        let mut sum = 0.0;
        for (channel, level) in level.iter().enumerate() {
            let x = self.amplitudes.view((1 + 2 * pole, channel), (2, 1));
            sum += (x.transpose() * &weight * x)[(0, 0)] / level.max(f64::MIN_POSITIVE);
        }
        sum
    }

    /// Returns the trace of the information on a pole's amplitudes at unit noise and fixed poles.
    pub(super) fn information(&self, pole: usize) -> f64 {
        self.amplitudes_known_to(pole).and_then(|own| own.try_inverse()).map_or(0.0, |own| own.trace())
    }

    /// Returns the covariance of `(a, b)` of a pole at unit noise and fixed poles.
    fn amplitudes_known_to(&self, pole: usize) -> Option<DMatrix<f64>> {
        let p = self.columns().0;
        let inverse = self.upper.view((0, 0), (p, p)).solve_upper_triangular(&DMatrix::identity(p, p))?;
        let rows = inverse.rows(1 + 2 * pole, 2);
        Some(rows * rows.transpose())
    }

    /// Searches from given poles; nothing if they cannot be distinguished.
    pub(super) fn refined(samples: &Samples, poles: Vec<Pole>, steps: usize) -> Option<Self> {
        let mut best = Self::at(samples, poles)?;
        let mut damping = 1e-4;
        let mut failures = 0;
        for _ in 0..steps {
            if best.poles.is_empty() {
                break;
            }
            let (information, right) = best.normal();
            let Some(step) = step(&information, &right, damping) else { break };
            let moved = best.moved(samples, &step);
            let tried = moved.and_then(|poles| Self::at(samples, poles));
            match tried {
                Some(tried) if tried.objective < best.objective => {
                    let gain = best.objective - tried.objective;
                    best = tried;
                    damping = f64::max(0.1 * damping, 1e-12);
                    failures = 0;
                    if gain < 1e-9 {
                        break;
                    }
                }
                _ => {
                    damping *= 10.0;
                    failures += 1;
                    if failures > FAILURES || right.dot(&step) < 1e-10 {
                        break;
                    }
                }
            }
        }
        Some(best)
    }

    /// Poles after a step that is shortened to what a recording of this length can still follow.
    fn moved(&self, samples: &Samples, step: &DVector<f64>) -> Option<Vec<Pole>> {
        let duration = samples.duration_s();
        let mut share: f64 = 1.0;
        for (r, pole) in self.poles.iter().enumerate() {
            let reach = 2.0 / duration + 0.5 * pole.decay.abs();
            share = share.min(reach / step[2 * r].abs().max(step[2 * r + 1].abs()).max(1e-300));
        }
        let moved: Vec<Pole> = self
            .poles
            .iter()
            .enumerate()
            .map(|(r, pole)| Pole {
                decay: pole.decay + share * step[2 * r],
                angular: pole.angular + share * step[2 * r + 1],
            })
            .collect();
        let half = std::f64::consts::PI * samples.rate_hz;
        let is_possible = |pole: &Pole| {
            pole.angular > 0.5 / duration
                && pole.angular < half
                && pole.decay * duration > -6.0
                && pole.decay < 2.0 * pole.angular
        };
        moved.iter().all(is_possible).then_some(moved)
    }
}

/// Returns `(A + μ diag A)⁻¹ b`, columns scaled.
fn step(information: &DMatrix<f64>, right: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let scale = information.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let n = scale.len();
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        information[(i, j)] * scale[i] * scale[j] + if i == j { damping } else { 0.0 }
    });
    let solved = scaled.cholesky()?.solve(&right.component_mul(&scale)).component_mul(&scale);
    solved.iter().all(|v| v.is_finite()).then_some(solved)
}

/// Returns the inverse of a positive definite matrix, columns scaled; nothing if it is not.
pub(super) fn scaled_inverse(information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = information.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { f64::NAN });
    let n = scale.len();
    let scaled = DMatrix::from_fn(n, n, |i, j| information[(i, j)] * scale[i] * scale[j]);
    let inverse = scaled.cholesky()?.inverse();
    let inverse = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
    inverse.iter().all(|v| v.is_finite()).then_some(inverse)
}
