use std::path::PathBuf;

use super::*;
use crate::examples::{Run as Example, body, tree, truth};

/// Factors of runs of one model.
fn factors(count: u64) -> Vec<PooledFactor> {
    let parameters = body();
    let phi = truth(parameters.len());
    (0..count).map(|seed| Example::new(&parameters, &phi, 180, 3.0, seed).pooled).collect()
}

/// Returns the largest difference of two triangles, relative to the largest entry.
fn apart(a: &PooledFactor, b: &PooledFactor) -> f64 {
    let (a, b) = (a.factor().r(), b.factor().r());
    // A triangle is unique but for the signs of its rows.
    let (a, b) = (a.transpose() * &a, b.transpose() * &b);
    (&a - &b).amax() / a.amax()
}

/// In chunks of any size, each part done again, in any order, and each run counts once.
#[test]
fn parts_that_are_done_again_change_nothing() {
    let runs = factors(12);
    let serial = PooledFactor::merged(runs.clone(), false).unwrap();
    for size in [1, 2, 5] {
        let parts: Vec<PooledFactor> =
            runs.chunks(size).map(|part| PooledFactor::merged(part.to_vec(), false).unwrap()).collect();
        let again: Vec<PooledFactor> = parts.iter().rev().chain(&parts).chain(&runs[3..7]).cloned().collect();
        let left_out = again.len() - parts.len();
        let all = union(again, false).unwrap();
        assert_eq!(all.repeated, left_out);
        assert_eq!((all.factor.sources.len(), all.factor.rows()), (12, serial.rows()));
        assert_eq!((all.factor.comparisons, all.factor.eliminated), (serial.comparisons, serial.eliminated));
        assert!((all.factor.disagreement / serial.disagreement - 1.0).abs() < 1e-9);
        assert!(apart(&all.factor, &serial) < 1e-13, "{}", apart(&all.factor, &serial));
    }
}

#[test]
fn one_run_twice_is_that_run_with_its_offsets() {
    let run = factors(1).remove(0);
    let both = union(vec![run.clone(), run.clone()], false).unwrap();
    assert_eq!((&both.factor, both.repeated), (&run, 1));
}

#[test]
fn inseparable_runs_are_refused() {
    let runs = factors(3);
    let pair = |a: usize, b: usize| PooledFactor {
        name: format!("{a}{b}"),
        ..PooledFactor::merged(vec![runs[a].clone(), runs[b].clone()], false).unwrap()
    };
    let refused = |all: Vec<PooledFactor>| match union(all, false).unwrap_err() {
        PoolError::Repeated { recording, first, second } => (recording, first, second),
        other => panic!("{other}"),
    };
    let name = |run: &PooledFactor| run.sources[0].recording.clone();
    assert_eq!(refused(vec![pair(0, 1), pair(1, 2)]), (name(&runs[1]), "01".to_owned(), "12".to_owned()));
    // The same readings, made otherwise: with another noise, of another model.
    let mut noisier = runs[0].clone();
    noisier.sources[0].channels[0].sigma *= 2.0;
    assert_eq!(refused(vec![runs[0].clone(), noisier]).0, name(&runs[0]));
    let mut of_a_tree = Example::new(&tree(1), &truth(25), 180, 3.0, 0).pooled;
    of_a_tree.model_fingerprint = 7;
    assert_eq!(refused(vec![runs[0].clone(), of_a_tree]).0, name(&runs[0]));
}

#[test]
fn files_are_merged_as_factors_are() {
    let place = tempfile::tempdir().unwrap();
    let runs = factors(150);
    let mut files: Vec<PathBuf> = Vec::new();
    for (k, run) in runs.iter().enumerate() {
        files.push(place.path().join(format!("{k}.factor")));
        run.write(&files[k]).unwrap();
    }
    files.push(files[4].clone());
    let progress = std::sync::Mutex::new((0, 0));
    let all = union_of_files(&files, false, &|k, n| {
        let mut progress = progress.lock().unwrap();
        *progress = (progress.0.max(k), n);
    })
    .unwrap();
    // The one that is left out is not read again.
    assert_eq!(*progress.lock().unwrap(), (301, 302));
    let serial = PooledFactor::merged(runs, false).unwrap();
    assert_eq!((all.repeated, all.factor.runs()), (1, 150));
    assert!(apart(&all.factor, &serial) < 1e-13);
    // Half-written.
    let bytes = std::fs::read(&files[7]).unwrap();
    std::fs::write(&files[7], &bytes[..bytes.len() / 2]).unwrap();
    let error = union_of_files(&files, false, &|_, _| ()).unwrap_err().to_string();
    assert!(error.contains("7.factor") && error.contains("damaged or cut off"), "{error}");
}

#[test]
fn tables_are_merged_as_files_are() {
    let place = tempfile::tempdir().unwrap();
    let runs = factors(150);
    let table = place.path().join("all.parquet");
    std::fs::write(&table, crate::factor_table::to_bytes(&runs, "all").unwrap()).unwrap();
    let single = place.path().join("7.factor");
    runs[7].write(&single).unwrap();
    let all = union_of_files(&[table.clone(), single], false, &|_, _| ()).unwrap();
    let serial = PooledFactor::merged(runs.clone(), false).unwrap();
    assert_eq!((all.repeated, all.factor.runs()), (1, 150));
    assert!(apart(&all.factor, &serial) < 1e-13);
    // Some rows of a part.
    let part = parts(&table).unwrap().remove(1).only(vec![0, 3]);
    let two = union_of_parts(&[part], false, &|_, _| ()).unwrap().factor;
    let serial = PooledFactor::merged(vec![runs[64].clone(), runs[67].clone()], false).unwrap();
    assert_eq!(two.rigs, serial.rigs);
}
