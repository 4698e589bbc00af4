use nalgebra::{DMatrix, DVector};

use super::methods::{bounded, gradient, ridge, truncated};
use super::unknowns::{ParameterSet, Unknowns};
use rigident_model::human::Person;

fn random(rows: usize, columns: usize, seed: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |i, j| ((seed + 7 * i + 13 * j + i * j) as f64 * 12.9898).sin())
}

/// Rows whose columns are of very different sizes, and bounds on every third unknown.
fn problem(seed: usize) -> (DMatrix<f64>, DVector<f64>, Vec<f64>) {
    let mut rows = random(30, 12, seed);
    (0..12).for_each(|k| rows.column_mut(k).scale_mut(10f64.powf(1.0 - 0.2 * k as f64)));
    let values = random(30, 1, seed + 91).column(0) * 5.0;
    let lower = (0..12).map(|k| if k % 3 == 0 { -0.05 } else { f64::NEG_INFINITY });
    (rows, values, lower.collect())
}

fn cost(rows: &DMatrix<f64>, values: &DVector<f64>, psi: &DVector<f64>) -> f64 {
    (rows * psi - values).norm_squared()
}

#[test]
fn all_singular_values_are_least_squares_and_few_are_their_part() {
    let (rows, values, _) = problem(3);
    let normal = rows.tr_mul(&rows).try_inverse().unwrap() * rows.tr_mul(&values);
    let (all, count) = truncated(&rows, &values, f64::INFINITY);
    assert_eq!(count, 12);
    assert!((&all - &normal).amax() < 1e-9 * normal.amax());
    // What is left out is orthogonal to what is retained, in ψ and in the rows.
    let (few, count) = truncated(&rows, &values, 10.0);
    assert!(count < 12 && count > 1);
    assert!(few.dot(&(&all - &few)).abs() < 1e-9 * all.norm_squared());
    assert!((&rows * &few).dot(&(&rows * (&all - &few))).abs() < 1e-8 * values.norm_squared());
}

#[test]
fn ridge_agrees_with_its_normal_equations() {
    let (rows, values, _) = problem(5);
    let scale: Vec<f64> = (0..12).map(|k| 0.1 + 0.3 * k as f64).collect();
    let weights =
        DMatrix::from_diagonal(&DVector::from_iterator(12, scale.iter().map(|s| (2.0 / s).powi(2))));
    let wanted = (rows.tr_mul(&rows) + weights).try_inverse().unwrap() * rows.tr_mul(&values);
    let found = ridge(&rows, &values, &scale, 2.0);
    assert!((&found - &wanted).amax() < 1e-10 * wanted.amax());
}

/// Karush, Kuhn and Tucker: no slope where nothing holds, and only slopes against the bound where it does.
#[test]
fn the_active_set_ends_at_the_least_squares_under_the_bounds() {
    let mut at_bounds = 0;
    for seed in 0..20 {
        let (rows, values, lower) = problem(seed);
        let psi = bounded(&rows, &values, &lower);
        let slope = rows.tr_mul(&(&values - &rows * &psi));
        let size = rows.tr_mul(&values).amax();
        for (k, lower) in lower.iter().enumerate() {
            if psi[k] - lower < 1e-12 {
                at_bounds += 1;
                assert!(psi[k] >= lower - 1e-12 && slope[k] < 1e-8 * size, "{seed} {k}: {}", slope[k]);
            } else {
                assert!(slope[k].abs() < 1e-8 * size, "{seed} {k}: {}", slope[k]);
            }
        }
    }
    assert!(at_bounds > 10, "{at_bounds}");
}

#[test]
fn conjugate_gradients_go_down_inside_the_bounds_to_the_same_end() {
    for seed in 0..20 {
        let (rows, values, lower) = problem(seed);
        let least = cost(&rows, &values, &bounded(&rows, &values, &lower));
        let mut before = values.norm_squared();
        for steps in [1, 3, 10, 30, 1000] {
            let psi = gradient(&rows, &values, &lower, steps);
            assert!(psi.iter().zip(&lower).all(|(v, lower)| v >= lower), "{seed}: {psi}");
            let now = cost(&rows, &values, &psi);
            assert!(now <= before * (1.0 + 1e-12) && now >= least * (1.0 - 1e-9), "{seed} {steps}: {now}");
            before = now;
        }
        assert!(before < least * (1.0 + 1e-6) + 1e-9, "{seed}: {before} {least}");
    }
}

/// The paper's humanoid: 23 links, five of them in the middle.
#[test]
fn a_person_of_23_links_has_92_unknowns_and_56_alike() {
    let model = Person::default().human58().unwrap();
    let count = |symmetric: bool| {
        Unknowns::of(&model, 23, ParameterSet::MassAndMoment, symmetric, 0.1).unwrap().names.len()
    };
    assert_eq!((model.welded().links.len(), count(false), count(true)), (23, 92, 56));
}

/// What changes on one side changes on the other as its mirror image, and bounds hold for both sides.
#[test]
fn alike_means_mirrored() {
    let mut model = Person::default().human34().unwrap();
    let right =
        model.links.iter().position(|l| l.name.contains("right") || l.name.starts_with("r_")).unwrap();
    if let Some(own) = &mut model.links[right].nominal {
        own[0] *= 0.5;
    }
    let unknowns = Unknowns::of(&model, 15, ParameterSet::MassAndMoment, true, 0.1).unwrap();
    for (k, (lower, column)) in unknowns.lower.iter().zip(unknowns.map.column_iter()).enumerate() {
        let mut psi = DVector::zeros(unknowns.names.len());
        if lower.is_finite() {
            psi[k] = *lower;
            let phi = unknowns.parameters(&psi);
            for (row, weight) in column.iter().enumerate().filter(|(row, v)| row % 10 == 0 && **v != 0.0) {
                assert_eq!(*weight, 1.0);
                assert!(phi[row] >= 0.1 * unknowns.nominal[row] - 1e-12);
            }
        }
    }
}
