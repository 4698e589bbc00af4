//! Several recordings of one rig: its errors do not average out, of several rigs they do, and of a fixture
//! they cancel.

use rigident::fit::Fit;
use rigident::fit::pool::PooledFactor;

#[path = "merging/runs.rs"]
mod runs;

use runs::{Body, Conditions, factor, fit, larger, noisy_first, off, outside, rms, tared};

/// Nine recordings of a rig know hardly more than one, and nine rigs three times as much; if the rig's errors
/// were averaged as noise is, two of three truths would lie outside.
#[test]
fn errors_of_a_rig_do_not_average_out_and_those_of_several_do() {
    let body = Body::of_mass(3.2);
    let [mut single, mut nine, mut rigs] = [const { Vec::new() }; 3];
    for r in 0..6 {
        let runs: Vec<PooledFactor> =
            (0..9).map(|k| factor(r, &body, 1000 * r + k, &Conditions::STATED)).collect();
        single.push(off(&runs[0].fit(), &body));
        let all = PooledFactor::merged(runs.clone(), false).unwrap();
        assert_eq!((all.rigs.len(), all.unexplained_disagreement()), (1, None));
        nine.push(off(&all.fit(), &body));
        let first = runs.into_iter().next().unwrap();
        let others = (1..9).map(|k| factor(100 * r + k + 5000, &body, 2000 * r + k, &Conditions::STATED));
        let all = PooledFactor::merged(std::iter::once(first).chain(others).collect(), false).unwrap();
        assert_eq!((all.rigs.len(), all.unexplained_disagreement()), (9, None));
        rigs.push(off(&all.fit(), &body));
    }
    for (name, all) in [("single", &single), ("nine", &nine), ("rigs", &rigs)] {
        assert!((0.7..1.3).contains(&rms(all)) && outside(all) < 0.15, "{name}: {}", rms(all));
    }
    let (of_nine, of_rigs) = (larger(&nine, &single), larger(&rigs, &single));
    assert!((0.7..1.0).contains(&of_nine), "{of_nine}");
    assert!((of_rigs - 1.0 / 3.0).abs() < 0.04, "{of_rigs}");
}

/// A recording with five times its noise counts by what it shows, and takes nothing from the others.
#[test]
fn a_noisy_recording_widens_itself_alone() {
    let body = Body::of_mass(3.2);
    let [mut merged, mut quiet] = [const { Vec::new() }; 2];
    for r in 0..4 {
        let mut runs = noisy_first(r, &body, 3000 * r);
        assert!(runs[0].sources[0].variance_scale > 15.0);
        merged.push(off(&PooledFactor::merged(runs.clone(), false).unwrap().fit(), &body));
        runs.remove(0);
        quiet.push(off(&PooledFactor::merged(runs, false).unwrap().fit(), &body));
    }
    assert!(rms(&merged) < 1.4 && outside(&merged) < 0.15, "{}", rms(&merged));
    let wider = larger(&merged, &quiet);
    assert!((0.9..1.0).contains(&wider), "{wider}");
}

/// The gain of a load cell multiplies fixture and body alike: of a fixture of ten times the body its own
/// share is left.
#[test]
fn errors_of_a_rig_cancel_where_a_fixture_is_taken_off() {
    let mut all = Vec::new();
    for r in 0..8 {
        let own = tared(r, 4000 * r);
        // As if each had a load cell of its own: some 0.5 % of 10 kg.
        assert!(own[0].1 < 0.01, "{}", own[0].1);
        all.push(own);
    }
    assert!((0.7..1.4).contains(&rms(&all)) && outside(&all) < 0.15, "{}", rms(&all));
}

/// One recording says the same by itself and by its factor, whatever its noise is; two the same in any
/// grouping.
#[test]
fn one_answer_whatever_way_it_is_asked() {
    let body = Body::of_mass(3.2);
    let same = |a: &Fit, b: &Fit| {
        for j in 0..10 {
            let [x, y] = [a, b].map(|fit| fit.estimate.measured(j).unwrap());
            assert!((x.value - y.value).abs() < 1e-9 * x.u95, "{j}: {} {}", x.value, y.value);
            assert!((x.u95 / y.u95 - 1.0).abs() < 1e-9, "{j}: {} {}", x.u95, y.u95);
        }
    };
    for noisier in [1.0, 4.0] {
        let alone = fit(1, &body, 7, &Conditions { noisier, ..Conditions::STATED });
        let read = PooledFactor::from_bytes(&PooledFactor::of(&alone, "a").to_bytes(), "a").unwrap();
        same(&alone, &read.fit());
    }
    let files: Vec<PooledFactor> =
        (0..3).map(|k| factor(k % 2, &body, 70 + k, &Conditions::STATED)).collect();
    let all = PooledFactor::merged(files.clone(), false).unwrap();
    let pair = PooledFactor::merged(files[1..].to_vec(), false).unwrap();
    let grouped = PooledFactor::merged(vec![pair, files[0].clone()], false).unwrap();
    same(&all.fit(), &grouped.fit());
}
