use nalgebra::{DMatrix, DVector};

use super::*;
use crate::examples::factor;
use crate::{Estimate, Noise};

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
fn impossible_sets_of_errors_are_refused() {
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

/// What is known of errors beforehand is in the estimate by how it moves with that: `J Σ Jᵀ`, `J = dφ̂/dμ`.
#[test]
fn the_part_that_is_no_noise_is_that_of_prior_knowledge() {
    for correlation in [0.0, 0.2] {
        let sigma = DMatrix::from_row_slice(2, 2, &[0.25, 0.3 * correlation, 0.3 * correlation, 0.36]);
        let of = |expected: [f64; 2]| {
            let (a, y) = rows();
            let named = [("a", 0.5), ("b", 0.6)].into_iter().zip(expected);
            let errors = named.map(|((name, sigma), expected)| RigError { expected, sigma, ..error(name) });
            RigRows::new(N, factor(&a, &y), errors.collect(), sigma.clone()).unwrap()
        };
        let solved = |rows: &RigRows| DVector::from_vec(rows.own().solve(1e-12).estimate);
        let moved = |k: usize| {
            let at = |by: f64| solved(&of(std::array::from_fn(|j| if j == k { by } else { 0.0 })));
            at(0.5) - at(-0.5)
        };
        let slopes = DMatrix::from_columns(&[moved(0), moved(1)]);
        let known = of([0.0; 2]);
        let noise = Noise::Estimated { degrees_of_freedom: 5.0 };
        let estimate = Estimate::new(&known.own(), 1e-12, 1.0, noise);
        let estimate = estimate.beside(std::slice::from_ref(&known));
        let found = estimate.unjudged().beforehand.unwrap();
        let expected = &slopes * &sigma * slopes.transpose();
        assert!((found - &expected).norm() < 1e-9 * expected.norm(), "{found} {expected}");
        // Between the normal coverage factor and t of five.
        let u95 = |j: usize| estimate.measured(j).unwrap().u95 / estimate.covariance(j, j).unwrap().sqrt();
        assert!((0..N).all(|j| u95(j) > 1.96 && u95(j) < 2.5706), "{} {}", u95(0), u95(1));
    }
}

/// Errors that are half noise of few degrees of freedom, half known: intervals hold the truth as they
/// state, where Student's t on the whole would hold it too often.
#[test]
fn noise_of_few_degrees_of_freedom_beside_prior_knowledge_covers_as_stated() {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
    for (freedom, share) in [(4_u32, 0.2_f64), (4, 0.5), (8, 0.5), (8, 0.9)] {
        let noise = Noise::Estimated { degrees_of_freedom: f64::from(freedom) };
        let (mut held, mut held_by_t, count) = (0, 0, 4000);
        for _ in 0..count {
            let off = (1.0 - share).sqrt() * draw() + share.sqrt() * draw();
            let scale = (0..freedom).map(|_| draw().powi(2)).sum::<f64>() / f64::from(freedom);
            let variance = 1.0 - share + share * scale;
            let found = noise.coverage_factor_of(share * scale / variance);
            held += i32::from(off.abs() < found * variance.sqrt());
            held_by_t += i32::from(off.abs() < noise.coverage_factor() * variance.sqrt());
        }
        let [held, by_t] = [held, held_by_t].map(|own| f64::from(own) / f64::from(count));
        // 4 000 draws know a share of 95 % to 0.35 %.
        assert!((0.94..0.975).contains(&held), "{freedom} {share}: {held}");
        assert!(share > 0.6 || by_t > held + 0.005, "{freedom} {share}: {by_t} {held}");
    }
}
