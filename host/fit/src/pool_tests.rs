use nalgebra::{DMatrix, DVector};

use super::*;
use crate::examples::{Run, apart, body, dense, tree, truth};

fn is_offset(p: &Parameter) -> bool {
    p.kind == Kind::Offset
}

/// Runs of one model, each with offsets of its own.
fn runs(parameters: &[Parameter], count: u64) -> Vec<Run> {
    let phi = truth(parameters.len());
    (0..count)
        .map(|seed| {
            let own = |(j, v): (usize, &f64)| if is_offset(&parameters[j]) { v + seed as f64 } else { *v };
            let phi: Vec<f64> = phi.iter().enumerate().map(own).collect();
            Run::new(parameters, &phi, 180, 3.0, seed)
        })
        .collect()
}

fn pooled(runs: &[Run]) -> Vec<PooledFactor> {
    runs.iter().map(|run| run.pooled.clone()).collect()
}

/// Oracle: the normal equations of all rows, with columns of its own for each run's offsets.
#[test]
fn merged_runs_are_the_dense_problem_with_offsets_of_each_run() {
    for parameters in [body(), tree(1), tree(6)] {
        let count = parameters.len();
        assert!([16, 25, 60].contains(&count));
        let runs = runs(&parameters, 3);
        let kept: Vec<usize> = (0..count).filter(|j| !is_offset(&parameters[*j])).collect();
        let own: Vec<usize> = (0..count).filter(|j| is_offset(&parameters[*j])).collect();
        let rows = runs[0].a.nrows();
        let mut a = DMatrix::zeros(3 * rows, kept.len() + 18);
        let mut y = DVector::zeros(3 * rows);
        let mut apart_squares = 0.0;
        for (k, run) in runs.iter().enumerate() {
            for i in 0..rows {
                kept.iter().enumerate().for_each(|(c, j)| a[(k * rows + i, c)] = run.a[(i, *j)]);
                own.iter()
                    .enumerate()
                    .for_each(|(c, j)| a[(k * rows + i, kept.len() + 6 * k + c)] = run.a[(i, *j)]);
                y[k * rows + i] = run.y[i];
            }
            apart_squares += dense(&run.a, &run.y).2;
        }
        let (estimate, covariance, squares) = dense(&a, &y);
        let merged = PooledFactor::merged(pooled(&runs), false).unwrap();
        assert_eq!((merged.eliminated, merged.comparisons), (18, 2 * kept.len() as u64));
        assert!((merged.factor().residual_sum_of_squares() / squares - 1.0).abs() < 1e-9);
        assert!((merged.disagreement / (squares - apart_squares) - 1.0).abs() < 1e-8);
        let fit = merged.fit();
        // The condition number, below 1e2, squared, times ε.
        let all: Vec<usize> = (0..kept.len()).collect();
        assert!(apart(&fit, &all, &estimate, &covariance) < 1e-9);
        assert_eq!((fit.noise.variance_scale, fit.noise.disagreement), (1.0, None));
        assert_eq!((fit.channels.len(), fit.counts.samples, fit.counts.blocks), (6, 90, 90));
        assert_eq!(fit.identities.iter().map(|own| own.fingerprint).collect::<Vec<_>>(), [0, 1, 2]);
    }
}

#[test]
fn shared_offsets_are_one() {
    let parameters = tree(1);
    let phi = truth(25);
    let runs: Vec<Run> = (0..2).map(|seed| Run::new(&parameters, &phi, 120, 3.0, seed)).collect();
    let a = DMatrix::from_fn(240, 25, |i, j| runs[i / 120].a[(i % 120, j)]);
    let y = DVector::from_fn(240, |i, _| runs[i / 120].y[i % 120]);
    let (estimate, covariance, _) = dense(&a, &y);
    let merged = PooledFactor::merged(pooled(&runs), true).unwrap();
    let fit = merged.fit();
    assert!(apart(&fit, &(0..25).collect::<Vec<_>>(), &estimate, &covariance) < 1e-9);
    assert_eq!((merged.eliminated, merged.comparisons), (0, 25));
    assert_eq!(fit.channels[4].channel.offset, parameters.iter().position(|p| p.name == "offset_my"));
}

#[test]
fn the_order_of_merging_and_of_columns_does_not_matter() {
    for parameters in [tree(1), tree(6)] {
        let runs = runs(&parameters, 4);
        let one = PooledFactor::merged(pooled(&runs), false).unwrap();
        // In pairs, the other way about, and the last with its columns in another order.
        let mut files = pooled(&runs);
        let last = files.pop().unwrap();
        let order: Vec<usize> = (0..parameters.len()).rev().collect();
        let turned = PooledFactor {
            parameters: order.iter().map(|j| parameters[*j].clone()).collect(),
            rigs: last.rigs.iter().map(|rig| rig.select(&order)).collect(),
            ..last
        };
        let pair = PooledFactor::merged(vec![files.pop().unwrap(), turned], false).unwrap();
        files.insert(0, pair);
        let other = PooledFactor::merged(files, false).unwrap();
        let (one, other) = (one.fit(), other.fit());
        for (j, parameter) in one.parameters.iter().enumerate() {
            let k = other.parameters.iter().position(|p| p.name == parameter.name).unwrap();
            let (a, b) = (one.estimate.measured(j).unwrap(), other.estimate.measured(k).unwrap());
            assert!((a.value - b.value).abs() < 1e-11 * a.u95 && (a.u95 / b.u95 - 1.0).abs() < 1e-11);
        }
        assert!((one.noise.variance_ratio - other.noise.variance_ratio).abs() < 1e-11);
    }
}

/// Runs of bodies that differ by ten standard deviations: the intervals hold both.
#[test]
fn runs_that_disagree_are_reported_and_widen_the_intervals() {
    let parameters = body();
    let (mut phi, mut runs) = (truth(16), Vec::new());
    for seed in 0..2 {
        runs.push(Run::new(&parameters, &phi, 180, 3.0, seed));
        let sd = dense(&runs[0].a, &runs[0].y).1[(0, 0)].sqrt();
        phi[0] += 40.0 * sd;
    }
    let merged = PooledFactor::merged(pooled(&runs), false).unwrap();
    let ratio = merged.unexplained_disagreement().unwrap();
    let fit = merged.fit();
    assert_eq!(fit.noise.disagreement, Some(ratio));
    // Half of 40² sd² in one direction of ten, and what is expected.
    assert!((60.0..110.0).contains(&ratio), "{ratio}");
    assert!((fit.noise.variance_scale / ratio - 1.0).abs() < 0.2);
    assert!(disagreement_in_words("the runs", ratio).contains("disagree 8."));
}

#[test]
fn factors_that_do_not_fit_are_refused_by_kind() {
    let runs = runs(&tree(1), 2);
    let [a, b] = [&runs[0].pooled, &runs[1].pooled];
    let merge = |files: &[&PooledFactor], shared: bool| {
        PooledFactor::merged(files.iter().map(|f| (*f).clone()).collect(), shared).unwrap_err()
    };
    assert_eq!(merge(&[], false), PoolError::Nothing);
    let copy = PooledFactor { name: "copy".into(), ..a.clone() };
    let repeated = merge(&[a, b, &copy], false);
    assert!(
        matches!(&repeated, PoolError::Repeated { first, second, .. } if first == "run 0" && second == "copy")
    );
    let differ = |change: &dyn Fn(&mut PooledFactor), shared: bool| {
        let mut other = b.clone();
        change(&mut other);
        let PoolError::Model { difference, .. } = merge(&[a, &other], shared) else { panic!() };
        difference
    };
    let pounds = differ(&|f| f.parameters[0].unit = "lb".into(), false);
    assert_eq!((pounds.changed, pounds.missing.len()), (vec!["base.M".to_owned()], 0));
    let longer = differ(&|f| f.parameters[3].made_of[1].1 = 0.3, false);
    assert_eq!(longer.changed, ["base.MSz"]);
    let renamed = differ(&|f| f.parameters[3].name = "base.MSw".into(), false);
    assert_eq!(
        (renamed.missing, renamed.foreign),
        (vec!["base.MSz".to_owned()], vec!["base.MSw".to_owned()])
    );
    let geometry = differ(&|f| f.model_fingerprint = 78, false);
    assert_eq!(geometry, ModelDifference::default());
    assert!(geometry.to_string().contains("geometry"));
    let without = b.clone().without_offsets();
    let PoolError::Model { difference, .. } = merge(&[a, &without], true) else { panic!() };
    assert_eq!(difference.missing.len(), 6);
    // Merged with the offsets of each eliminated they fit.
    assert!(PooledFactor::merged(vec![a.clone(), without], false).is_ok());
    // A sum whose weights differ by rounding is the same sum.
    let mut rounded = b.clone();
    rounded.parameters[3].made_of[1].1 += 1e-15;
    assert!(PooledFactor::merged(vec![a.clone(), rounded], false).is_ok());
    let entries = vec![f64::MAX; a.factor().entries().len()];
    let huge = b.clone().with_factor(Factor::from_entries(25, &entries, 9).unwrap());
    assert!(matches!(merge(&[a, &huge], true), PoolError::Overflow { name } if name == "run 1"));
}

#[test]
fn ten_thousand_runs_merge_and_are_named_in_one_line() {
    let run = Run::new(&body(), &truth(16), 60, 3.0, 0);
    let files: Vec<PooledFactor> = (0..10_000)
        .map(|seed| {
            let mut file = run.pooled.clone();
            file.sources[0].fingerprint = seed;
            file.sources[0].recording = format!("recording {seed}");
            file
        })
        .collect();
    let started = std::time::Instant::now();
    let merged = PooledFactor::merged(files.clone(), false).unwrap();
    println!("10 000 factors in {:?}", started.elapsed());
    assert_eq!((merged.runs(), merged.rows()), (10_000, 600_000));
    assert!(merged.sources.len() == 1 && merged.to_bytes().len() < 4_000, "{}", merged.to_bytes().len());
    assert!(merged.recordings().ends_with("recording 3 + 9996 more"), "{}", merged.recordings());
    // Ten thousand alike know what one knows, a hundred times better.
    let (one, all) = (run.fit().estimate.u95(0), merged.fit().estimate.u95(0));
    assert!((one / all / 100.0 - 1.0).abs() < 1e-9, "{one} {all}");
    let again = [files, vec![run.pooled]].concat();
    assert!(matches!(PooledFactor::merged(again, false), Err(PoolError::Repeated { .. })));
}

#[test]
fn more_rows_than_a_word_of_32_bits_are_counted() {
    let mut runs = runs(&body(), 2);
    for run in &mut runs {
        run.pooled.sources[0].rows = 3_000_000_000;
        let factor = run.pooled.factor();
        let squares = factor.residual_sum_of_squares();
        run.pooled = run.pooled.clone().with_factor(factor.with_residual(squares, 3_000_000_000));
    }
    let merged = PooledFactor::merged(pooled(&runs), false).unwrap();
    assert_eq!(merged.rows(), 6_000_000_000);
    let read = PooledFactor::from_bytes(&merged.to_bytes(), &merged.name).unwrap();
    assert_eq!(read, merged);
}

#[test]
fn lacking_offsets_are_reported() {
    let runs = runs(&body(), 2);
    let merged = PooledFactor::merged(pooled(&runs), false).unwrap();
    assert!(merged.without_offset_in_words().unwrap().contains("each run has its own"));
    assert_eq!(runs[0].pooled.without_offset_in_words(), None);
}

/// The columns of three errors of a run.
fn of_errors(run: &Run) -> DMatrix<f64> {
    DMatrix::from_fn(run.a.nrows(), 3, |i, k| match k {
        0 => 0.3 * run.y[i],
        1 => run.a[(i, 0)] + 2.0 * run.a[(i, 5)],
        _ => (0.37 * i as f64).sin(),
    })
}

const SIGMA: [f64; 3] = [0.05, 0.2, 1.5];
const EXPECTED: [f64; 3] = [0.0, 0.3, -0.5];

/// The same run with the errors of an instrument as columns.
fn with_errors(run: &Run, instrument: &str, correlation: f64) -> PooledFactor {
    let (n, errors) = (run.parameters.len(), of_errors(run));
    let a =
        DMatrix::from_fn(run.a.nrows(), n + 3, |i, j| if j < n { run.a[(i, j)] } else { errors[(i, j - n)] });
    let error = |k: usize| crate::RigError {
        instrument: instrument.to_owned(),
        name: format!("error {k}"),
        group: "errors".to_owned(),
        unit: "1".to_owned(),
        basis: crate::Basis::Class("usual".to_owned()),
        expected: EXPECTED[k],
        sigma: SIGMA[k],
    };
    let covariance = beforehand(correlation);
    let all = crate::examples::factor(&a, &run.y);
    let rows = RigRows::new(n, all, (0..3).map(error).collect(), covariance).unwrap();
    PooledFactor { rigs: vec![rows], ..run.pooled.clone() }
}

fn beforehand(correlation: f64) -> DMatrix<f64> {
    let own = |i: usize, k: usize| if i == k { 1.0 } else { correlation };
    DMatrix::from_fn(3, 3, |i, k| own(i, k) * SIGMA[i] * SIGMA[k])
}

/// The information of a run by normal equations, its offsets eliminated: the information N on the ten
/// parameters for given errors, these as they are without errors, what each error moves them by, and what the
/// run by itself says of errors: information and right-hand side.
struct Dense {
    n: DMatrix<f64>,
    psi: DVector<f64>,
    moved: DMatrix<f64>,
    of_errors: (DMatrix<f64>, DVector<f64>),
}

impl Dense {
    fn of(run: &Run) -> Self {
        let own = run.a.columns(10, 6).into_owned();
        let project = DMatrix::identity(own.nrows(), own.nrows())
            - &own * (own.transpose() * &own).try_inverse().unwrap() * own.transpose();
        let (a, b, y) = (&project * run.a.columns(0, 10), &project * of_errors(run), &project * &run.y);
        let n = a.transpose() * &a;
        let inverse = n.clone().try_inverse().unwrap();
        let left = |v: &DMatrix<f64>| v - &a * (&inverse * a.transpose() * v);
        let b_left = left(&b);
        let y = DMatrix::from_columns(&[y]);
        let y_left = left(&y).column(0).into_owned();
        Self {
            psi: &inverse * a.transpose() * y.column(0),
            moved: &inverse * a.transpose() * &b,
            of_errors: (b_left.transpose() * &b_left, b_left.transpose() * y_left),
            n,
        }
    }
}

/// Oracle: of each rig the weighted means of what its runs say, and of what errors move; errors as each run
/// by itself and what is known of them say. Rigs are then independent.
#[test]
fn an_error_of_a_rig_is_one_in_all_of_its_runs() {
    let parameters = body();
    let runs = runs(&parameters, 4);
    for (of_runs, correlation) in
        [([0, 0, 0, 0], 0.0), ([0, 1, 0, 1], 0.0), ([0, 1, 2, 3], 0.0), ([0, 0, 1, 0], 0.4)]
    {
        let rigs = 1 + of_runs.iter().max().unwrap();
        let (mut information, mut right) = (DMatrix::zeros(10, 10), DVector::zeros(10));
        for rig in 0..rigs {
            let own = runs.iter().zip(of_runs).filter(|(_, of)| *of == rig).map(|(run, _)| Dense::of(run));
            let own: Vec<Dense> = own.collect();
            let n: DMatrix<f64> = own.iter().map(|run| &run.n).sum();
            let inverse = n.clone().try_inverse().unwrap();
            let psi = &inverse * own.iter().map(|run| &run.n * &run.psi).sum::<DVector<f64>>();
            let moved = &inverse * own.iter().map(|run| &run.n * &run.moved).sum::<DMatrix<f64>>();
            let known = beforehand(correlation).try_inverse().unwrap();
            let of_errors = &known + own.iter().map(|run| &run.of_errors.0).sum::<DMatrix<f64>>();
            let value = known * DVector::from_column_slice(&EXPECTED)
                + own.iter().map(|run| &run.of_errors.1).sum::<DVector<f64>>();
            let covariance = of_errors.try_inverse().unwrap();
            let estimate = psi - &moved * &covariance * value;
            let all = (inverse + &moved * covariance * moved.transpose()).try_inverse().unwrap();
            right += &all * estimate;
            information += all;
        }
        let covariance = information.try_inverse().unwrap();
        let estimate = &covariance * right;
        let file = |(run, rig): (&Run, i32)| with_errors(run, &format!("rig {rig}"), correlation);
        let mut files: Vec<PooledFactor> = runs.iter().zip(of_runs).map(file).collect();
        let all: Vec<usize> = (0..10).collect();
        let check = |merged: &PooledFactor| {
            let fit = merged.fit();
            let off = apart(&fit, &all, &estimate, &covariance);
            assert!(off < 1e-8, "{of_runs:?}: {off}");
            assert_eq!(merged.rigs.len(), rigs as usize);
            assert_eq!(fit.noise.disagreement, None);
        };
        let merged = PooledFactor::merged(files.clone(), false).unwrap();
        check(&merged);
        check(&PooledFactor::from_bytes(&merged.to_bytes(), &merged.name).unwrap());
        // In pairs, the other way about.
        let last = files.split_off(2);
        let [first, last] = [files, last].map(|pair| PooledFactor::merged(pair, false).unwrap());
        check(&PooledFactor::merged(vec![last, first], false).unwrap());
    }
}

/// Columns of gains are made of each run's own estimate, whose noise is that of its values: two thousand
/// noisy runs do not tell the gain by that, and leave the body where it is.
#[test]
fn noise_of_the_estimates_that_columns_are_made_of_tells_no_gain() {
    let (parameters, phi) = (body(), truth(16));
    let files: Vec<PooledFactor> = (0..2000)
        .map(|seed| {
            let run = Run::new(&parameters, &phi, 24, 3.0, seed);
            let own = run.fit().estimate;
            let values = DVector::from_fn(16, |j, _| if j < 10 { own.unjudged().values[j] } else { 0.0 });
            let predicted = &run.a * values;
            let a = DMatrix::from_fn(24, 17, |i, j| if j < 16 { run.a[(i, j)] } else { predicted[i] });
            let error = crate::RigError {
                instrument: "rig".to_owned(),
                name: "gain".to_owned(),
                group: "gain".to_owned(),
                unit: "1".to_owned(),
                basis: crate::Basis::Class("usual".to_owned()),
                expected: 0.0,
                sigma: 0.02,
            };
            let covariance = DMatrix::from_element(1, 1, 4e-4);
            let rows =
                RigRows::new(16, crate::examples::factor(&a, &run.y), vec![error], covariance).unwrap();
            PooledFactor { rigs: vec![rows], ..run.pooled }
        })
        .collect();
    let fit = PooledFactor::merged(files, false).unwrap().fit();
    for (j, truth) in phi.iter().enumerate().take(10) {
        let found = fit.estimate.measured(j).unwrap();
        // The gain is exact here, and known to 2 %: noise is small beside it.
        assert!((found.u95 / (1.96 * 0.02 * truth.abs()) - 1.0).abs() < 0.3, "{j}: {found:?} {truth}");
        assert!((found.value - truth).abs() < 0.5 * found.u95, "{j}: {found:?} {truth}");
    }
}

/// A thousand runs of one rig know of the body what its errors leave, and are no larger than two.
#[test]
fn runs_of_one_rig_do_not_average_its_errors_out() {
    let run = with_errors(&Run::new(&body(), &truth(16), 60, 3.0, 0), "rig", 0.0);
    let many = |count: u64| {
        let files = (0..count).map(|seed| {
            let mut file = run.clone();
            file.sources[0].fingerprint = seed;
            file
        });
        PooledFactor::merged(files.collect(), false).unwrap()
    };
    let [two, thousand] = [2, 1000].map(many);
    assert_eq!(two.rigs[0].factor().parameters(), thousand.rigs[0].factor().parameters());
    let systematic = thousand.fit().estimate.u95(0);
    let averaged = run.fit().estimate.u95(0) / 1000_f64.sqrt();
    assert!(systematic > 5.0 * averaged, "{systematic} {averaged}");
}

#[test]
fn runs_of_one_rig_that_state_other_errors_are_reported_and_old_ones_refused() {
    let runs = runs(&body(), 2);
    let first = with_errors(&runs[0], "rig", 0.0);
    let mut second = with_errors(&runs[1], "rig", 0.0);
    let rows = &second.rigs[0];
    let errors: Vec<_> = rows
        .errors()
        .iter()
        .map(|e| crate::RigError {
            sigma: 2.0 * e.sigma,
            basis: crate::Basis::Stated("gain".to_owned()),
            ..e.clone()
        })
        .collect();
    let wider = RigRows::new(16, rows.factor().clone(), errors, 4.0 * beforehand(0.0)).unwrap();
    second.rigs = vec![wider];
    let merged = PooledFactor::merged(vec![first.clone(), second.clone()], false).unwrap();
    assert_eq!(merged.differing, ["error 0", "error 1", "error 2"]);
    assert_eq!(merged.rigs[0].errors()[1].sigma, 2.0 * SIGMA[1]);
    second.errors_inside = true;
    let refused = PooledFactor::merged(vec![first, second], false).unwrap_err();
    assert!(matches!(&refused, PoolError::Old { name } if name == "run 1"), "{refused}");
}

/// Offsets are each run's own: of runs of nothing else nothing is left, and that is no reason to break.
#[test]
fn runs_of_offsets_alone_merge_to_nothing() {
    let files: Vec<PooledFactor> =
        runs(&body(), 2).into_iter().map(|run| run.pooled.only(is_offset)).collect();
    let merged = PooledFactor::merged(files, false).unwrap();
    assert_eq!((merged.parameters.len(), merged.fit().estimate.len()), (0, 0));
}
