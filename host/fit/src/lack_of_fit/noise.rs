//! Noise of a channel over bins of time: white, flicker (1/f) and a random walk (1/f²), and the inverse of
//! its covariance.
//!
//! These are the slopes −½, 0 and +½ of an Allan deviation. Flicker noise is a sum of exponentially
//! correlated noise of time constants an octave apart (A. van der Ziel, On the noise spectra of
//! semi-conductor noise and of flicker effect, Physica 16, 1950). Their variances are those of the most
//! likelihood for the periodogram of residuals: with the rows of the model projected out, a cosine
//! coefficient has the variance `μ_j = Σ_k v_k M_jk`, M exactly that of the projected noise, and
//! `v_k ← v_k √(Σ_j (I_j/μ_j) M_jk/μ_j / Σ_j M_jk/μ_j)` never loses likelihood (C. Févotte, J. Idier, Neural
//! Computation 23, 2011).

use nalgebra::{DMatrix, DVector};

/// Coefficients that are examined one by one; above, this many to an octave.
const LOWEST: usize = 64;
const PER_OCTAVE: f64 = 32.0;
/// Steps of the likelihood.
const STEPS: usize = 200;
/// A coefficient of which the model leaves less than this says nothing.
const LEAST_LEFT: f64 = 0.05;
/// Slow noise is taken as this many standard deviations larger than found: few coefficients show it, and a
/// step explains some.
const UPPER_SD: f64 = 2.0;
/// Of a column less than this is rounding.
pub(super) const ROUNDING: f64 = 1e-8;
/// Least variance of white noise, of that which the residuals have, and of that which was stated: residuals
/// that are smaller by far are none of a sensor's.
const LEAST_WHITE: f64 = 1e-3;

/// Variances of white, flicker and walking noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PowerLaw {
    pub(super) white: f64,
    pub(super) flicker: f64,
    pub(super) walk: f64,
}

/// Returns the factors from bin to bin of exponentially correlated noise that makes up flicker noise in the
/// given number of bins.
fn octaves(count: usize) -> Vec<f64> {
    let most = (4.0 * count as f64).log2().ceil() as i32;
    (0..=most).map(|k| (-1.0 / 2f64.powi(k)).exp()).collect()
}

/// Returns the factor of what is a walk in the given number of bins.
fn walk(count: usize) -> f64 {
    (-1.0 / (4.0 * count as f64)).exp()
}

/// Autocovariances that are summed beside one another.
const BESIDE: usize = 8;

/// Returns `xᵀ Γ x` with `Γ_bc = ρ^|b − c|` of each ρ.
fn quadratics(x: &DVector<f64>, rhos: &[f64]) -> Vec<f64> {
    let of = |rhos: &[f64]| {
        let mut own = [0.0; BESIDE];
        own.iter_mut().zip(rhos).for_each(|(own, rho)| *own = *rho);
        let (mut behind, mut sum) = ([0.0; BESIDE], [0.0; BESIDE]);
        for value in x {
            for k in 0..BESIDE {
                sum[k] += value * (value + 2.0 * behind[k]);
                behind[k] = own[k] * (behind[k] + value);
            }
        }
        sum.into_iter().take(rhos.len())
    };
    rhos.chunks(BESIDE).flat_map(of).collect()
}

/// Cosines over bins.
struct Cosines {
    count: usize,
    /// Those of quarters of a bin's share of π.
    turn: Vec<f64>,
}

impl Cosines {
    fn over(count: usize) -> Self {
        let step = std::f64::consts::PI / (2 * count) as f64;
        Self { count, turn: (0..4 * count).map(|k| (step * k as f64).cos()).collect() }
    }

    /// Returns cosine number j, of unit length.
    fn number(&self, j: usize) -> impl Iterator<Item = f64> + '_ {
        let scale = if j == 0 { 1.0 / self.count as f64 } else { 2.0 / self.count as f64 }.sqrt();
        let whole = self.turn.len();
        let mut at = j % whole.max(1);
        (0..self.count).map(move |_| {
            let value = scale * self.turn[at];
            at += 2 * j;
            at -= if at >= whole { whole } else { 0 };
            value
        })
    }

    /// Returns the product of cosine number j with values, given as [`folded`].
    fn along(&self, j: usize, folded: &[Vec<f64>; 2]) -> f64 {
        self.number(j).zip(&folded[j % 2]).map(|(a, b)| a * b).sum()
    }
}

/// Returns the sum and the difference of values and of those in reverse, the first half: a cosine is the same
/// in reverse, or the same with its sign turned.
fn folded(values: &DVector<f64>) -> [Vec<f64>; 2] {
    let (count, half) = (values.len(), values.len() / 2);
    let of = |sign: f64| {
        let pairs = (0..half).map(|b| values[b] + sign * values[count - 1 - b]);
        pairs.chain((2 * half < count).then(|| 0.5 * (1.0 + sign) * values[half])).collect()
    };
    [of(1.0), of(-1.0)]
}

/// Returns an orthonormal basis of the columns of a matrix; of a column at least the share `least` must be
/// new.
pub(super) fn basis(columns: &DMatrix<f64>, least: f64) -> DMatrix<f64> {
    let mut kept: Vec<DVector<f64>> = Vec::new();
    for column in columns.column_iter() {
        let length = column.norm();
        if length == 0.0 {
            continue;
        }
        let mut rest = column / length;
        // Twice is enough (Kahan, Parlett).
        for _ in 0..2 {
            for unit in &kept {
                let along = unit.dot(&rest);
                rest.axpy(-along, unit, 1.0);
            }
        }
        let left = rest.norm();
        if left > least {
            kept.push(rest / left);
        }
    }
    if kept.is_empty() { DMatrix::zeros(columns.nrows(), 0) } else { DMatrix::from_columns(&kept) }
}

/// The mean power of some coefficients, their number, and the shares of white noise, flicker noise and a
/// walk.
type Line = (f64, f64, [f64; 3]);

impl PowerLaw {
    /// Returns white noise.
    pub(super) fn white(variance: f64) -> Self {
        Self { white: variance, flicker: 0.0, walk: 0.0 }
    }

    /// Returns the noise of values that are explained by the columns of an orthonormal basis but for it.
    pub(super) fn of(values: &DVector<f64>, basis: &DMatrix<f64>) -> Self {
        let count = values.len();
        let left = values - basis * basis.tr_mul(values);
        let mut coefficients: Vec<usize> = (0..count.min(LOWEST)).collect();
        let mut next = LOWEST as f64;
        while (next as usize) < count {
            coefficients.push(next as usize);
            next = (next + 1.0).max(next * 2f64.powf(1.0 / PER_OCTAVE)).floor();
        }
        let rhos: Vec<f64> = octaves(count).into_iter().chain([walk(count)]).collect();
        let (cosines, folded) = (Cosines::over(count), folded(&left));
        let mut lines: Vec<Line> = Vec::new();
        for (k, j) in coefficients.iter().enumerate() {
            let own = DVector::from_iterator(count, cosines.number(*j));
            let projected = &own - basis * basis.tr_mul(&own);
            let white = projected.norm_squared();
            if white < LEAST_LEFT {
                continue;
            }
            let mut shares = quadratics(&projected, &rhos);
            let walk = shares.pop().unwrap_or(0.0);
            let flicker = shares.iter().sum::<f64>() / shares.len() as f64;
            let to = coefficients.get(k + 1).copied().unwrap_or(count).max(j + 1);
            let power = (*j..to).map(|j| cosines.along(j, &folded).powi(2)).sum::<f64>();
            let several = (to - j) as f64;
            lines.push((power / several, several, [white, flicker, walk]));
        }
        Self::most_likely(&lines)
    }

    /// Returns the variances of the most likelihood.
    fn most_likely(lines: &[Line]) -> Self {
        let mean = |of: &dyn Fn(&Line) -> f64| {
            let count: f64 = lines.iter().map(|l| l.1).sum();
            lines.iter().map(|l| l.1 * of(l)).sum::<f64>() / count.max(1.0)
        };
        let power = mean(&|l| l.0);
        let mut v: [f64; 3] = std::array::from_fn(|k| {
            let share = mean(&|l| l.2[k]);
            if share > 0.0 { power / (3.0 * share) } else { 0.0 }
        });
        let least = LEAST_WHITE * power.max(1.0);
        for _ in 0..STEPS {
            let (mut more, mut less) = ([0.0; 3], [0.0; 3]);
            for (power, several, shares) in lines {
                let expected: f64 = shares.iter().zip(v).map(|(m, v)| m * v).sum();
                for (k, m) in shares.iter().enumerate() {
                    more[k] += several * power * m / (expected * expected);
                    less[k] += several * m / expected;
                }
            }
            for k in 0..3 {
                if less[k] > 0.0 {
                    v[k] *= (more[k] / less[k]).sqrt();
                }
            }
            v[0] = v[0].max(least);
        }
        // Fisher's information of each variance alone.
        let deviation = |k: usize| {
            let information: f64 = lines
                .iter()
                .map(|(_, several, shares)| {
                    let expected: f64 = shares.iter().zip(v).map(|(m, v)| m * v).sum();
                    0.5 * several * (shares[k] / expected).powi(2)
                })
                .sum();
            if information > 0.0 { information.sqrt().recip() } else { 0.0 }
        };
        Self { white: v[0], flicker: v[1] + UPPER_SD * deviation(1), walk: v[2] + UPPER_SD * deviation(2) }
    }

    /// Returns the autocovariance at lags of 0, 1, … bins.
    fn autocovariance(&self, count: usize) -> Vec<f64> {
        let octaves = octaves(count);
        let mut powers = vec![1.0; octaves.len()];
        let (walk, mut walked) = (walk(count), 1.0);
        (0..count)
            .map(|lag| {
                let flicker = powers.iter().sum::<f64>() / octaves.len() as f64;
                let own = self.flicker * flicker + self.walk * walked;
                powers.iter_mut().zip(&octaves).for_each(|(p, rho)| *p *= rho);
                walked *= walk;
                if lag == 0 { self.white + own } else { own }
            })
            .collect()
    }

    /// Returns true if there is no slow noise.
    pub(super) fn is_white(&self) -> bool {
        self.flicker == 0.0 && self.walk == 0.0
    }

    /// Returns the inverse of the covariance of the given number of bins (W. F. Trench, An algorithm for the
    /// inversion of finite Toeplitz matrices, J. SIAM 12, 1964).
    pub(super) fn inverse(&self, count: usize) -> DMatrix<f64> {
        let gamma = self.autocovariance(count);
        let (filter, variance) = prediction(&gamma);
        let mut inverse = DMatrix::<f64>::zeros(count, count);
        let first = inverse.as_mut_slice().iter_mut().zip(&filter);
        first.for_each(|(to, own)| *to = own / variance);
        let back: Vec<f64> = filter.iter().skip(1).rev().copied().collect();
        for j in 1..count {
            let (before, own) = inverse.as_mut_slice().split_at_mut(j * count);
            own[0] = before[j];
            let own = own[1..count].iter_mut().zip(&before[(j - 1) * count..]);
            let (at, behind) = (filter[j], back[j - 1]);
            for ((to, before), (filter, back)) in own.zip(filter.iter().skip(1).zip(&back)) {
                *to = before + (filter * at - back * behind) / variance;
            }
        }
        inverse
    }
}

/// Returns the filter that leaves the error of prediction from all values before, its own first, and the
/// error's variance (Levinson and Durbin).
fn prediction(gamma: &[f64]) -> (Vec<f64>, f64) {
    let mut filter = vec![1.0];
    let mut variance = gamma.first().copied().unwrap_or(1.0);
    for n in 1..gamma.len() {
        let sum: f64 = filter.iter().enumerate().map(|(k, a)| a * gamma[n - k]).sum();
        let reflection = -sum / variance;
        let before = filter.clone();
        filter.push(0.0);
        for (k, a) in filter.iter_mut().enumerate().skip(1) {
            *a += reflection * before[n - k];
        }
        variance *= 1.0 - reflection * reflection;
    }
    (filter, variance)
}

/// Returns white noise of half the mean square of successive differences, in which neither steps nor drift
/// have a part (J. von Neumann, Distribution of the ratio of the mean square successive difference to the
/// variance, 1941).
pub(super) fn successive(residuals: &nalgebra::DVector<f64>) -> PowerLaw {
    let pairs = residuals.len().saturating_sub(1).max(1) as f64;
    let squares = residuals.iter().zip(residuals.iter().skip(1)).map(|(a, b)| (b - a).powi(2)).sum::<f64>();
    PowerLaw::white((0.5 * squares / pairs).max(LEAST_WHITE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cosines_and_quadratic_forms_are_those_of_their_definitions() {
        for count in [8, 9] {
            let values = DVector::from_fn(count, |b, _| (1.7 * b as f64).sin() + 0.2);
            let (cosines, folded) = (Cosines::over(count), folded(&values));
            for j in 0..count {
                let scale = if j == 0 { 1.0 } else { 2.0 };
                let step = std::f64::consts::PI * j as f64 / count as f64;
                let cosine = |b: usize| (scale / count as f64).sqrt() * (step * (b as f64 + 0.5)).cos();
                assert!(cosines.number(j).enumerate().all(|(b, own)| (own - cosine(b)).abs() < 1e-14));
                let direct: f64 = values.iter().enumerate().map(|(b, v)| cosine(b) * v).sum();
                assert!((cosines.along(j, &folded) - direct).abs() < 1e-14, "{count} {j}");
            }
            let rhos: Vec<f64> = (0..10).map(|k| 0.09 * f64::from(k)).collect();
            for (rho, found) in rhos.iter().zip(quadratics(&values, &rhos)) {
                let gamma = DMatrix::from_fn(count, count, |b, c| rho.powi(b.abs_diff(c) as i32));
                assert!((found - values.dot(&(gamma * &values))).abs() < 1e-13, "{rho}");
            }
        }
    }
}
