use nalgebra::{DMatrix, DVector};

use super::*;
use crate::examples::{Run, body, dense, tree, truth};
use crate::pool::PooledFactor;
use crate::{Basis, Effect, Nuisance, NuisanceFit, Scope};

const SEVEN: [usize; 7] = [0, 1, 2, 6, 7, 8, 9];

fn carrier() -> Carrier {
    Carrier { link: "link1".into(), to_link: DMatrix::identity(10, 10), frame: "hand".into() }
}

/// Weights of link1's m, mcx, mcy, Ixx less Iyy, Izz, Iyz, Izx, Ixy in the inertial parameters: what the tree can tell.
fn weights_of_eight(parameters: &[Parameter]) -> DMatrix<f64> {
    let names = ["m", "mcx", "mcy", "Ixx", "Izz", "Iyz", "Izx", "Ixy"].map(|n| format!("link1.{n}"));
    let all: Vec<&Parameter> = parameters.iter().filter(|p| p.kind.is_inertial()).collect();
    DMatrix::from_fn(all.len(), 8, |i, k| {
        all[i].made_of.iter().filter(|(name, _)| *name == names[k]).map(|(_, w)| *w).sum()
    })
}

/// Runs with and without 0.7 kg on link1, whose errors a and b bring something to every parameter.
fn runs(shared: bool) -> (Fit, Fit, PooledFactor, [DMatrix<f64>; 2], [Run; 2]) {
    let parameters = tree(2);
    let n = parameters.len();
    let k = weights_of_eight(&parameters);
    let payload = DVector::from_vec(vec![0.7, 0.05, -0.02, 0.01, 0.006, 1e-3, -2e-3, 5e-4]);
    let mut phi = truth(n);
    let bare = Run::new(&parameters, &phi, 300, 2.0, 2);
    (&k * payload).iter().enumerate().for_each(|(i, v)| phi[i] += v);
    let with = Run::new(&parameters, &phi, 240, 2.0, 1);
    let inertial = k.nrows();
    let brought = |run: &Run, factor: f64| {
        let (_, covariance, _) = dense(&run.a, &run.y);
        let lower = covariance.cholesky().unwrap().l();
        // A part of what the covariance has: Σ − C Cᵀ stays positive.
        lower * DMatrix::from_fn(n, 2, |i, j| factor * ((3 * i + 5 * j) as f64).sin() / (n as f64).sqrt())
    };
    let c = [brought(&with, 0.9), brought(&bare, 0.8)];
    let fit = |run: &Run, c: &DMatrix<f64>, names: [&str; 2]| {
        let mut fit = run.fit();
        fit.nuisances = (0..2)
            .map(|k| NuisanceFit {
                nuisance: Nuisance {
                    name: names[k].to_owned(),
                    group: "effort gain".to_owned(),
                    unit: String::new(),
                    sigma: 0.02,
                    basis: Basis::Class("usual".to_owned()),
                    scope: Scope::Rig,
                    effect: Effect::Gain { channel: k },
                },
                expected: 0.0,
                value: 0.0,
                sd: 0.02,
                drawn: 0.0,
                contributions: c.column(k).iter().copied().collect(),
            })
            .collect();
        fit
    };
    let other = if shared { ["a", "b"] } else { ["c", "d"] };
    let fits = (fit(&with, &c[0], ["a", "b"]), fit(&bare, &c[1], other));
    let c = c.map(|c| c.rows(0, inertial).into_owned());
    (fits.0, fits.1, bare.pooled.clone(), c, [with, bare])
}

/// Oracle: generalised least squares of the difference of two dense estimates, errors that both share correlating them.
#[test]
fn a_payload_is_what_the_difference_of_both_runs_says() {
    for shared in [true, false] {
        let (with, without, pooled, c, raw) = runs(shared);
        let tare = Tare::of_run(&without, pooled).unwrap();
        let found = tare.payload(&with, &carrier()).unwrap();
        let k = weights_of_eight(&with.parameters);
        let inertial = k.nrows();
        let [a, b] = [&raw[0], &raw[1]].map(|run| {
            let (estimate, covariance, _) = dense(&run.a, &run.y);
            (
                estimate.rows(0, inertial).into_owned(),
                covariance.view((0, 0), (inertial, inertial)).into_owned(),
            )
        });
        let cross = &c[0] * c[1].transpose() * f64::from(u8::from(shared));
        let s = (a.1 + b.1 - &cross - cross.transpose()).cholesky().unwrap().inverse();
        let covariance = (k.transpose() * &s * &k).cholesky().unwrap().inverse();
        let expected = &covariance * k.transpose() * s * (a.0 - b.0);
        for (j, place) in [0, 1, 2, 4, 5, 6, 7].into_iter().zip(SEVEN) {
            let sd = covariance[(j, j)].sqrt();
            let m = found.estimate.measured(place).unwrap();
            assert!(
                (m.value - expected[j]).abs() < 1e-6 * sd,
                "{shared} {place}: {} {}",
                m.value,
                expected[j]
            );
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
fn what_both_runs_share_cancels() {
    let sd = |shared: bool| {
        let (with, without, pooled, ..) = runs(shared);
        let found = Tare::of_run(&without, pooled).unwrap().payload(&with, &carrier()).unwrap();
        SEVEN.map(|j| found.estimate.covariance(j, j).unwrap().sqrt())
    };
    let (own, apart) = (sd(true), sd(false));
    assert!(own.iter().sum::<f64>() < apart.iter().sum::<f64>(), "{own:?} {apart:?}");
}

/// What is left of two runs of the same arm is noise; what a body on the link does not explain is told.
#[test]
fn runs_that_differ_by_more_than_a_payload_are_told_and_widened() {
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
