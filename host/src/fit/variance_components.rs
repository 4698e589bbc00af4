//! Variance components: how much of the residuals' covariance each source of noise explains.
//!
//! `Σ(θ) = Σ_i θ_i E_i` has the most likelihood for a sample covariance S where no θ can grow or shrink any more; the steps
//! `θ_i ← θ_i √(tr(Σ⁻¹SΣ⁻¹E_i) / tr(Σ⁻¹E_i))` never lose likelihood and keep signs (H. Zhou, L. Hu, J. Zhou, K. Lange, MM
//! Algorithms for Variance Components Models, J. Computational and Graphical Statistics 28 (2), 2019).

use nalgebra::{Cholesky, DMatrix};

/// Steps at most.
const STEPS: usize = 300;
/// Done when no component moves by more than this share.
const SETTLED: f64 = 1e-6;

/// Variances that explain a covariance.
pub(super) struct Components {
    /// θ, one a component.
    pub(super) variance: Vec<f64>,
    /// Standard deviations of θ for so many independent samples.
    pub(super) deviation: Vec<f64>,
}

/// Returns the variances of `components`, symmetric and positive semidefinite, C × C, that explain `sample`, the mean of
/// `count` independent products; those that are not `free` stay as they start.
pub(super) fn explain(
    sample: &DMatrix<f64>,
    components: &[DMatrix<f64>],
    start: &[f64],
    free: &[bool],
    count: f64,
) -> Option<Components> {
    let mut variance = start.to_vec();
    let inverse_of = |variance: &[f64]| {
        let zero = DMatrix::zeros(sample.nrows(), sample.ncols());
        let all = components.iter().zip(variance).fold(zero, |all, (e, v)| all + e * *v);
        Cholesky::new(all).map(|c| c.inverse())
    };
    for _ in 0..STEPS {
        let inverse = inverse_of(&variance)?;
        let weighted = &inverse * sample * &inverse;
        let mut moved = 0.0_f64;
        for ((theta, e), free) in variance.iter_mut().zip(components).zip(free) {
            let expected = inverse.dot(e);
            if *free && expected > 0.0 {
                let step = (weighted.dot(e) / expected).max(0.0).sqrt();
                moved = moved.max((step - 1.0).abs());
                *theta *= step.max(1e-3);
            }
        }
        if moved < SETTLED {
            break;
        }
    }
    let inverse = inverse_of(&variance)?;
    let weighted: Vec<DMatrix<f64>> = components.iter().map(|e| &inverse * e).collect();
    let information = DMatrix::from_fn(components.len(), components.len(), |i, j| {
        0.5 * count * weighted[i].dot(&weighted[j].transpose())
    });
    let scale = information.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(components.len(), components.len(), |i, j| {
        information[(i, j)] * scale[i] * scale[j]
    });
    let covariance = scaled.pseudo_inverse(1e-12).ok()?;
    let deviation = (0..components.len()).map(|i| covariance[(i, i)].max(0.0).sqrt() * scale[i]).collect();
    Some(Components { variance, deviation })
}
