use super::*;
use crate::examples::factor;
use nalgebra::DVector;

/// The sum of the covariances of all pairs of rows is that of all pairs of sums.
#[test]
fn autocovariances_of_sums_are_means_over_pairs_of_rows() {
    let gamma: Vec<f64> = (0..40).map(|m| 0.9_f64.powi(m)).collect();
    let (several, sums) = (4_usize, 25_usize);
    let at = |lag: usize| gamma.get(lag).copied().unwrap_or(0.0);
    let rows = several * sums;
    let of_rows: f64 = (0..rows).flat_map(|i| (0..rows).map(move |k| at(i.abs_diff(k)))).sum();
    let mean = of_sums(&gamma, several, sums);
    let of_means: f64 =
        (0..sums).flat_map(|i| (0..sums).map(|k| mean[i.abs_diff(k)]).collect::<Vec<_>>()).sum();
    assert!((of_means * (several * several) as f64 / of_rows - 1.0).abs() < 1e-12);
    assert_eq!(of_sums(&gamma, 1, 40), gamma);
}

/// The covariance of the estimate is `G⁻¹ Aᵀ Γ A G⁻¹`, also of sums of parameters that noise moves against
/// each other: their own standard deviations and the correlations of white noise would make it too small.
#[test]
fn sums_of_parameters_are_as_uncertain_as_slow_noise_makes_them() {
    let (rows, kept) = (400_usize, 0.97_f64);
    // Two columns that are alike but for what varies quickly, and opposite in what varies slowly.
    let a = DMatrix::from_fn(rows, 2, |i, j| {
        let (quick, slow) = ((2.1 * i as f64).sin(), 0.3 + 0.1 * (0.01 * i as f64).cos());
        quick + if j == 0 { slow } else { -0.9 * slow }
    });
    let y = DVector::from_fn(rows, |i, _| (0.3 * i as f64).cos());
    let gamma: Vec<f64> = (0..300).map(|m| 2.0 * kept.powi(m)).collect();
    let products = |gamma: &[f64]| products(std::iter::once(a.transpose()), 2, gamma);
    let white = products(&[1.0]);
    let found = products(&gamma);
    let all = DMatrix::from_fn(rows, rows, |i, j| gamma.get(i.abs_diff(j)).copied().unwrap_or(0.0));
    let exact = a.tr_mul(&all) * &a;
    assert!((&exact - &found).norm() < 1e-10 * exact.norm());
    let plain = factor(&a, &y);
    let sandwich = Sandwich { white: white.clone(), found: found.clone(), share: 1.0, most: 1e6 };
    let [before, after] = [&plain, &sandwich.noisier(&plain, 1.0)].map(|rows| rows.solve(1e-12));
    assert!(before.estimate.iter().zip(&after.estimate).all(|(a, b)| (a - b).abs() < 1e-9));
    let inverse = white.try_inverse().unwrap();
    let exact = &inverse * found * &inverse;
    // Where slow noise is the larger, it is the sandwich; no direction is below white noise.
    let variance = |of: &DMatrix<f64>, by: [f64; 2]| {
        let by = DVector::from(by.to_vec());
        (of * &by).dot(&by)
    };
    for by in [[1.0, 0.0], [0.0, 1.0], [1.0, -1.0], [1.0, 1.0]] {
        let (least, is) = (variance(&exact, by), variance(&after.covariance, by));
        assert!(is > 0.999 * least.max(variance(&before.covariance, by)), "{by:?} {is} {least}");
        assert!(is < 1.001 * (least + variance(&before.covariance, by)), "{by:?} {is} {least}");
    }
    let estimate = Estimate::new(&plain, 1e-12, 1.0, crate::Noise::Given);
    let by = sandwich.inflation(&estimate, 2);
    assert!((by[0].powi(2) * before.covariance[(0, 0)] / exact[(0, 0)] - 1.0).abs() < 1e-9);
}

/// White noise of the variance that is assumed changes nothing.
#[test]
fn white_noise_leaves_the_rows_as_they_are() {
    let a = DMatrix::from_fn(60, 3, |i, j| ((3 * i * i + 7 * i * j + j) as f64).sin());
    let y = DVector::from_fn(60, |i, _| ((5 * i + 1) as f64).cos() * 3.0);
    let white = a.tr_mul(&a);
    let rows = factor(&a, &y);
    let same = Sandwich { white: white.clone(), found: white, share: 1.0, most: 4.0 }.noisier(&rows, 1.0);
    let [before, after] = [&rows, &same].map(|rows| rows.solve(1e-12));
    assert!((before.covariance - after.covariance).norm() < 1e-12);
    assert_eq!((same.rows(), same.residual_sum_of_squares()), (rows.rows(), rows.residual_sum_of_squares()));
}
