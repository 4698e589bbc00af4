extern crate std;
use std::vec::Vec;

use nalgebra::{DMatrix, DVector};

use super::*;
use crate::random::Random;

const TRUTH: [f64; 6] = [20.0, -1.0, 0.5, 0.06, -3.0, 0.0];

fn block(random: &mut Random, noise: f64) -> ([[f64; 6]; 6], [f64; 6]) {
    let columns: [[f64; 6]; 6] = core::array::from_fn(|_| core::array::from_fn(|_| random.normal()));
    let rhs = core::array::from_fn(|i| {
        (0..6).map(|j| columns[j][i] * TRUTH[j]).sum::<f64>() + noise * random.normal()
    });
    (columns, rhs)
}

fn factor_of(blocks: &[([[f64; 6]; 6], [f64; 6])]) -> InformationFactor<f64, 6> {
    let mut factor = InformationFactor::new();
    for (columns, rhs) in blocks {
        factor.absorb(columns, rhs);
    }
    factor
}

/// Solves the normal equations in f64 by another program's algebra (nalgebra's Cholesky), which is the
/// oracle.
fn normal_equations(blocks: &[([[f64; 6]; 6], [f64; 6])]) -> (DVector<f64>, DMatrix<f64>, f64) {
    let rows = blocks.len() * 6;
    let a = DMatrix::from_fn(rows, 6, |r, j| blocks[r / 6].0[j][r % 6]);
    let y = DVector::from_fn(rows, |r, _| blocks[r / 6].1[r % 6]);
    let inverse = (a.transpose() * &a).cholesky().unwrap().inverse();
    let x = &inverse * a.transpose() * &y;
    let residual = (&y - a * &x).norm_squared();
    (x, inverse, residual)
}

#[test]
fn solution_covariance_and_residual_are_those_of_the_normal_equations() {
    let mut random = Random(11);
    let blocks: Vec<_> = (0..40).map(|_| block(&mut random, 0.3)).collect();
    let factor = factor_of(&blocks);
    let (x, covariance, residual) = normal_equations(&blocks);
    let solution = factor.solve();
    let full = factor.covariance();
    for j in 0..6 {
        for k in 0..6 {
            assert!((full[j][k] - covariance[(j, k)]).abs() < 1e-14);
        }
        assert!((solution.estimate[j] - x[j]).abs() < 1e-11);
        assert!((solution.standard_deviation[j] - covariance[(j, j)].sqrt()).abs() < 1e-13);
        assert!(solution.determined[j] && factor.r()[j][j] > 0.0);
    }
    assert!((factor.residual_sum_of_squares() - residual).abs() < 1e-10 * residual);
    assert_eq!(factor.rows(), 240);
}

#[test]
fn stretching_widens_the_covariance_and_leaves_solution_correlations_and_residual() {
    let mut random = Random(12);
    let factor = factor_of(&(0..40).map(|_| block(&mut random, 0.3)).collect::<Vec<_>>());
    let estimate = factor.solve().estimate;
    let by = [1.0, 2.0, 1.5, 7.0, 1.0, 3.0];
    let stretched = factor.stretched(&estimate, &by);
    let (before, after) = (factor.covariance(), stretched.covariance());
    for j in 0..6 {
        assert!((stretched.solve().estimate[j] - estimate[j]).abs() < 1e-12);
        for k in 0..6 {
            assert!((after[j][k] - by[j] * by[k] * before[j][k]).abs() < 1e-13);
        }
    }
    assert_eq!(stretched.residual_sum_of_squares(), factor.residual_sum_of_squares());
}

#[test]
fn condition_number_is_that_of_the_column_scaled_rows() {
    let mut random = Random(5);
    let blocks: Vec<_> = (0..10).map(|_| block(&mut random, 0.0)).collect();
    let chosen = [true, false, true, true, false, true];
    let picked: Vec<usize> = (0..6).filter(|j| chosen[*j]).collect();
    let mut a = DMatrix::from_fn(60, picked.len(), |r, c| blocks[r / 6].0[picked[c]][r % 6]);
    for mut column in a.column_iter_mut() {
        column.normalize_mut();
    }
    let s = a.singular_values();
    let expected = s.max() / s.min();
    let got = condition_number(&factor_of(&blocks), &chosen).unwrap();
    assert!((got / expected - 1.0).abs() < 1e-12);
}

#[test]
fn merging_is_associative_commutative_and_equals_absorbing_all() {
    let mut random = Random(3);
    let blocks: Vec<_> = (0..30).map(|_| block(&mut random, 0.1)).collect();
    let parts: Vec<_> = blocks.chunks(10).map(factor_of).collect();
    let whole = factor_of(&blocks);
    let merged = |order: [usize; 3]| {
        let mut f = parts[order[0]];
        f.merge(&parts[order[1]]);
        f.merge(&parts[order[2]]);
        f
    };
    let mut right = parts[1];
    right.merge(&parts[2]);
    let mut nested = parts[0];
    nested.merge(&right);
    for other in [merged([0, 1, 2]), merged([2, 0, 1]), nested] {
        for (a, b) in whole.entries().zip(other.entries()) {
            assert!((a - b).abs() < 1e-12 * whole.r()[0][0]);
        }
        assert_eq!(other.rows(), whole.rows());
    }
}

#[test]
fn permuted_columns_permute_the_answer() {
    let mut random = Random(9);
    let order = [3, 0, 5, 1, 4, 2];
    let blocks: Vec<_> = (0..10).map(|_| block(&mut random, 0.1)).collect();
    let permuted: Vec<_> = blocks.iter().map(|(c, y)| (order.map(|j| c[j]), *y)).collect();
    let (a, b) = (factor_of(&blocks).solve(), factor_of(&permuted).solve());
    for (k, j) in order.into_iter().enumerate() {
        assert!((a.estimate[j] - b.estimate[k]).abs() < 1e-12);
        assert!((a.standard_deviation[j] - b.standard_deviation[k]).abs() < 1e-14);
    }
}

#[test]
fn dependent_columns_are_not_determined_and_the_others_are() {
    // Column 4 repeats column 0 and column 5 is empty: 0, 4 and 5 cannot be determined.
    let mut random = Random(21);
    let mut factor = InformationFactor::<f64, 6>::new();
    for _ in 0..10 {
        let (mut columns, _) = block(&mut random, 0.0);
        columns[4] = columns[0].map(|v| 2.0 * v);
        columns[5] = [0.0; 6];
        let rhs = core::array::from_fn(|i| (0..4).map(|j| columns[j][i] * TRUTH[j]).sum::<f64>());
        factor.absorb(&columns, &rhs);
    }
    let solution = factor.solve();
    assert_eq!(solution.determined, [false, true, true, true, false, false]);
    for j in 1..4 {
        assert!((solution.estimate[j] - TRUTH[j]).abs() < 1e-12);
    }
    assert!(condition_number(&factor, &[true; 6]).is_none());
    assert!(condition_number(&factor, &[true, true, true, true, false, false]).is_some());
}

#[test]
fn near_zero_columns_give_no_nan() {
    // A still body leaves 1e-20 in the columns of the tensor; its square is below the smallest f32.
    let mut cascade = Cascade::<f32, 6, 3>::new();
    for n in 0..1000 {
        let columns: [[f32; 6]; 6] = core::array::from_fn(|j| {
            core::array::from_fn(|i| {
                if j < 3 { ((n * 7 + j * 5 + i * 3) % 13) as f32 - 6.0 } else { 1e-20 * i as f32 }
            })
        });
        let rhs = core::array::from_fn(|i| columns[0][i] + 2.0 * columns[1][i] - columns[2][i]);
        cascade.absorb(&columns, &rhs);
    }
    let factor = cascade.factor();
    assert!(factor.is_finite());
    let solution = factor.solve();
    assert_eq!(solution.determined, [true, true, true, false, false, false]);
    for (x, expected) in solution.estimate.iter().zip([1.0, 2.0, -1.0]) {
        assert!((x - expected).abs() < 1e-5);
    }
}

#[test]
fn entries_round_trip_and_damaged_entries_are_refused() {
    let mut random = Random(2);
    let blocks: Vec<_> = (0..4).map(|_| block(&mut random, 0.1)).collect();
    let factor = factor_of(&blocks);
    let entries: Vec<f64> = factor.entries().collect();
    assert_eq!(entries.len(), InformationFactor::<f64, 6>::ENTRIES);
    assert_eq!(InformationFactor::from_entries(entries.clone(), 24), Some(factor));
    assert!(InformationFactor::<f64, 6>::from_entries(entries[1..].iter().copied(), 24).is_none());
    for (position, damage) in [(0, -1.0), (3, f64::NAN), (24, f64::INFINITY), (27, -1e-9)] {
        let mut damaged = entries.clone();
        damaged[position] = damage;
        assert!(InformationFactor::<f64, 6>::from_entries(damaged, 24).is_none());
    }
}

#[test]
fn trailing_columns_are_the_marginal_and_a_substitution_is_a_product() {
    let mut random = Random(31);
    let blocks: Vec<_> = (0..20).map(|_| block(&mut random, 0.2)).collect();
    let factor = factor_of(&blocks);
    let (whole, part) = (factor.solve(), factor.trailing::<4>().solve());
    for j in 0..4 {
        assert!((whole.estimate[j + 2] - part.estimate[j]).abs() < 1e-12);
        assert!((whole.standard_deviation[j + 2] - part.standard_deviation[j]).abs() < 1e-14);
    }
    // φ = B ψ with a square B: ψ = B⁻¹ φ, by another program's inverse.
    let map: [[f64; 6]; 6] = core::array::from_fn(|_| core::array::from_fn(|_| random.normal()));
    let psi = factor.substitute(&map).solve().estimate;
    let b = DMatrix::from_fn(6, 6, |i, j| map[i][j]);
    let expected = b.try_inverse().unwrap() * DVector::from_column_slice(&whole.estimate);
    for j in 0..6 {
        assert!((psi[j] - expected[j]).abs() < 1e-9 * expected.amax());
    }
}

/// A gathered factor holds whole levels: at least all but the last ones, and nothing twice.
#[test]
fn gathering_step_by_step_counts_nothing_twice() {
    let mut random = Random(8);
    let mut cascade = BodyCascade::<f64, 10>::new();
    let mut gathering = Gathering::default();
    let lever_arm = crate::spatial::Position::zero();
    let (mut gathered, mut absorbed_at_start) = (0, 0);
    for n in 1..20_000_u32 {
        cascade.absorb(&core::array::from_fn(|_| random.normal()), &lever_arm, &[1.0; 6]);
        if cascade.gather(&mut gathering) {
            let rows = gathering.whole.rows();
            // A level of 1600 wrenches may be on its way up meanwhile.
            assert!(rows <= 6 * n && rows + 6 * 1620 >= absorbed_at_start, "{n}: {rows}");
            let (a, b) = (gathering.whole.r()[0][0], cascade.factor().r()[0][0]);
            assert!(a <= b * (1.0 + 1e-12));
            (gathered, absorbed_at_start) = (gathered + 1, 6 * n);
        }
    }
    assert!(gathered > 2500);
}

#[test]
fn the_triangle_alone_gives_the_deviations_and_the_estimate_of_the_singular_values() {
    let mut random = Random(12);
    let blocks: Vec<_> = (0..20).map(|_| block(&mut random, 0.2)).collect();
    let mut factor = factor_of(&blocks);
    let (solution, deviations) = (factor.solve(), factor.standard_deviations());
    let estimate = factor.well_determined(&deviations).unwrap();
    for j in 0..6 {
        assert!((deviations[j] / solution.standard_deviation[j] - 1.0).abs() < 1e-12);
        assert!((estimate[j] - solution.estimate[j]).abs() < 1e-10 * solution.standard_deviation[j]);
    }
    // Two columns that are all but the same.
    for relative in [1e-9, 0.0] {
        factor = InformationFactor::new();
        for (mut columns, rhs) in blocks.iter().copied() {
            columns[4] = core::array::from_fn(|i| columns[1][i] * (1.0 + relative * i as f64));
            factor.absorb(&columns, &rhs);
        }
        let deviations = factor.standard_deviations();
        assert!(deviations[1] > 1e7 && deviations[2] < 10.0, "{deviations:?}");
        assert_eq!(factor.well_determined(&deviations), None);
    }
    let empty = InformationFactor::<f64, 6>::EMPTY;
    assert_eq!(empty.standard_deviations(), [f64::INFINITY; 6]);
    assert_eq!(empty.well_determined(&empty.standard_deviations()), None);
}

/// Entries that a long triangularisation leaves near zero square below the smallest number.
#[test]
fn a_large_dense_factor_merges_into_an_empty_one() {
    fn check<const N: usize>() {
        let mut random = Random(77);
        let mut factor = std::boxed::Box::new(InformationFactor::<f64, N>::new());
        for _ in 0..N {
            let columns = core::array::from_fn(|_| core::array::from_fn::<_, 12, _>(|_| random.normal()));
            factor.absorb(&columns, &core::array::from_fn(|_| random.normal()));
        }
        let mut merged = std::boxed::Box::new(InformationFactor::<f64, N>::new());
        merged.merge(&factor);
        let largest = factor.entries().fold(0.0, |m: f64, e| m.max(e.abs()));
        for (a, b) in factor.entries().zip(merged.entries()) {
            assert!((a - b).abs() < 1e-12 * largest, "{N}: {a} {b}");
        }
    }
    check::<16>();
    check::<128>();
}

/// The kernel that knows the body's zeros against the one that does not: other reflections, the same factor.
/// f64, so that what is left is rounding.
#[test]
fn the_body_s_cascade_is_the_factor_of_the_full_rows() {
    fn check<const N: usize>(wrenches: usize) {
        let mut random = Random(5);
        let weights = [0.2, 0.25, 0.1, 2.6, 2.2, 2.1];
        let mut body = BodyCascade::<f64, N>::new();
        let mut full = InformationFactor::<f64, N>::new();
        for _ in 0..wrenches {
            let signals = core::array::from_fn(|_| random.normal());
            let lever_arm = crate::spatial::Position::new(0.06, -0.04, 0.02);
            let rows = crate::regressor::block(&signals, &lever_arm);
            body.absorb(&signals, &lever_arm, &weights);
            let columns: [[f64; 6]; N] = core::array::from_fn(|j| {
                core::array::from_fn(|i| match rows.columns.get(j) {
                    Some(column) => column[i] * weights[i],
                    None => f64::from(u8::from(j - 10 == i)) * weights[i],
                })
            });
            full.absorb(&columns, &core::array::from_fn(|i| rows.wrench[i] * weights[i]));
        }
        let mut cascade = body;
        let (body, largest) = (cascade.factor(), full.entries().fold(0.0, |m: f64, e| m.max(e.abs())));
        let mut gathering = Gathering::default();
        while !cascade.gather(&mut gathering) {}
        assert!(gathering.whole.rows() <= full.rows());
        assert_eq!(body.rows(), full.rows());
        for (a, b) in body.entries().zip(full.entries()) {
            assert!((a - b).abs() < 1e-11 * largest, "{N}, {wrenches}: {a} {b}");
        }
    }
    // Blocks that are full and not, levels that are full and not.
    for wrenches in [1, 2, 3, 4, 7, 1600, 1601, 6403] {
        check::<10>(wrenches);
        check::<16>(wrenches);
    }
}

/// One level drifts, the cascade does not: f32 against f64 on the very same rows after 1e6 blocks, in units
/// of the standard deviation, within what f32 can hold (20 ε cond ‖φ‖).
#[test]
fn the_cascade_keeps_digits_that_a_single_level_loses() {
    let mut random = Random(17);
    let noise = 0.01_f64;
    let mut single = InformationFactor::<f32, 6>::new();
    let mut cascade = Cascade::<f32, 6, 4>::new();
    let mut exact = InformationFactor::<f64, 6>::new();
    let pool: Vec<_> = (0..997).map(|_| block(&mut random, noise)).collect();
    for n in 0..1_000_000 {
        let (columns, rhs) = &pool[n % pool.len()];
        let narrow = columns.map(|c| c.map(|v| v as f32));
        let narrow_rhs = rhs.map(|v| v as f32);
        single.absorb(&narrow, &narrow_rhs);
        cascade.absorb(&narrow, &narrow_rhs);
        exact.absorb(&narrow.map(|c| c.map(f64::from)), &narrow_rhs.map(f64::from));
    }
    let truth = exact.solve();
    let norm = TRUTH.iter().map(|v| v * v).sum::<f64>().sqrt();
    let deviation = |factor: &InformationFactor<f32, 6>| {
        let x = factor.solve().estimate;
        (0..6).map(|j| (f64::from(x[j]) - truth.estimate[j]).abs()).fold(0.0, f64::max)
    };
    let floor = 20.0 * 1.19e-7 * truth.condition_number * norm;
    let sd = truth.standard_deviation[0] * noise;
    assert!(deviation(&cascade.factor()) < floor.max(0.05 * sd), "{}", deviation(&cascade.factor()));
    assert!(deviation(&cascade.factor()) < deviation(&single));
}

/// Rows that are whitened together, from some wrench on, against the factor of the same rows: blocks, levels
/// that are handed up in the middle, settled between the wrenches never, once or twice.
#[test]
fn the_body_s_cascade_of_rows_whitened_together_is_the_factor_of_these_rows() {
    fn check<const N: usize>(from: usize, wrenches: usize, settles: usize) {
        let mut random = Random(9);
        let weights = [0.2, 0.25, 0.1, 2.6, 2.2, 2.1];
        let whitening = crate::whitening::Whitening::<f64> {
            columns: core::array::from_fn(|_| core::array::from_fn(|_| random.normal())),
            poles: [1.5, 0.5, 0.0],
        };
        let (mut low_pass, mut after) = (crate::whitening::LowPass::NEW, [[0.0; 2]; 17]);
        let mut before = after;
        let mut body = BodyCascade::<f64, N>::new();
        let mut full = InformationFactor::<f64, N>::new();
        let lever_arm = crate::spatial::Position::new(0.06, -0.04, 0.02);
        for n in 0..wrenches {
            let signals = core::array::from_fn(|_| random.normal());
            let factors = if n % 7 == 0 { [1.0, 0.5, 1.0, 1.0, 1.0, 0.1] } else { [1.0; 6] };
            let rows = crate::regressor::block(&signals, &lever_arm);
            let column = |j: usize| match rows.columns.get(j) {
                _ if j == N => rows.wrench,
                Some(column) => *column,
                None => core::array::from_fn(|i| f64::from(u8::from(j - 10 == i))),
            };
            let white: std::vec::Vec<[f64; 6]> = (0..=N)
                .map(|j| {
                    let own = column(j);
                    if n < from {
                        return core::array::from_fn(|c| weights[c] * own[c]);
                    }
                    let mut out: [f64; 6] = core::array::from_fn(|c| {
                        (0..6).map(|k| whitening.columns[k][c] * factors[k] * own[k]).sum()
                    });
                    for c in 0..2 {
                        let pole = whitening.poles[c];
                        if n == from {
                            before[j][c] = out[c];
                        }
                        let y = ((pole - 1.0) * after[j][c] + out[c] + before[j][c]) / (pole + 1.0);
                        (before[j][c], after[j][c], out[c]) = (out[c], y, y);
                    }
                    out
                })
                .collect();
            full.absorb(&core::array::from_fn(|j| white[j]), &white[N]);
            if n < from {
                body.absorb(&signals, &lever_arm, &weights);
                continue;
            }
            body.see_together();
            body.absorb_together(&signals, &lever_arm, &factors, &whitening, &mut low_pass);
            for _ in 0..settles {
                body.settle();
            }
        }
        let (own, largest) = (body.factor(), full.entries().fold(0.0, |m: f64, e| m.max(e.abs())));
        assert_eq!(own.rows(), full.rows());
        for (a, b) in own.entries().zip(full.entries()) {
            assert!((a - b).abs() < 1e-11 * largest, "{N}, {from}, {wrenches}, {settles}: {a} {b}");
        }
    }
    for settles in [0, 1, 2, 9] {
        for (from, wrenches) in [(0, 1), (0, 2), (3, 8), (1602, 1606), (50, 2500), (1700, 5000)] {
            check::<10>(from, wrenches, settles);
            check::<16>(from, wrenches, settles);
        }
    }
}

/// Reductions that begin before rows are whitened together, after any number of wrenches and settled or not
/// in between, have the bits of those in one go, and an estimate in between too.
#[test]
fn a_reduction_that_begins_early_has_the_bits_of_one_in_one_go() {
    fn check<const N: usize>(wrenches: usize, settles: usize) {
        let mut random = Random(11);
        let mut wrench = |cascade: &mut [BodyCascade<f32, N>; 2]| {
            let signals = core::array::from_fn(|_| random.normal() as f32);
            let lever_arm = crate::spatial::Position::new(0.06, -0.04, 0.02);
            let weights = [0.2, 0.25, 0.1, 2.6, 2.2, 2.1];
            cascade.iter_mut().for_each(|cascade| cascade.absorb(&signals, &lever_arm, &weights));
        };
        let mut both = [BodyCascade::<f32, N>::new(); 2];
        (0..wrenches).for_each(|_| wrench(&mut both));
        assert_eq!(both[1].begin_together(), wrenches > 0, "{wrenches}");
        // Once it has begun there is nothing to begin with.
        assert!(!both[1].begin_together());
        (0..settles).for_each(|_| {
            both[1].settle();
        });
        let same = |[one, other]: &[BodyCascade<f32, N>; 2]| {
            let bits = |cascade: &BodyCascade<f32, N>| {
                cascade.factor().entries().map(f32::to_bits).collect::<std::vec::Vec<_>>()
            };
            assert_eq!(bits(one), bits(other), "{N}: {wrenches} {settles}");
        };
        same(&both);
        both.iter_mut().for_each(BodyCascade::see_together);
        same(&both);
    }
    for wrenches in [0, 1, 2, 3, 4, 5, 50, 1597, 1599] {
        for settles in 0..6 {
            check::<10>(wrenches, settles);
            check::<16>(wrenches, settles);
        }
    }
}
