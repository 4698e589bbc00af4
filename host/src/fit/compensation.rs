//! Compensation: what noise in the coefficients adds to the normal equations is taken off again.
//!
//! The estimate solves `(AᵀWA − K) φ = AᵀWy` with `K = E[ΔᵀWΔ]` of the noise Δ in A. With the singular value decomposition
//! `R = U S Vᵀ D`, D being the lengths of the columns, this is `M ψ = Uᵀz`, `M = 1 − S⁻¹ Vᵀ D⁻¹ K D⁻¹ V S⁻¹`,
//! `ψ = S Vᵀ D φ`: nothing is squared. The rows `M ψ = Uᵀz` have unit covariance, as those of R had, so that they are the
//! factor of the compensated estimate and of its covariance `(AᵀWA − K)⁻¹ AᵀWA (AᵀWA − K)⁻¹`.

use nalgebra::{DMatrix, DVector};

use super::Factor;

/// Where less than this share of a direction's information is left, noise fills it.
const LEAST_SHARE: f64 = 0.5;

/// Compensated rows.
pub(crate) struct Compensated {
    pub(crate) factor: Factor,
    /// `(AᵀWA − K)⁻¹` over what is determined: what a change of the right-hand side does to the estimate.
    pub(crate) inverse: DMatrix<f64>,
}

/// Returns the factor of the compensated rows; `gram` is K, `rounding` the source's. `None` if there are no rows, or no
/// decomposition.
pub(crate) fn compensate(factor: &Factor, gram: &DMatrix<f64>, rounding: f64) -> Option<Compensated> {
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
    // V S⁻¹ with the columns' lengths, over what is determined.
    let back = DMatrix::from_fn(n, kept.len(), |j, k| {
        let at = seen.iter().position(|s| *s == j);
        at.map_or(0.0, |at| v_t[(kept[k], at)] / (length[j] * svd.singular_values[kept[k]]))
    });
    let forth = DMatrix::from_fn(kept.len(), n, |k, j| {
        let at = seen.iter().position(|s| *s == j);
        at.map_or(0.0, |at| v_t[(kept[k], at)] * length[j] * svd.singular_values[kept[k]])
    });
    let m = DMatrix::identity(kept.len(), kept.len()) - back.tr_mul(&(gram * &back));
    let z = DVector::from_column_slice(factor.z());
    let y = DVector::from_fn(kept.len(), |k, _| u.column(kept[k]).dot(&z));
    let eigen = nalgebra::SymmetricEigen::new(m);
    let (mut rows, mut left) = (Vec::new(), factor.residual_sum_of_squares());
    let mut inverse = DMatrix::zeros(n, n);
    for (share, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        let value = direction.dot(&y);
        let weight = share.max(LEAST_SHARE);
        let found = value / weight;
        // Of a direction that noise fills, nothing is known beyond the size of what was found.
        let certain = if *share < LEAST_SHARE { 1.0 / (1.0 / weight).hypot(found) } else { weight };
        let row: Vec<f64> = forth.tr_mul(&direction).iter().map(|v| certain * v).collect();
        let value = certain * found;
        if *share >= LEAST_SHARE {
            left += (found - direction.dot(&y)).powi(2);
        }
        let natural = &back * direction;
        inverse.ger(1.0 / weight, &natural, &natural, 1.0);
        rows.push((row, value));
    }
    let mut out = Factor::new(n);
    out.absorb(rows.iter().map(|(row, value)| (row.as_slice(), *value)));
    Some(Compensated { factor: out.with_residual(left, factor.rows()), inverse })
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;
    use rigident_shared::factor::{Compensation, Gram, InformationFactor};

    use super::*;
    use crate::fit::{Estimate, Noise};

    const N: usize = 10;

    /// The device's compensation, in its own steps, of the same factor. In directions that noise fills it is less certain.
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
        for times in [0.1, 3.0, 30.0] {
            let gram = &k * times;
            let own =
                Gram::<f64, N> { columns: std::array::from_fn(|j| std::array::from_fn(|i| gram[(i, j)])) };
            let mut device = Compensation::<f64>::UNUSED;
            device.begin(&factor, &own, 1.0);
            while !device.step() {}
            let device: InformationFactor<f64, N> = device.factor();
            let here = compensate(&Factor::from(&factor), &gram, 1e-12).unwrap().factor;
            let [a, b] = [Factor::from(&device), here].map(|f| Estimate::new(&f, 1e-12, 1.0, Noise::Given));
            for j in 0..N {
                let sd = b.covariance[(j, j)].sqrt();
                assert!((a.values[j] - b.values[j]).abs() < 1e-9 * sd, "{times}, parameter {j}");
                let ratio = a.covariance[(j, j)].sqrt() / sd;
                assert!((ratio - 1.0).abs() < 1e-9 || times > 1.0 && ratio > 1.0, "{times}, parameter {j}");
            }
        }
    }
}
