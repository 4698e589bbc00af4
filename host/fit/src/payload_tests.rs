use nalgebra::{DMatrix, DVector};

use super::*;
use crate::examples::{Run, body, dense, factor, tree, truth};
use crate::pool::PooledFactor;
use crate::{Basis, RigError};

const SEVEN: [usize; 7] = [0, 1, 2, 6, 7, 8, 9];

fn carrier() -> Carrier {
    Carrier { link: "link1".into(), to_link: DMatrix::identity(10, 10), frame: "hand".into() }
}

/// Weights of link1's m, mcx, mcy, Ixx less Iyy, Izz, Iyz, Izx, Ixy in the inertial parameters: what the tree
/// can tell.
fn weights_of_eight(parameters: &[Parameter]) -> DMatrix<f64> {
    let names = ["m", "mcx", "mcy", "Ixx", "Izz", "Iyz", "Izx", "Ixy"].map(|n| format!("link1.{n}"));
    let all: Vec<&Parameter> = parameters.iter().filter(|p| p.kind.is_inertial()).collect();
    DMatrix::from_fn(all.len(), 8, |i, k| {
        all[i].made_of.iter().filter(|(name, _)| *name == names[k]).map(|(_, w)| *w).sum()
    })
}

const SIGMA: f64 = 0.3;

/// A run with the columns of two errors, and its fit.
struct WithErrors {
    run: Run,
    errors: DMatrix<f64>,
    fit: Fit,
}

impl WithErrors {
    fn new(parameters: &[Parameter], phi: &[f64], rows: usize, seed: u64, names: [&str; 2]) -> Self {
        let run = Run::new(parameters, phi, rows, 2.0, seed);
        // In proportion to what is measured, and to what a parameter makes.
        let errors = DMatrix::from_fn(rows, 2, |i, k| {
            if k == 0 { 0.2 * run.y[i] } else { 3.0 * run.a[(i, 0)] - run.a[(i, 4)] }
        });
        let error = |name: &str| RigError {
            instrument: "arm".into(),
            name: name.to_owned(),
            group: "effort gain".to_owned(),
            unit: String::new(),
            basis: Basis::Class("usual".to_owned()),
            expected: 0.0,
            sigma: SIGMA,
        };
        let n = parameters.len();
        let joint =
            DMatrix::from_fn(rows, n + 2, |i, j| if j < n { run.a[(i, j)] } else { errors[(i, j - n)] });
        let covariance = DMatrix::identity(2, 2) * SIGMA * SIGMA;
        let all = RigRows::new(n, factor(&joint, &run.y), names.map(error).to_vec(), covariance).unwrap();
        let fit = PooledFactor { rigs: vec![all], ..run.pooled.clone() }.fit();
        Self { run, errors, fit }
    }

    fn tare(&self) -> Tare {
        Tare::of_run(&self.fit, PooledFactor { rigs: vec![self.fit.rows()], ..self.run.pooled.clone() })
            .unwrap()
    }
}

/// Runs with and without 0.7 kg on link1, whose errors are the same or not.
fn runs(shared: bool) -> [WithErrors; 2] {
    let parameters = tree(2);
    let k = weights_of_eight(&parameters);
    let payload = DVector::from_vec(vec![0.7, 0.05, -0.02, 0.01, 0.006, 1e-3, -2e-3, 5e-4]);
    let mut phi = truth(parameters.len());
    let bare = WithErrors::new(&parameters, &phi, 300, 2, if shared { ["a", "b"] } else { ["c", "d"] });
    (&k * payload).iter().enumerate().for_each(|(i, v)| phi[i] += v);
    [WithErrors::new(&parameters, &phi, 240, 1, ["a", "b"]), bare]
}

/// Oracle: the normal equations of all rows, with columns for the arm, both runs' offsets, the payload and
/// every error.
#[test]
fn a_payload_is_the_difference_of_both_runs() {
    for shared in [true, false] {
        let [with, without] = runs(shared);
        let found = without.tare().payload(&with.fit, &carrier()).unwrap();
        let k = weights_of_eight(&with.run.parameters);
        let (n, inertial) = (with.run.parameters.len(), k.nrows());
        let (own, kinds) = (n - inertial, if shared { 2 } else { 4 });
        let payload = inertial + 2 * own;
        let (rows, all) = (with.run.a.nrows() + without.run.a.nrows() + kinds, payload + 8 + kinds);
        let mut a = DMatrix::zeros(rows, all);
        let mut y = DVector::zeros(rows);
        let mut at = 0;
        for (r, run) in [&with, &without].into_iter().enumerate() {
            for i in 0..run.run.a.nrows() {
                for j in 0..n {
                    a[(at, if j < inertial { j } else { j + r * own })] = run.run.a[(i, j)];
                }
                for c in (0..8).filter(|_| r == 0) {
                    a[(at, payload + c)] = (0..inertial).map(|j| run.run.a[(i, j)] * k[(j, c)]).sum();
                }
                for e in 0..2 {
                    a[(at, payload + 8 + if shared { e } else { 2 * r + e })] = run.errors[(i, e)];
                }
                y[at] = run.run.y[i];
                at += 1;
            }
        }
        (0..kinds).for_each(|e| a[(at + e, payload + 8 + e)] = 1.0 / SIGMA);
        let (estimate, covariance, _) = dense(&a, &y);
        for (j, place) in [0, 1, 2, 4, 5, 6, 7].into_iter().zip(SEVEN) {
            let (value, sd) = (estimate[payload + j], covariance[(payload + j, payload + j)].sqrt());
            let m = found.estimate.measured(place).unwrap();
            assert!((m.value - value).abs() < 1e-6 * sd, "{shared} {place}: {} {value}", m.value);
            let own = found.estimate.covariance(place, place).unwrap().sqrt();
            assert!((own / sd - 1.0).abs() < 1e-6, "{shared} {place}: {own} {sd}");
        }
        assert!([3, 4, 5].iter().all(|j| found.estimate.measured(*j).is_none()), "no row tells them");
        assert!(found.noise.disagreement.is_none());
        assert_eq!(found.parameters[0].frame, "hand");
    }
}

/// Errors that both runs share cancel: intervals are smaller than of errors of each run's own.
#[test]
fn shared_errors_of_both_runs_cancel() {
    let sd = |shared: bool| {
        let [with, without] = runs(shared);
        let found = without.tare().payload(&with.fit, &carrier()).unwrap();
        SEVEN.map(|j| found.estimate.covariance(j, j).unwrap().sqrt())
    };
    let (own, apart) = (sd(true), sd(false));
    assert!(own.iter().sum::<f64>() < apart.iter().sum::<f64>(), "{own:?} {apart:?}");
}

/// What is left of two runs of the same arm is noise; what a body on the link does not explain is reported.
#[test]
fn runs_that_differ_by_more_than_a_payload_are_reported_and_widened() {
    let parameters = tree(2);
    let bare = Run::new(&parameters, &truth(32), 300, 2.0, 2);
    let mut phi = truth(32);
    phi[11] += 100.0;
    let with = Run::new(&parameters, &phi, 300, 2.0, 1);
    let tare = Tare::of_run(&bare.fit(), bare.pooled.clone()).unwrap();
    let found = tare.payload(&with.fit(), &carrier()).unwrap();
    let ratio = found.noise.disagreement.unwrap();
    let honest = tare.payload(&Run::new(&parameters, &truth(32), 300, 2.0, 1).fit(), &carrier()).unwrap();
    let grown = found.estimate.covariance(0, 0).unwrap() / honest.estimate.covariance(0, 0).unwrap();
    assert!((grown / ratio - 1.0).abs() < 0.2, "{grown} {ratio}");
    assert!(disagreement_in_words("hand", ratio).contains("hand"));
}

#[test]
fn runs_that_have_nothing_to_do_with_each_other_are_refused() {
    let parameters = tree(2);
    let [with, bare] = [1, 2].map(|seed| Run::new(&parameters, &truth(32), 300, 2.0, seed));
    let tare = |run: &Run| Tare::new(run.pooled.clone()).unwrap();
    let fit = with.fit();
    let refused = |tare: &Tare, carrier: &Carrier| tare.payload(&fit, carrier).unwrap_err();
    assert!(matches!(refused(&tare(&with), &carrier()), TareError::Repeated { .. }));
    let lost = Carrier { link: "foot".into(), ..carrier() };
    assert!(matches!(refused(&tare(&bare), &lost), TareError::Link { .. }));
    let other = Run::new(&tree(3), &truth(39), 300, 2.0, 3);
    assert!(matches!(refused(&tare(&other), &carrier()), TareError::Model { .. }));
    let single = Run::new(&body(), &truth(16), 300, 2.0, 3);
    assert!(matches!(refused(&tare(&single), &carrier()), TareError::Model { .. }));
}
