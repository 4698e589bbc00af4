use nalgebra::{DMatrix, DVector};

use super::*;
use crate::examples::factor;

const N: usize = 4;

/// Rows over four parameters and two errors, with unit noise.
fn rows() -> (DMatrix<f64>, DVector<f64>) {
    let a = DMatrix::from_fn(60, N + 2, |i, j| ((3 * i * i + 7 * i * j + j) as f64).sin());
    let y = DVector::from_fn(60, |i, _| ((5 * i + 1) as f64).cos() * 3.0);
    (a, y)
}

fn error(name: &str) -> RigError {
    let basis = Basis::Class("usual".to_owned());
    let (name, empty) = (name.to_owned(), String::new());
    RigError {
        instrument: empty.clone(),
        name,
        group: empty.clone(),
        unit: empty,
        basis,
        expected: 0.0,
        sigma: 0.5,
    }
}

fn joint() -> RigRows {
    let (a, y) = rows();
    let covariance = DMatrix::identity(2, 2) * 0.25;
    RigRows::new(N, factor(&a, &y), vec![error("a"), error("b")], covariance).unwrap()
}

/// `Σ + s sᵀ`, and the estimate stays.
#[test]
fn a_shift_is_added_to_the_covariance_with_its_correlations() {
    let shift = [0.3, 0.0, -0.2, 1.0];
    let shifted = joint().shifted(&shift);
    let [before, after] = [&joint(), &shifted].map(|rows| rows.factor().solve(1e-12));
    let column = DVector::from_vec([shift.as_slice(), &[0.0; 2]].concat());
    let expected = before.covariance + &column * column.transpose();
    assert!((after.covariance - expected).norm() < 1e-9);
    assert!(before.estimate.iter().zip(&after.estimate).all(|(a, b)| (a - b).abs() < 1e-9));
}

#[test]
fn what_is_no_set_of_errors_is_refused() {
    let made = |errors: Vec<RigError>, covariance: DMatrix<f64>| {
        RigRows::new(N, joint().factor().clone(), errors, covariance)
    };
    let unit = || DMatrix::identity(2, 2);
    assert!(made(vec![error("a"), error("a")], unit()).is_none());
    assert!(made(vec![error("a")], unit()).is_none());
    assert!(made(vec![error("a"), error("b")], -unit()).is_none());
    assert!(made(vec![error("a"), error("b")], DMatrix::from_element(2, 2, 1.0)).is_none());
    let other = RigError { instrument: "another".into(), ..error("a") };
    assert!(made(vec![error("a"), other], unit()).is_some());
}
