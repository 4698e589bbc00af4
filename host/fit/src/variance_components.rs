//! Variance components: how much of the residuals' covariance each source of noise explains.
//!
//! `Σ(θ) = Σ_i θ_i E_i` has the most likelihood for sample covariances S, which the E belong to, where no θ
//! can grow or shrink any more; the steps `θ_i ← θ_i √(Σ tr(Σ⁻¹SΣ⁻¹E_i) / Σ tr(Σ⁻¹E_i))`, summed over the
//! samples, never lose likelihood and keep signs (H. Zhou, L. Hu, J. Zhou, K. Lange, MM Algorithms for
//! Variance Components Models, J. Computational and Graphical Statistics 28 (2), 2019).

use nalgebra::{Cholesky, DMatrix};

/// Steps at most.
const STEPS: usize = 300;
/// Done when no component moves by more than this share.
const SETTLED: f64 = 1e-6;

/// Variances that explain a covariance.
pub(super) struct Components {
    /// θ, one a component.
    pub(super) variance: Vec<f64>,
    /// Standard deviations of θ for the given number of independent samples.
    pub(super) deviation: Vec<f64>,
}

/// Products that the components explain, and their number.
pub(super) struct Sample<'a> {
    /// Mean of the products, C × C.
    pub(super) covariance: &'a DMatrix<f64>,
    /// Number of independent ones.
    pub(super) count: f64,
    /// The addition of each component of unit variance, C × C, symmetric and positive semidefinite.
    pub(super) components: Vec<DMatrix<f64>>,
}

impl Sample<'_> {
    fn inverse(&self, variance: &[f64]) -> Option<DMatrix<f64>> {
        let zero = DMatrix::zeros(self.covariance.nrows(), self.covariance.ncols());
        let all = self.components.iter().zip(variance).fold(zero, |all, (e, v)| all + e * *v);
        Cholesky::new(all).map(|c| c.inverse())
    }
}

/// Returns the variances that explain all samples; those that are not `free` stay as they start.
pub(super) fn explain(samples: &[Sample], start: &[f64], free: &[bool]) -> Option<Components> {
    let mut variance = start.to_vec();
    let count = variance.len();
    for _ in 0..STEPS {
        let (mut found, mut expected) = (vec![0.0; count], vec![0.0; count]);
        for sample in samples {
            let inverse = sample.inverse(&variance)?;
            let weighted = &inverse * sample.covariance * &inverse;
            let sums = found.iter_mut().zip(&mut expected);
            for ((found, expected), e) in sums.zip(&sample.components) {
                *found += sample.count * weighted.dot(e);
                *expected += sample.count * inverse.dot(e);
            }
        }
        let mut moved = 0.0_f64;
        for ((theta, free), (found, expected)) in
            variance.iter_mut().zip(free).zip(found.iter().zip(&expected))
        {
            if *free && *expected > 0.0 {
                let step = (found / expected).max(0.0).sqrt();
                moved = moved.max((step - 1.0).abs());
                *theta *= step.max(1e-3);
            }
        }
        if moved < SETTLED {
            break;
        }
    }
    let mut information = DMatrix::<f64>::zeros(count, count);
    for sample in samples {
        let inverse = sample.inverse(&variance)?;
        let weighted: Vec<DMatrix<f64>> = sample.components.iter().map(|e| &inverse * e).collect();
        information += DMatrix::from_fn(count, count, |i, j| {
            0.5 * sample.count * weighted[i].dot(&weighted[j].transpose())
        });
    }
    let scale = information.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(count, count, |i, j| information[(i, j)] * scale[i] * scale[j]);
    // The decomposition of what is no number does not end.
    if scaled.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let covariance = scaled.pseudo_inverse(1e-12).ok()?;
    let deviation = (0..count).map(|i| covariance[(i, i)].max(0.0).sqrt() * scale[i]).collect();
    Some(Components { variance, deviation })
}
