//! Several recordings of one rig: its errors do not average out, of several rigs they do, and of a fixture
//! they cancel.

use nalgebra::DMatrix;
use rigident::answer::result::ParameterState;
use rigident::answer::states::states;
use rigident::application::agreement;
use rigident::fit::Fit;
use rigident::fit::RigError;
use rigident::fit::pool::PooledFactor;

#[path = "merging/runs.rs"]
mod runs;

use crate::study_length::runs as runs_of_study;
use runs::bound::{deviations, information};
use runs::{Body, Conditions, by_best, central_off, factor, factor_named, fit, larger, off, on_fixture};
use runs::{outside, predicted_off, principal_off, rms, sums_off, tared};

/// Returns the factors of four recordings of a rig, the first with five times the noise that is stated.
fn noisy_first(rig: u64, body: &Body, seed: u64) -> Vec<PooledFactor> {
    let conditions = |k: u64| if k == 0 { runs::NOISY } else { Conditions::STATED };
    (0..4).map(|k| factor(rig, body, seed + k, &conditions(k))).collect()
}

/// Nine recordings of a rig know hardly more than one, and nine rigs three times as much; if the rig's errors
/// were averaged as noise is, two of three truths would lie outside.
#[test]
fn errors_of_a_rig_do_not_average_out_and_those_of_several_do() {
    let body = Body::of_mass(3.2);
    let [mut single, mut nine, mut rigs, mut derived] = [const { Vec::new() }; 4];
    for r in 0..6 {
        let runs: Vec<PooledFactor> =
            (0..9).map(|k| factor(r, &body, 1000 * r + k, &Conditions::STATED)).collect();
        single.push(off(&runs[0].fit(), &body));
        let all = PooledFactor::merged(runs.clone(), false).unwrap();
        assert_eq!((all.rigs.len(), all.unexplained_disagreement()), (1, None));
        nine.push(off(&all.fit(), &body));
        let fit = all.fit();
        derived.extend([central_off, predicted_off, sums_off, principal_off].map(|off| off(&fit, &body)));
        let first = runs.into_iter().next().unwrap();
        let others = (1..9).map(|k| factor(100 * r + k + 5000, &body, 2000 * r + k, &Conditions::STATED));
        let all = PooledFactor::merged(std::iter::once(first).chain(others).collect(), false).unwrap();
        assert_eq!((all.rigs.len(), all.unexplained_disagreement()), (9, None));
        rigs.push(off(&all.fit(), &body));
    }
    for (name, all) in [("single", &single), ("nine", &nine), ("rigs", &rigs), ("derived", &derived)] {
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
    let [small, ..] = on_fixture();
    let mut all = Vec::new();
    for r in 0..8 {
        let own = off(&tared(r, 4000 * r), &small);
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

/// U95 is that of the best linear unbiased estimate, which the laboratory's own equations give: of one
/// recording, of four of a rig, and of four rigs.
#[test]
fn intervals_are_those_of_the_best_estimate() {
    let body = Body::of_mass(3.2);
    let (rigs, conditions) = (3, Conditions::STATED);
    let made = |rig: u64, k: u64| factor(rig, &body, 6000 + 10 * rig + k, &conditions);
    let of_motion = |rig: u64, k: u64| information(&body, 6000 + 10 * rig + k, &conditions);
    let merged = |files: Vec<PooledFactor>| off(&PooledFactor::merged(files, false).unwrap().fit(), &body);
    let [mut one, mut four, mut several] = [const { (Vec::new(), Vec::new()) }; 3];
    for rig in 0..rigs {
        one.0.push(merged(vec![made(rig, 0)]));
        one.1.push(deviations(&[vec![of_motion(rig, 0)]]));
        four.0.push(merged((0..4).map(|k| made(rig, k)).collect()));
        four.1.push(deviations(&[(0..4).map(|k| of_motion(rig, k)).collect()]));
        several.0.push(merged((0..4).map(|k| made(4 * rig + k, k)).collect()));
        several.1.push(deviations(&(0..4).map(|k| vec![of_motion(4 * rig + k, k)]).collect::<Vec<_>>()));
    }
    for (name, (own, best)) in [("one", one), ("four of one rig", four), ("four rigs", several)] {
        let ratios = by_best(&own, &best);
        assert!(ratios.iter().all(|ratio| (0.9..1.1).contains(ratio)), "{name}: {ratios:.2?}");
    }
}

/// The verdicts do not depend on where the origin is, nor on the units that parameters are counted in.
#[test]
fn estimates_depend_on_no_origin_and_no_unit() {
    let body = Body::of_mass(3.2);
    let mut seen = std::collections::BTreeSet::new();
    for (seed, conditions) in [
        (1, Conditions::STATED),
        (2, Conditions { slower: 2.0, ..Conditions::STATED }),
        (3, Conditions { errors: 4.0, ..Conditions::STATED }),
        (4, Conditions { slower: 3.0, noisier: 4.0, ..Conditions::STATED }),
        (5, Conditions { slower: 6.0, noisier: 20.0, ..Conditions::STATED }),
    ] {
        let own = factor(seed, &body, 7000 + seed, &conditions);
        let only: Vec<usize> = (0..10).collect();
        let own = PooledFactor { parameters: own.parameters[..10].to_vec(), ..own.clone() }
            .with_factor(own.factor().eliminate_others(&only));
        let verdicts = |own: &PooledFactor| -> Vec<bool> {
            let states = states(&own.fit(), None, false);
            states.iter().map(|state| matches!(state, ParameterState::Identified(_))).collect()
        };
        let here = verdicts(&own);
        seen.insert(here.clone());
        for away in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.6, 0.6, 0.5]] {
            let there = own.clone().with_factor(own.factor().substitute(&moved(away)));
            assert_eq!(verdicts(&there), here, "{seed} {away:?}");
        }
        // Grams, and metres as millimetres: the rows determine what they did.
        let scales = DMatrix::from_fn(10, 10, |i, j| match (i == j, i) {
            (false, _) => 0.0,
            (true, 0) => 1e-3,
            (true, 1..4) => 1e-6,
            (true, _) => 1e-9,
        });
        let [si, others] = [own.factor(), own.factor().substitute(&scales)].map(|f| f.solve(own.rounding));
        assert_eq!(si.determined, others.determined);
        assert!((si.condition_number / others.condition_number - 1.0).abs() < 1e-6);
    }
    assert!(seen.len() > 2, "{seen:?}");
}

/// Returns the ten parameters about S by those about an origin that is `away`, m.
fn moved(away: [f64; 3]) -> DMatrix<f64> {
    let away = nalgebra::Vector3::from(away);
    // Iₛ of a body whose first moment from there is mc: I + (2 mc·d + m d²) 1 − mc dᵀ − d mcᵀ − m d dᵀ.
    let column = |j: usize| {
        let unit = |k: usize| f64::from(u8::from(j == k));
        let (m, mc) = (unit(0), nalgebra::Vector3::new(unit(1), unit(2), unit(3)));
        let one = nalgebra::Matrix3::identity();
        let added = one * (2.0 * mc.dot(&away) + m * away.norm_squared())
            - mc * away.transpose()
            - away * mc.transpose()
            - away * away.transpose() * m;
        let first = mc + away * m;
        let elements = [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)];
        let of_tensor = (0..6).map(|k| unit(4 + k) + added[elements[k]]);
        [m, first.x, first.y, first.z].into_iter().chain(of_tensor).collect::<Vec<f64>>()
    };
    let columns: Vec<Vec<f64>> = (0..10).map(column).collect();
    DMatrix::from_fn(10, 10, |i, j| columns[j][i])
}

/// Which instruments count as one is said: of one rig, of one under two names, of two under one, of one
/// without a name, and of one of which different things are stated.
#[test]
fn merging_says_which_instruments_it_takes_for_one() {
    let body = Body::of_mass(3.2);
    let of = |rig: u64, k: u64| factor(rig, &body, 9000 + k, &Conditions::STATED);
    let named = |own: &PooledFactor, name: &str| {
        let renamed = |error: &RigError| error.instrument.replace("rig 9", name);
        let rigs = own.rigs.iter().map(|rig| rig.clone().of_instruments(renamed)).collect();
        PooledFactor { rigs, ..own.clone() }
    };
    let words = |files: [&PooledFactor; 2]| {
        let both = PooledFactor::merged(files.map(Clone::clone).to_vec(), false).unwrap();
        (both.rigs.len(), agreement(&both, false, false).unwrap().join("\n"))
    };
    let (a, b) = (of(9, 0), of(9, 1));
    let (rigs, said) = words([&a, &b]);
    assert!(
        rigs == 1 && said.contains("taken with one load cell (rig 9) and one IMU (rig 9): errors"),
        "{said}"
    );
    let (rigs, said) = words([&a, &named(&b, "rig 90")]);
    assert!(rigs == 2 && said.contains("2 load cells (rig 9, rig 90) and 2 IMUs (rig 9, rig 90)"), "{said}");
    assert!(said.contains("those of different ones are independent"), "{said}");
    // A rig of its own, under the other's name: nothing in two recordings shows it.
    let (rigs, said) = words([&a, &factor_named(11, "rig 9", &body, 9002, &Conditions::STATED)]);
    assert!(rigs == 1 && said.contains("one load cell (rig 9)"), "{said}");
    let (rigs, said) = words([&named(&a, "#0a"), &named(&b, "#0a")]);
    assert!(rigs == 1 && said.contains("taken with one load cell and one IMU: errors"), "{said}");
    assert!(said.contains("no serial number names the IMU and load cell"), "{said}");
    let larger = factor(9, &body, 9001, &Conditions { errors: 2.0, ..Conditions::STATED });
    let (rigs, said) = words([&a, &larger]);
    assert!(rigs == 1 && said.contains("runs of one rig state different standard deviations of"), "{said}");
}

/// A thousand recordings of a rig, at night ten thousand: one factor no larger than that of a hundred, in any
/// grouping.
#[test]
fn a_thousand_recordings_of_a_rig_take_no_more_than_a_hundred() {
    let body = Body::of_mass(3.2);
    let made: Vec<PooledFactor> = (0..4).map(|k| factor(3, &body, 8000 + k, &Conditions::STATED)).collect();
    let count = runs_of_study(10_000, 1_000);
    let all: Vec<PooledFactor> = (0..count)
        .map(|k| {
            let mut own = made[k as usize % made.len()].clone();
            let source = &mut own.sources[0];
            source.fingerprint = k.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            source.readings = (0..8).map(|i| 8 * k + i).collect();
            own
        })
        .collect();
    let merged = |files: &[PooledFactor]| PooledFactor::merged(files.to_vec(), false).unwrap();
    let started = std::time::Instant::now();
    let whole = merged(&all);
    println!("{count} in {:.1} s, {} bytes", started.elapsed().as_secs_f64(), whole.to_bytes().len());
    let groups: Vec<PooledFactor> = all.chunks(all.len() / 8).map(merged).collect();
    let grouped = PooledFactor::from_bytes(&merged(&groups).to_bytes(), "all").unwrap();
    assert_eq!((whole.runs(), grouped.runs(), whole.rigs.len()), (count, count, 1));
    let hundred = merged(&all[..100]).to_bytes().len();
    let largest = whole.to_bytes().len().max(grouped.to_bytes().len());
    assert!(largest < hundred + 100 && largest < 20_000, "{hundred} {largest}");
    let [one, many, other] = [&made[0], &whole, &grouped].map(PooledFactor::fit);
    for j in 0..10 {
        let [single, a, b] = [&one, &many, &other].map(|fit| fit.estimate.measured(j).unwrap());
        assert!((a.value - b.value).abs() < 1e-9 * a.u95 && (a.u95 / b.u95 - 1.0).abs() < 1e-9, "{j}");
        assert!(a.u95 > 0.3 * single.u95, "{j}: the rig's errors do not average out");
    }
}
