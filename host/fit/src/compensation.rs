//! Compensation: what noise in the coefficients adds to the normal equations is taken off again.
//!
//! The estimate solves `(AᵀWA − K) φ = AᵀWy` with `K = E[ΔᵀWΔ]` of the noise Δ in A. With the singular value
//! decomposition `R = U S Vᵀ D`, D being the lengths of the columns, this is `M ψ = Uᵀz`,
//! `M = 1 − S⁻¹ Vᵀ D⁻¹ K D⁻¹ V S⁻¹`, `ψ = S Vᵀ D φ`: nothing is squared. The rows `M ψ = Uᵀz` have unit
//! covariance, as those of R had, so that they are the factor of the compensated estimate and of its
//! covariance `(AᵀWA − K)⁻¹ AᵀWA (AᵀWA − K)⁻¹`.
//!
//! If the measured side has noise δ of the same signals, `κ = E[ΔᵀWδ]` is taken off the right side:
//! `ψ = Uᵀz − S⁻¹ Vᵀ D⁻¹ κ`.
//!
//! An eigenvalue s of M is the share of a direction's information that is no noise. The noise that was there
//! differs from its expectation: with ε the relative standard deviation of its square, `ψ = uᵀUᵀz / s` is
//! uncertain by `ε (1 − s)/s` of itself.

use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};

use super::{Factor, Filter};

/// Noise fills a direction that is uncertain by more than this share of what is found: nothing is known but
/// how large it may be.
pub(super) const MOST_UNCERTAIN: f64 = 0.5;

/// A direction with less than this share that is no noise counts only if something is found there beyond
/// chance.
const MOSTLY_SIGNAL: f64 = 0.5;
const SIGNIFICANT_SD: f64 = 4.0;
/// Shares are distinguished down to this.
const LEAST_SHARE: f64 = 0.02;

/// The addition of the noise of the signals to a factor.
#[derive(Clone, Copy, Debug)]
pub struct NoiseGram<'a> {
    /// K; of one more column κ, where the measured side has noise of the signals.
    pub expected: &'a DMatrix<f64>,
    /// The factor by which K counts.
    pub times: f64,
    /// ε: relative standard deviation of the square of what there is of the noise in one direction.
    pub spread: f64,
}

impl<'a> NoiseGram<'a> {
    /// Returns the noise in a factor whose row blocks are independent, of the given number of channels.
    pub fn in_factor(expected: &'a DMatrix<f64>, factor: &Factor, channels: usize) -> Self {
        let blocks = factor.rows() as f64 / channels.max(1) as f64;
        Self { expected, times: 1.0, spread: spread(&Filter::default(), blocks) }
    }
}

/// Returns the relative standard deviation of the mean square of filtered white noise, or of its derivative,
/// over the given number of row blocks: `√(2 Σ ρ²/n)` with ρ the autocorrelation.
pub fn spread(filter: &Filter, blocks: f64) -> f64 {
    let of = |gamma: Vec<f64>| {
        let zero = gamma.first().copied().unwrap_or(0.0);
        if zero > 0.0 { gamma.iter().skip(1).map(|g| 2.0 * (g / zero).powi(2)).sum::<f64>() } else { 0.0 }
    };
    let correlated = of(filter.white_autocovariance()).max(of(filter.derivative_autocovariance()));
    (2.0 * (1.0 + correlated) / blocks.max(1.0)).sqrt()
}

/// Returns how uncertain a direction is, of whose information `share` is no noise: `ε (1 − s)/s`.
pub(super) fn uncertainty(share: f64, spread: f64) -> f64 {
    if share > 0.0 { spread * (1.0 - share).max(0.0) / share } else { f64::INFINITY }
}

/// Returns twice what ψ may be in a direction that noise fills, of which `measured` was found: that over the
/// share that is no noise.
pub(super) fn possible(measured: f64, share: f64) -> f64 {
    2.0 * measured.hypot(1.0) / share.max(LEAST_SHARE)
}

/// A factor in the eigenvectors of M.
struct Directions {
    /// `S Vᵀ D`, over what is determined.
    forth: DMatrix<f64>,
    /// `Uᵀz`, less what is common.
    found: DVector<f64>,
    /// `S⁻¹ Vᵀ D⁻¹ κ`.
    common: DVector<f64>,
    eigen: SymmetricEigen<f64, Dyn>,
}

impl Directions {
    fn new(factor: &Factor, noise: &NoiseGram, rounding: f64) -> Option<Self> {
        let n = factor.parameters();
        let r = factor.r();
        let length: Vec<f64> = r.column_iter().map(|c| c.norm()).collect();
        let seen: Vec<usize> = (0..n).filter(|j| length[*j] > 0.0).collect();
        if seen.is_empty() {
            return None;
        }
        let scaled = DMatrix::from_fn(n, seen.len(), |i, k| r[(i, seen[k])] / length[seen[k]]);
        let svd = scaled.try_svd(true, true, 5.0 * f64::EPSILON, 100 * n.max(8))?;
        let (u, v_t) = (svd.u.as_ref()?, svd.v_t.as_ref()?);
        let most = svd.singular_values.max();
        let kept: Vec<usize> =
            (0..svd.singular_values.len()).filter(|k| svd.singular_values[*k] > rounding * most).collect();
        // `D⁻¹ V S⁻¹` and `S Vᵀ D`.
        let (mut back, mut forth) = (DMatrix::zeros(n, kept.len()), DMatrix::zeros(kept.len(), n));
        for (to, k) in kept.iter().enumerate() {
            for (at, j) in seen.iter().enumerate() {
                let (v, scale) = (v_t[(*k, at)], length[*j] * svd.singular_values[*k]);
                back[(*j, to)] = v / scale;
                forth[(to, *j)] = v * scale;
            }
        }
        let expected = noise.expected.view((0, 0), (n, n));
        let m = DMatrix::identity(kept.len(), kept.len()) - back.tr_mul(&(expected * &back)) * noise.times;
        let common = match noise.expected.ncols() > n {
            true => back.tr_mul(&noise.expected.view((0, n), (n, 1)).column(0)) * noise.times,
            false => DVector::zeros(kept.len()),
        };
        let z = DVector::from_column_slice(factor.z());
        let found = DVector::from_fn(kept.len(), |k, _| u.column(kept[k]).dot(&z)) - &common;
        Some(Self { forth, found, common, eigen: SymmetricEigen::new(m) })
    }

    /// Returns all eigenvectors.
    fn each(&self, spread: f64) -> impl Iterator<Item = Direction<'_>> {
        self.eigen.eigenvalues.iter().zip(self.eigen.eigenvectors.column_iter()).map(
            move |(share, vector)| {
                let measured = vector.dot(&self.found);
                let common = spread * vector.dot(&self.common);
                Direction { vector, share: *share, measured, uncertain: uncertainty(*share, spread), common }
            },
        )
    }
}

/// An eigenvector of M.
struct Direction<'a> {
    vector: nalgebra::DVectorView<'a, f64>,
    /// Its eigenvalue s.
    share: f64,
    /// `uᵀUᵀz`, of unit variance.
    measured: f64,
    /// The uncertainty of the result because of the noise that there was, as a share of itself.
    uncertain: f64,
    /// The uncertainty of the part taken off for the noise that both sides have.
    common: f64,
}

impl Direction<'_> {
    /// Returns true if nothing is known of the direction but how large it may be: noise leaves next to
    /// nothing, or has more than half and nothing beside it was found.
    fn is_filled(&self) -> bool {
        self.uncertain > MOST_UNCERTAIN || self.share < MOSTLY_SIGNAL && self.measured.abs() < SIGNIFICANT_SD
    }

    /// Returns what is found, and its standard deviation. Of a direction that noise fills that is what least
    /// squares find.
    fn found(&self) -> (f64, f64) {
        if self.is_filled() {
            return (self.measured, possible(self.measured, self.share));
        }
        let found = self.measured / self.share;
        (found, (1.0_f64.hypot(self.common) / self.share).hypot(self.uncertain * found))
    }
}

/// Returns true if noise fills a direction so much that it is not determined.
pub fn is_filled(factor: &Factor, noise: &NoiseGram, rounding: f64) -> bool {
    let found = Directions::new(factor, noise, rounding);
    found.is_some_and(|found| found.each(noise.spread).any(|direction| direction.is_filled()))
}

/// Compensated rows.
pub struct Compensated {
    pub factor: Factor,
    /// The same with directions that noise fills as least squares find them, which leaves the least.
    pub fitted: Factor,
}

/// Returns the compensated rows; `rounding` is the source's. `None` if there are no rows, or no
/// decomposition.
pub fn compensate(factor: &Factor, noise: &NoiseGram, rounding: f64) -> Option<Compensated> {
    let directions = Directions::new(factor, noise, rounding)?;
    let (mut rows, mut as_fitted) = (Vec::new(), Vec::new());
    let mut left = factor.residual_sum_of_squares();
    for direction in directions.each(noise.spread) {
        let (found, sd) = direction.found();
        left += (found - direction.measured).powi(2);
        let row = directions.forth.tr_mul(&direction.vector);
        let scaled = |sd: f64| (row.iter().map(|v| v / sd).collect::<Vec<f64>>(), found / sd);
        rows.push(scaled(sd));
        as_fitted.push(scaled(if direction.is_filled() { 1.0 } else { sd }));
    }
    let reduced = |rows: &[(Vec<f64>, f64)]| {
        let mut out = Factor::new(factor.parameters());
        out.absorb(rows.iter().map(|(row, value)| (row.as_slice(), *value)));
        out.with_residual(left, factor.rows())
    };
    Some(Compensated { factor: reduced(&rows), fitted: reduced(&as_fitted) })
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;
    use rigident_shared::factor::{Compensation, Gram, InformationFactor};

    use super::*;
    use crate::{Estimate, Noise};

    const N: usize = 10;

    /// The device's compensation, in its own steps, of the same factor. In directions that noise fills it is
    /// less certain.
    #[test]
    fn the_device_s_compensation_is_this_one() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let mut factor = InformationFactor::<f64, N>::new();
        for _ in 0..30 {
            let columns: [[f64; 6]; N] = std::array::from_fn(|_| std::array::from_fn(|_| random()));
            factor.absorb(&columns, &std::array::from_fn(|_| 1.0 + random()));
        }
        let half = DMatrix::from_fn(N, N, |_, _| random());
        let k = half.tr_mul(&half);
        for times in [0.1, 3.0] {
            let gram = &k * times;
            let own =
                Gram::<f64, N> { columns: std::array::from_fn(|j| std::array::from_fn(|i| gram[(i, j)])) };
            let mut device = Compensation::<f64>::UNUSED;
            device.begin(&factor, &own, 1.0);
            while !device.step() {}
            let device: InformationFactor<f64, N> = device.factor();
            let noise = NoiseGram { expected: &gram, times: 1.0, spread: 0.0 };
            let here = compensate(&Factor::from(&factor), &noise, 1e-12).unwrap().factor;
            let [a, b] = [Factor::from(&device), here].map(|f| Estimate::new(&f, 1e-12, 1.0, Noise::Given));
            for j in 0..N {
                let [here, device] = [&b, &a].map(|e| e.covariance[(j, j)].sqrt());
                let is_same =
                    (a.values[j] - b.values[j]).abs() < 1e-9 * here && (device / here - 1.0).abs() < 1e-9;
                let is_careful = device > here;
                assert!(is_same || times > 1.0 && is_careful, "{times}, parameter {j}: {device} {here}");
            }
        }
    }

    /// Of two directions noise has four fifths of the second, whose square varies by one tenth: it is
    /// uncertain by four tenths of itself beside its own noise. With nine tenths it may be anything up to the
    /// size that is possible.
    #[test]
    fn a_direction_that_noise_fills_is_uncertain_by_its_size() {
        let mut factor = Factor::new(2);
        factor.absorb([([10.0, 0.0].as_slice(), 30.0), ([0.0, 10.0].as_slice(), 20.0)]);
        let with = |share: f64| {
            let gram = DMatrix::from_diagonal(&DVector::from_vec(vec![0.0, 100.0 * (1.0 - share)]));
            let noise = NoiseGram { expected: &gram, times: 1.0, spread: 0.1 };
            let compensated = compensate(&factor, &noise, 1e-12).unwrap();
            let found = Estimate::new(&compensated.factor, 1e-12, 1.0, Noise::Given);
            (found, is_filled(&factor, &noise, 1e-12))
        };
        let (found, filled) = with(0.2);
        assert!(!filled);
        assert!((found.values[0] - 3.0).abs() < 1e-12 && (found.values[1] - 10.0).abs() < 1e-12);
        let sd = (0.5_f64.powi(2) + 4.0_f64.powi(2)).sqrt();
        assert!((found.covariance[(1, 1)].sqrt() - sd).abs() < 1e-12, "{}", found.covariance);
        assert!((found.covariance[(0, 0)].sqrt() - 0.1).abs() < 1e-12, "{}", found.covariance);
        // 20 of σ 1 were measured, a tenth of it is no noise: up to 200 of 0.1.
        let (found, filled) = with(0.1);
        let sd = 0.1 * 2.0 * 20.0_f64.hypot(1.0) / 0.1;
        assert!((found.covariance[(1, 1)].sqrt() - sd).abs() < 1e-9 && (found.values[1] - 2.0).abs() < 1e-9);
        assert!(filled && (found.covariance[(0, 0)].sqrt() - 0.1).abs() < 1e-12);
    }
}
