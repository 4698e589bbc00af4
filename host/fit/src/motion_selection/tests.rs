use nalgebra::{DMatrix, DVector};

use super::compare::{compare, square_left};
use super::conditions::{Group, condition, conditions};
use super::greedy::{BEFOREHAND, d_optimal, e_optimal, random};
use super::published::choose;
use super::{Candidate, SelectionError, check};
use crate::Factor;

/// Rows with their values.
type Made = (DMatrix<f64>, DVector<f64>);
/// A way to choose.
type Way<'a> = &'a dyn Fn(&[Candidate]) -> Vec<usize>;

/// A number in −1 … 1.
fn noise(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
}

/// Motions of made-up rows: each excites some columns well and others hardly. With their rows and values.
fn motions(count: usize, columns: usize, rows: usize) -> (Vec<Candidate>, Vec<Made>) {
    let mut state = 11;
    let truth = DVector::from_fn(columns, |j, _| 1.0 + j as f64);
    let made = (0..count).map(|k| {
        let size = |j: usize| if (j + k).is_multiple_of(3) { 1.0 } else { 0.02 * (1.0 + (k % 5) as f64) };
        let a = DMatrix::from_fn(rows, columns, |_, j| size(j) * noise(&mut state));
        let y = &a * &truth + DVector::from_fn(rows, |_, _| 0.01 * noise(&mut state));
        (a, y)
    });
    let made: Vec<_> = made.collect();
    let candidates = made.iter().enumerate().map(|(k, (a, y))| {
        let mut factor = Factor::new(columns);
        let lines: Vec<Vec<f64>> = a.row_iter().map(|row| row.iter().copied().collect()).collect();
        factor.absorb(lines.iter().map(Vec::as_slice).zip(y.iter().copied()));
        Candidate { name: format!("motion {k:02}"), factor }
    });
    (candidates.collect(), made)
}

#[test]
fn conditions_of_groups_are_those_of_the_rows() {
    let (candidates, made) = motions(4, 7, 40);
    let groups = [
        Group { name: "all".to_owned(), columns: (0..7).collect() },
        Group { name: "some".to_owned(), columns: vec![1, 4, 6] },
    ];
    for (candidate, (a, _)) in candidates.iter().zip(&made) {
        for (own, group) in conditions(&candidate.factor, &groups).iter().zip(&groups) {
            let wanted = condition(&a.select_columns(&group.columns));
            assert!((own.raw / wanted.raw - 1.0).abs() < 1e-9, "{own:?} {wanted:?}");
            assert!((own.scaled / wanted.scaled - 1.0).abs() < 1e-9, "{own:?} {wanted:?}");
        }
    }
    let zero = DMatrix::from_fn(5, 2, |i, j| if j == 0 { 0.0 } else { i as f64 });
    assert_eq!(condition(&zero).scaled, f64::INFINITY);
}

/// The information of a set, columns scaled over all.
fn information(candidates: &[Candidate], set: &[usize]) -> DMatrix<f64> {
    let columns = candidates[0].factor.parameters();
    let all = candidates.iter().fold(DMatrix::zeros(columns, columns), |sum: DMatrix<f64>, c| {
        sum + c.factor.r().transpose() * c.factor.r()
    });
    let scale = DMatrix::from_diagonal(&all.diagonal().map(|d| 1.0 / d.sqrt()));
    set.iter().fold(DMatrix::identity(columns, columns) * BEFOREHAND, |sum: DMatrix<f64>, k| {
        let r = candidates[*k].factor.r() * &scale;
        sum + r.transpose() * r
    })
}

/// Returns what a set adds to the logarithm of the determinant.
fn worth(candidates: &[Candidate], set: &[usize]) -> f64 {
    let columns = candidates[0].factor.parameters();
    information(candidates, set).determinant().ln() - columns as f64 * BEFOREHAND.ln()
}

#[test]
fn the_greedy_choice_is_near_the_best_of_all_choices() {
    let (candidates, _) = motions(9, 5, 12);
    for count in 1..=4 {
        let chosen = d_optimal(&candidates, count).unwrap();
        assert_eq!(chosen.len(), count);
        let own = worth(&candidates, &chosen);
        let best = (0..1_u32 << 9)
            .filter(|bits| bits.count_ones() as usize == count)
            .map(|bits| (0..9).filter(|k| bits >> k & 1 == 1).collect::<Vec<usize>>())
            .map(|set| worth(&candidates, &set))
            .fold(f64::NEG_INFINITY, f64::max);
        assert!(own <= best + 1e-9 && own >= (1.0 - (-1.0_f64).exp()) * best, "{count}: {own} {best}");
        // Not examining again what cannot win changes nothing.
        let mut plain: Vec<usize> = Vec::new();
        for _ in 0..count {
            let with = |k: usize| worth(&candidates, &[plain.clone(), vec![k]].concat());
            let next = (0..9).filter(|k| !plain.contains(k)).max_by(|a, b| with(*a).total_cmp(&with(*b)));
            plain.push(next.unwrap());
        }
        assert_eq!(chosen, plain);
    }
}

#[test]
fn each_way_is_best_by_its_own_measure_and_order_does_not_matter() {
    let (candidates, _) = motions(24, 6, 20);
    let d = compare("D", &candidates, &d_optimal(&candidates, 6).unwrap(), None).unwrap();
    let least = |set: &[usize]| information(&candidates, set).symmetric_eigenvalues().min();
    let e = least(&e_optimal(&candidates, 6).unwrap());
    for seed in 0..5 {
        let chance = random(&candidates, 6, seed).unwrap();
        let r = compare("random", &candidates, &chance, None).unwrap();
        assert!(d.log10_determinant > r.log10_determinant, "{d:?} {r:?}");
        assert!(e > least(&chance), "{e} {chance:?}");
    }
    let groups: Vec<Group> =
        (0..3).map(|g| Group { name: format!("{g}"), columns: vec![2 * g, 2 * g + 1] }).collect();
    let mut turned = candidates.clone();
    turned.reverse();
    let names = |candidates: &[Candidate], chosen: Vec<usize>| {
        let mut names: Vec<String> = chosen.into_iter().map(|k| candidates[k].name.clone()).collect();
        names.sort();
        names
    };
    let ways: [Way<'_>; 4] =
        [&|c| d_optimal(c, 6).unwrap(), &|c| e_optimal(c, 6).unwrap(), &|c| random(c, 6, 3).unwrap(), &|c| {
            choose(c, &groups, 1e9, 6).unwrap()
        }];
    for way in ways {
        let own = names(&candidates, way(&candidates));
        assert_eq!(own, names(&turned, way(&turned)));
        assert_eq!(own.len(), 6);
    }
}

#[test]
fn the_published_rule_keeps_motions_that_excite_a_part_and_drops_near_duplicates() {
    let (mut candidates, _) = motions(6, 6, 30);
    // The same motion once more.
    let twin = Candidate { name: "twin".to_owned(), ..candidates[2].clone() };
    candidates.push(twin);
    let groups = [
        Group { name: "a".to_owned(), columns: vec![0, 1] },
        Group { name: "b".to_owned(), columns: vec![0, 3] },
    ];
    let best =
        |c: &Candidate| conditions(&c.factor, &groups).iter().map(|c| c.raw).fold(f64::INFINITY, f64::min);
    let threshold = 3.0;
    let chosen = choose(&candidates, &groups, threshold, 99).unwrap();
    for (k, candidate) in candidates.iter().enumerate() {
        assert_eq!(chosen.contains(&k), best(candidate) < threshold, "{k}");
    }
    let fewer = choose(&candidates, &groups, 1e9, candidates.len() - 1).unwrap();
    assert!(fewer.contains(&2) != fewer.contains(&6), "{fewer:?}");
}

#[test]
fn left_out_rows_have_the_residuals_of_their_factors() {
    let (candidates, made) = motions(5, 4, 25);
    let chosen = [0, 3];
    let choice = compare("two", &candidates, &chosen, None).unwrap();
    let stack = |set: &[usize]| {
        let a = DMatrix::from_rows(&set.iter().flat_map(|k| made[*k].0.row_iter()).collect::<Vec<_>>());
        let y = DVector::from_iterator(a.nrows(), set.iter().flat_map(|k| made[*k].1.iter().copied()));
        (a, y)
    };
    let (a, y) = stack(&chosen);
    let phi = a.svd(true, true).solve(&y, 1e-14).unwrap();
    let (b, left) = stack(&[1, 2, 4]);
    let wanted = ((&b * &phi - &left).norm_squared() / b.nrows() as f64).sqrt();
    assert!((choice.left_out.unwrap() / wanted - 1.0).abs() < 1e-9, "{choice:?} {wanted}");
    assert!(
        (square_left(&candidates[1].factor, &phi) - (&made[1].0 * &phi - &made[1].1).norm_squared()).abs()
            < 1e-9
    );
    assert_eq!(choice.good + choice.fair + choice.poor + choice.small, 4);
    assert_eq!(compare("all", &candidates, &[0, 1, 2, 3, 4], None).unwrap().left_out, None);
}

#[test]
fn impossible_choices_are_named() {
    let (mut candidates, _) = motions(3, 4, 10);
    assert_eq!(check(&[]), Err(SelectionError::Nothing));
    assert_eq!(d_optimal(&candidates, 0), Err(SelectionError::Zero));
    assert_eq!(d_optimal(&candidates, 99).unwrap().len(), 3);
    candidates.push(Candidate { name: "none".to_owned(), factor: Factor::new(4) });
    assert_eq!(e_optimal(&candidates, 2), Err(SelectionError::Empty("none".to_owned())));
    candidates[3] = Candidate { name: "other".to_owned(), factor: Factor::new(5) };
    assert_eq!(random(&candidates, 2, 1), Err(SelectionError::Columns("other".to_owned())));
}
