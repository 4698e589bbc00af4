use std::collections::BTreeMap;

use super::*;
use crate::examples::{Run, body, truth};
use crate::study_length::runs;

fn factors(count: u64) -> Vec<PooledFactor> {
    let parameters = body();
    let phi = truth(parameters.len());
    let labels = |seed: u64| {
        let all = [("body".to_owned(), format!("b{}", seed % 3)), ("rig".to_owned(), "r".to_owned())];
        // Every fourth has no rig.
        BTreeMap::from_iter(all.into_iter().take(if seed.is_multiple_of(4) { 1 } else { 2 }))
    };
    (0..count).map(|seed| Run::new(&parameters, &phi, 60, 3.0, seed).pooled.labelled(&labels(seed))).collect()
}

fn read_all(path: &Path) -> Result<Vec<PooledFactor>, PoolError> {
    let parts: Result<Vec<_>, _> = parts(path)?.iter().map(Part::read).collect();
    Ok(parts?.into_iter().flatten().collect())
}

#[test]
fn a_table_is_read_as_it_was_written() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("runs.parquet");
    let all = factors(150);
    std::fs::write(&path, to_bytes(&all, "runs").unwrap()).unwrap();
    assert_eq!(parts(&path).unwrap().len(), 3);
    let read = read_all(&path).unwrap();
    assert_eq!(read.len(), 150);
    for (k, (read, written)) in read.iter().zip(&all).enumerate() {
        assert!(read.name.ends_with(&format!("row {} (run {k})", k + 1)), "{}", read.name);
        assert_eq!(read, &PooledFactor { name: read.name.clone(), ..written.clone() });
    }
    let labels = |read: &PooledFactor| read.sources[0].labels.clone();
    assert!(read.iter().zip(&all).all(|(read, written)| labels(read) == labels(written)));
}

#[test]
fn damaged_tables_are_refused_without_a_panic() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("runs.parquet");
    let all = factors(2);
    let bytes = to_bytes(&all, "runs").unwrap();
    let mut as_written = 0;
    let mut positions = 0;
    for position in (0..bytes.len()).step_by(runs(1, 13) as usize) {
        positions += 1;
        let mut damaged = bytes.clone();
        damaged[position] ^= 0x41;
        std::fs::write(&path, &damaged).unwrap();
        // What is beside the factors (statistics, the name) has no check sum; factors have.
        if let Ok(read) = read_all(&path) {
            as_written += 1;
            assert!(read.iter().all(|f| all.iter().any(|g| f.rigs == g.rigs)), "byte {position}");
        }
        std::fs::write(&path, &bytes[..position]).unwrap();
        assert!(read_all(&path).is_err(), "cut at {position}");
    }
    assert!(as_written < positions / 2, "{as_written} of {positions}");
}
