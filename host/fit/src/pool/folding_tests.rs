use crate::examples::{Run, body, truth};
use crate::factor_file::FactorFileError;
use crate::pool::{PoolError, PooledFactor};
use crate::{Checks, Fit};

/// Runs with noise of their own, every seventh with more than is stated.
fn factors(count: u64) -> Vec<PooledFactor> {
    let parameters = body();
    let own = |seed: u64| {
        let mut run = Run::new(&parameters, &truth(parameters.len()), 40, 3.0, seed).pooled;
        if let Some(source) = run.sources.first_mut() {
            source.fitted = Some(16.0);
            source.fingerprint = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            if seed.is_multiple_of(7) {
                source.variance_scale = 1.5;
            }
        }
        run.checked(&Checks::default()).labelled(&[("body".to_owned(), "a".to_owned())].into())
    };
    (0..count).map(own).collect()
}

fn stored(factor: &PooledFactor) -> PooledFactor {
    PooledFactor::from_bytes(&factor.to_bytes(), &factor.name).unwrap()
}

fn same(a: &Fit, b: &Fit) {
    assert_eq!(a.estimate.noise, b.estimate.noise);
    for j in 0..10 {
        let [x, y] = [a, b].map(|fit| fit.estimate.measured(j).unwrap());
        assert!((x.value - y.value).abs() < 1e-9 * x.u95 && (x.u95 / y.u95 - 1.0).abs() < 1e-9, "{j}");
    }
}

/// All at once, and in groups that are written, read and merged again: one answer, one size, one set of runs.
#[test]
fn runs_that_are_no_longer_distinguished_are_counted_in_any_grouping() {
    let all = factors(600);
    let whole = PooledFactor::merged(all.clone(), false).unwrap();
    let groups: Vec<PooledFactor> =
        all.chunks(150).map(|group| stored(&PooledFactor::merged(group.to_vec(), false).unwrap())).collect();
    let again = stored(&PooledFactor::merged(groups, false).unwrap());
    assert_eq!((whole.runs(), again.runs()), (600, 600));
    assert!(whole.to_bytes().len() < 8_000 && again.to_bytes().len() < 12_000);
    same(&whole.fit(), &again.fit());
    let words: Vec<String> = whole.sources.iter().map(super::FactorSource::in_words).collect();
    assert!(words[0].starts_with("run 0, run 7, ") && words[0].ends_with(" more"), "{words:?}");
    assert!(whole.sources.iter().all(|own| own.labels.contains_key("body")));
    // Sixty-four are still named, one by one.
    let few = PooledFactor::merged(all[..64].to_vec(), false).unwrap();
    assert!(few.sources.len() == 64 && few.sources.iter().all(|own| own.folded.is_none()));
}

/// A good part of the runs is in both: that is seen by the sample of their fingerprints.
#[test]
fn factors_that_hold_the_same_runs_are_refused() {
    let all = factors(400);
    let merged = |range: std::ops::Range<usize>| PooledFactor::merged(all[range].to_vec(), false).unwrap();
    let both = |a: &PooledFactor, b: &PooledFactor| PooledFactor::merged(vec![a.clone(), b.clone()], false);
    let (first, second, across) = (merged(0..200), merged(200..400), merged(150..350));
    assert_eq!(both(&first, &second).unwrap().runs(), 400);
    for (a, b) in [(&first, &first), (&first, &across), (&across, &second)] {
        assert!(matches!(both(a, b), Err(PoolError::Repeated { .. })));
    }
}

/// Runs with readings in common are named in whatever grouping; where all have some the list is short.
#[test]
fn runs_with_readings_in_common_are_named() {
    let mut all = factors(100);
    for (first, own) in (0_u64..).step_by(8).zip(&mut all) {
        own.sources[0].readings = (first..first + 8).collect();
    }
    let merged = |all: &[PooledFactor]| PooledFactor::merged(all.to_vec(), false).unwrap();
    assert!(merged(&all).overlapping.is_empty());
    all[70].sources[0].readings = vec![16, 17, 5_000];
    all[71].sources[0].readings = vec![24, 5_001, 5_002];
    assert_eq!(merged(&all).overlapping, ["run 2 and run 70"]);
    let groups: Vec<PooledFactor> = all.chunks(50).map(|group| stored(&merged(group))).collect();
    assert_eq!(stored(&merged(&groups)).overlapping, ["run 2 and run 70"]);
    all.iter_mut().for_each(|own| own.sources[0].readings = vec![1, 2]);
    assert_eq!(merged(&all).overlapping.len(), super::OVERLAPS);
}

#[test]
fn impossible_counts_of_runs_are_refused() {
    let good = PooledFactor::merged(factors(100), false).unwrap();
    let bad = |change: &dyn Fn(&mut super::Folded)| {
        let mut own = good.clone();
        own.sources.iter_mut().filter_map(|own| own.folded.as_mut()).for_each(change);
        PooledFactor::from_bytes(&own.to_bytes(), "a")
    };
    assert!(bad(&|_| ()).is_ok());
    let changes: [&dyn Fn(&mut super::Folded); 5] = [
        &|own| own.names = vec!["\u{1b}[2J".to_owned()],
        &|own| own.runs = 1,
        &|own| own.sample.clear(),
        &|own| own.sample.reverse(),
        &|own| own.freedom = Some(f64::NAN),
    ];
    for change in changes {
        let Err(PoolError::File { error, .. }) = bad(change) else { panic!() };
        assert!(matches!(error, FactorFileError::Header(_)), "{error}");
    }
}
