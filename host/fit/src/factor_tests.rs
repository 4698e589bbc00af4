//! The factor against dense normal equations.

use nalgebra::{DMatrix, DVector};
use rigident_shared::estimator::frames::TreeFactor;
use rigident_shared::factor::InformationFactor;

use super::Factor;
use crate::examples;

/// Rows that no other file uses: a fixed pattern without symmetry.
fn rows(count: usize, n: usize, seed: f64) -> (DMatrix<f64>, DVector<f64>) {
    let a = DMatrix::from_fn(count, n, |i, j| ((1.3 + seed) * (i + 1) as f64 * (j + 2) as f64).sin());
    let y = DVector::from_fn(count, |i, _| ((0.7 + seed) * (i + 3) as f64).cos());
    (a, y)
}

fn absorbed(a: &DMatrix<f64>, y: &DVector<f64>) -> Factor {
    let mut factor = Factor::new(a.ncols());
    let all: Vec<Vec<f64>> = a.row_iter().map(|row| row.iter().copied().collect()).collect();
    factor.absorb(all.iter().zip(y.iter()).map(|(row, value)| (row.as_slice(), *value)));
    factor
}

/// Estimate, covariance and residual sum of squares by normal equations.
fn dense(a: &DMatrix<f64>, y: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>, f64) {
    let covariance = (a.transpose() * a).try_inverse().unwrap();
    let phi = &covariance * a.transpose() * y;
    let residual = y - a * &phi;
    (phi, covariance, residual.norm_squared())
}

fn assert_close(factor: &Factor, (phi, covariance, rss): &(DVector<f64>, DMatrix<f64>, f64)) {
    let solution = factor.solve(1e-12);
    let distance = (DVector::from_column_slice(&solution.estimate) - phi).norm();
    assert!(distance < 1e-9 * phi.norm(), "{distance}");
    assert!((solution.covariance - covariance).norm() < 1e-9 * covariance.norm());
    assert!((factor.residual_sum_of_squares() - rss).abs() < 1e-9 * rss);
}

#[test]
fn solution_equals_normal_equations() {
    let (a, y) = rows(40, 7, 0.0);
    assert_close(&absorbed(&a, &y), &dense(&a, &y));
}

/// Rows of many columns are reduced in panels.
#[test]
fn solution_of_many_columns_equals_normal_equations() {
    for n in [64, 96, 101] {
        let pick = |i: usize, j: usize| ((i * 7919 + j * 104_729 + i * j * 31) % 9973) as f64 / 5000.0 - 1.0;
        let a = DMatrix::from_fn(500, n, pick);
        let y = DVector::from_fn(500, |i, _| pick(i, 977));
        let factor = absorbed(&a, &y);
        assert_close(&factor, &dense(&a, &y));
        assert_eq!(factor.rows(), 500);
        let r = factor.r();
        assert!((0..n).all(|j| r[(j, j)] > 0.0 && (j + 1..n).all(|i| r[(i, j)] == 0.0)));
    }
}

#[test]
fn merge_equals_stacked_rows() {
    let ((a, y), (b, z)) = (rows(30, 5, 0.0), rows(25, 5, 0.4));
    let mut merged = absorbed(&a, &y);
    merged.merge(&absorbed(&b, &z));
    let stacked = DMatrix::from_fn(55, 5, |i, j| if i < 30 { a[(i, j)] } else { b[(i - 30, j)] });
    let values = DVector::from_fn(55, |i, _| if i < 30 { y[i] } else { z[i - 30] });
    assert_close(&merged, &dense(&stacked, &values));
    assert_eq!(merged.rows(), 55);
}

#[test]
fn elimination_keeps_estimate_and_covariance() {
    let (a, y) = rows(40, 7, 0.0);
    let (phi, covariance, rss) = dense(&a, &y);
    let kept = [5, 1, 2];
    let marginal = absorbed(&a, &y).eliminate_others(&kept);
    let phi = DVector::from_fn(3, |i, _| phi[kept[i]]);
    let covariance = DMatrix::from_fn(3, 3, |i, j| covariance[(kept[i], kept[j])]);
    assert_close(&marginal, &(phi, covariance, rss));
}

#[test]
fn substitution_equals_substituted_rows() {
    let (a, y) = rows(40, 6, 0.2);
    let map = DMatrix::from_fn(6, 3, |i, j| (((i + 1) * (j + 2)) as f64).sin());
    assert_close(&absorbed(&a, &y).substitute(&map), &dense(&(&a * &map), &y));
}

#[test]
fn inflation_scales_deviations_and_nothing_else() {
    let (a, y) = rows(40, 4, 0.1);
    let factor = absorbed(&a, &y);
    let before = factor.solve(1e-12);
    let by = [1.0, 2.0, 3.0, 1.5];
    let after = factor.inflate(&before.estimate, &by).solve(1e-12);
    for i in 0..4 {
        assert!((after.estimate[i] - before.estimate[i]).abs() < 1e-10);
        for j in 0..4 {
            let expected = before.covariance[(i, j)] * by[i] * by[j];
            assert!((after.covariance[(i, j)] - expected).abs() < 1e-10 * expected.abs().max(1e-3));
        }
    }
}

#[test]
fn appended_parameters_are_not_determined() {
    let (a, y) = rows(40, 3, 0.1);
    let solution = absorbed(&a, &y).append(2).solve(1e-12);
    assert_eq!(solution.determined, [true, true, true, false, false]);
}

#[test]
fn dependent_columns_are_not_determined() {
    let (mut a, y) = rows(40, 4, 0.1);
    let sum = a.column(0) + a.column(2) * 2.0;
    a.set_column(3, &sum);
    let solution = absorbed(&a, &y).solve(1e-12);
    assert_eq!(solution.determined, [false, true, false, false]);
    assert_eq!(solution.null_directions.len(), 1);
}

#[test]
fn entries_round_trip_and_refuse_all_but_factors() {
    let (a, y) = rows(20, 4, 0.3);
    let factor = absorbed(&a, &y);
    let entries = factor.entries();
    assert_eq!(Factor::from_entries(4, &entries, factor.rows()), Some(factor));
    assert_eq!(Factor::from_entries(4, &entries[1..], 20), None);
    let mut broken = entries.clone();
    broken[3] = f64::NAN;
    assert_eq!(Factor::from_entries(4, &broken, 20), None);
}

#[test]
fn fixed_size_factor_converts_without_change() {
    let (a, y) = rows(24, 10, 0.3);
    let mut fixed = InformationFactor::<f64, 10>::new();
    for (row, value) in a.row_iter().zip(y.iter()) {
        fixed.absorb(&std::array::from_fn(|j| [row[j]]), &[*value]);
    }
    let factor = Factor::from(&fixed);
    assert_eq!(factor.entries(), fixed.entries().collect::<Vec<_>>());
    assert_eq!(factor.rows(), 24);
}

#[test]
fn predicted_rows_tighten_and_move_nothing() {
    let (a, y) = rows(40, 5, 0.0);
    let factor = absorbed(&a, &y);
    let before = factor.solve(1e-12);
    let (more, _) = rows(30, 5, 0.9);
    let all: Vec<Vec<f64>> = more.row_iter().map(|row| row.iter().copied().collect()).collect();
    let predicted = factor.predicted(&before.estimate, all.iter().map(Vec::as_slice));
    let after = predicted.solve(1e-12);
    let stacked = a.transpose() * &a + more.transpose() * &more;
    assert!((predicted.log_determinant() - stacked.determinant().ln()).abs() < 1e-9);
    for j in 0..5 {
        assert!((after.estimate[j] - before.estimate[j]).abs() < 1e-10);
        assert!(after.covariance[(j, j)] < before.covariance[(j, j)]);
    }
}

#[test]
fn rows_taken_from_a_device_merge_to_its_factor() {
    let (a, y) = rows(40, 5, 0.0);
    let factor = absorbed(&a, &y);
    let r = factor.r();
    let mut taken = Box::new(TreeFactor::<f64>::EMPTY);
    taken.clear(5);
    for i in 0..5 {
        let row: Vec<f64> = (i..5).map(|j| r[(i, j)]).chain([factor.z()[i]]).collect();
        taken.merge_row(i, &row);
    }
    taken.merge_residual(factor.residual_sum_of_squares(), 40);
    assert_close(&Factor::from(&*taken), &dense(&a, &y));
}

#[test]
fn columns_that_differ_by_a_rounded_angle_are_one() {
    let (mut a, y) = rows(60, 4, 0.0);
    let quarter = std::f64::consts::FRAC_PI_2;
    let nearly = a.column(1) + a.column(2) * (quarter - (1e11 * quarter).trunc() * 1e-11);
    a.set_column(3, &nearly);
    let solution = absorbed(&a, &y).solve(1e-10);
    assert_eq!(solution.determined, [true, false, true, false]);
    assert!(solution.condition_number < 10.0);
}

#[test]
fn parameters_that_only_occur_together_are_not_determined() {
    let (mut a, y) = rows(60, 6, 0.0);
    let sum = a.column(1) * 2.0 - a.column(4);
    a.set_column(5, &sum);
    a.set_column(2, &DVector::zeros(60));
    let solution = absorbed(&a, &y).solve(1e-10);
    assert_eq!(solution.determined, [true, false, false, true, false, false]);
    let mut together: Vec<usize> = solution.null_directions.concat().iter().map(|l| l.0).collect();
    together.sort_unstable();
    assert_eq!(together, [1, 4, 5]);
}

#[test]
fn evenly_widened_rows_are_those_before_their_parameters_own_factors() {
    let mut fit = examples::Run::new(&examples::body(), &examples::truth(16), 60, 1.0, 3).fit();
    let before = fit.factor.clone();
    let by: Vec<f64> = (0..fit.estimate.len()).map(|j| 1.0 + 0.25 * j as f64).collect();
    fit.factor = before.inflate(&fit.estimate.values, &by);
    fit.widened = by;
    let most = 1.0 + 0.25 * 15.0;
    let (even, r) = (fit.evenly_widened(), before.r() / most);
    assert!((even.r() - &r).norm() < 1e-12 * r.norm());
    let z = even.z().iter().zip(before.z()).map(|(a, b)| (a - b / most).abs()).fold(0.0, f64::max);
    assert!(z < 1e-9 * before.z().iter().fold(0.0_f64, |m, v| m.max(v.abs())), "{z}");
}
