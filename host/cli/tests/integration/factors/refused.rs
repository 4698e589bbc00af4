use std::fs;
use std::path::Path;

use super::simulated::{body, noise, rigident, said, status, write};
use rigident::fit::Factor;
use rigident::fit::pool::PooledFactor;

/// Writes a factor that is changed as a hand could, check sum and all.
fn write_changed(from: &Path, to: &Path, change: impl FnOnce(&mut PooledFactor)) {
    let mut pooled = PooledFactor::read(from).unwrap();
    change(&mut pooled);
    fs::write(to, pooled.to_bytes()).unwrap();
}

/// Commands, and words of what each says of its bad input.
const REFUSED: &[(&[&str], &[&str])] = &[
    (&["merge", "a.factor", "none.factor", "-o", "x"], &["none.factor"]),
    (&["merge", "a.factor", "text.factor", "-o", "x"], &["text.factor", "not a factor"]),
    (&["merge", "a.factor", "b.csv", "-o", "x"], &["b.csv", "rigident factor b.csv"]),
    (&["merge", "a.factor", "truncated.factor", "-o", "x"], &["truncated.factor", "cut off"]),
    (&["merge", "a.factor", "old.factor", "-o", "x"], &["old.factor", "version 1", "rigident factor"]),
    (&["merge", "b.factor", "pounds.factor", "-o", "x"], &["pounds.factor", "another model", "unit"]),
    (&["merge", "b.factor", "renamed.factor", "-o", "x"], &["renamed.factor", "mz"]),
    (&["merge", "b.factor", "geometry.factor", "-o", "x"], &["geometry.factor", "another model"]),
    (&["merge", "b.factor", "rows.factor", "-o", "x"], &["rows.factor", "empty"]),
    (&["merge", "b.factor", "empty.factor", "-o", "x"], &["empty.factor", "empty"]),
    (&["merge", "b.factor", "weights.factor", "-o", "x"], &["weights.factor", "header"]),
    (
        &["merge", "a.factor", "known.factor", "--shared-offset", "-o", "x"],
        &["known.factor", "it lacks offset_fx"],
    ),
    (&["merge", "a.factor", "noisier.factor", "-o", "x"], &["a.factor", "noisier.factor", "twice", "halve"]),
    (&["merge", "--from", "none.txt", "-o", "x"], &["--from none.txt", "cannot be read"]),
    (&["merge", "--from", "blank.txt", "-o", "x"], &["blank.txt", "no path"]),
    (&["merge", "a.factor", "b.factor", "-o", "b.factor"], &["b.factor is there already"]),
    (&["merge", "a.factor", "b.factor", "-o", "no/x"], &["no/x"]),
    (&["merge", "-o", "x"], &["<F>"]),
    (&["factor", "a.csv", "again.csv", "-o", "x"], &["again.csv", "twice"]),
    (&["factor", "a.csv", "-o", "a.factor"], &["a.factor is there already"]),
    (
        &["factor", "a.factor", "-o", "x"],
        &["a.factor", ".csv, .mcap, .db3, .bag, .parquet, .mat, .tdms or .xlsx"],
    ),
    (&["factor", "zero.csv", "-o", "x"], &["load_cell.noise_n_nm", "greater than zero"]),
    (&["factor", "nan.csv", "-o", "x"], &["nan.csv", "line 31", "NaN"]),
    (&["factor", "a.csv", "short.csv", "-o", "x"], &["short.csv", "no usable rows"]),
    (&["solve", "empty.factor"], &["empty.factor", "empty"]),
    (&["solve", "a.csv"], &["a.csv", "rigident factor"]),
    (&["solve", "a.factor", "--estimate", "colour"], &["colour"]),
    (&["solve", "b.factor", "--tare", "pounds.factor"], &["pounds.factor", "another model"]),
    (&["solve", "a.factor", "--tare", "copy.factor"], &["copy.factor", "twice"]),
    (&["solve", "a.factor", "--tare", "a.csv"], &["a.csv", "twice"]),
    (&["solve", "a.factor", "--rig", "none.toml"], &["none.toml"]),
    (&["identify", "a.csv", "--tare", "empty.factor"], &["empty.factor", "empty"]),
    (&["identify", "a.csv", "--tare", "again.csv"], &["again.csv", "twice"]),
    (&["identify", "a.csv", "--tare", "zero.csv"], &["load_cell.noise_n_nm"]),
    (&["replay", "a.csv", "--tare", "truncated.factor"], &["truncated.factor", "cut off"]),
];

#[test]
fn bad_input_is_named_and_nothing_is_written() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    write_good(at);
    write_spoilt_factors(at);
    write_changed_factors(at);
    write_spoilt_recordings(at);
    let before = listing(at);
    for (arguments, words) in REFUSED.iter().copied() {
        let output = rigident(at, arguments);
        assert_eq!(status(&output), 2, "{arguments:?}: {}", said(&output));
        for words in words {
            assert!(said(&output).contains(words), "{arguments:?} lacks {words}: {}", said(&output));
        }
        assert!(output.stdout.is_empty(), "{arguments:?}");
        assert_eq!(listing(at), before, "{arguments:?}");
    }
    merge_good(at);
}

/// Writes recordings and their factors, one of them with a known offset, and one recording without noise.
fn write_good(at: &Path) {
    write(at, "a", body(), 1, &noise());
    write(at, "b", body(), 2, &noise());
    write(at, "known", body(), 3, &format!("{}\noffset_n_nm = \"zero\"", noise()));
    write(at, "zero", body(), 4, "noise_n_nm = [1, 1, 1, 1, 1, 0]");
    for name in ["a", "b", "known"] {
        let output = rigident(at, &["factor", &format!("{name}.csv"), "-o", &format!("{name}.factor")]);
        assert_eq!(status(&output), 0, "{}", said(&output));
    }
}

/// Writes factors whose bytes are not those of a factor.
fn write_spoilt_factors(at: &Path) {
    let good = fs::read(at.join("a.factor")).unwrap();
    fs::write(at.join("truncated.factor"), &good[..good.len() - 100]).unwrap();
    fs::write(at.join("text.factor"), "a factor, they said\n").unwrap();
    let mut old = good.clone();
    old[8] = 1;
    let body_end = old.len() - 4;
    let sum = crc(&old[8..body_end]);
    old[body_end..].copy_from_slice(&sum.to_le_bytes());
    fs::write(at.join("old.factor"), old).unwrap();
}

/// Writes factors that say something else than the recording did, and a copy.
fn write_changed_factors(at: &Path) {
    let change = |name: &str, change: &dyn Fn(&mut PooledFactor)| {
        write_changed(&at.join("a.factor"), &at.join(name), change);
    };
    change("pounds.factor", &|f| f.parameters[0].unit = "lb".into());
    change("renamed.factor", &|f| f.parameters[3].name = "mz".into());
    change("geometry.factor", &|f| f.model_fingerprint = 1);
    change("rows.factor", &|f| f.sources[0].rows = 0);
    change("weights.factor", &|f| f.sources[0].channels[0].sigma = 0.0);
    change("noisier.factor", &|f| f.sources[0].channels[0].sigma *= 2.0);
    change("empty.factor", &|f| {
        *f = f.clone().with_factor(Factor::new(16));
        f.sources.clear();
    });
    fs::copy(at.join("a.factor"), at.join("copy.factor")).unwrap();
}

/// Writes a recording again, one with a cell that is no number, a short one, and a list of nothing.
fn write_spoilt_recordings(at: &Path) {
    let text = fs::read_to_string(at.join("a.csv")).unwrap();
    fs::copy(at.join("a.csv"), at.join("again.csv")).unwrap();
    fs::copy(at.join("a.rig.toml"), at.join("again.rig.toml")).unwrap();
    let mut rows: Vec<&str> = text.lines().collect();
    let broken = format!("{},NaN", rows[30].rsplit_once(',').unwrap().0);
    rows[30] = &broken;
    fs::write(at.join("nan.csv"), rows.join("\n")).unwrap();
    fs::copy(at.join("a.rig.toml"), at.join("nan.rig.toml")).unwrap();
    fs::write(at.join("short.csv"), text.lines().take(5).collect::<Vec<_>>().join("\n")).unwrap();
    fs::copy(at.join("a.rig.toml"), at.join("short.rig.toml")).unwrap();
    fs::write(at.join("blank.txt"), "\n \n").unwrap();
}

/// Merges what can be merged, beside what is refused.
fn merge_good(at: &Path) {
    // A part of the work that is done again changes nothing.
    fs::write(at.join("list.txt"), "b.factor\ncopy.factor\n\nb.factor\n").unwrap();
    let output = rigident(at, &["merge", "a.factor", "--from", "list.txt", "-o", "again.factor"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    assert!(said(&output).contains("2 of 4 factors are left out"), "{}", said(&output));
    let output = rigident(at, &["merge", "a.factor", "b.factor", "-o", "once.factor"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    assert_eq!(fs::read(at.join("again.factor")).unwrap(), fs::read(at.join("once.factor")).unwrap());
    // Of many, too, a recording is distinguished from a factor.
    fs::write(at.join("many.txt"), format!("{}b.csv\n", "a.factor\n".repeat(60))).unwrap();
    let output = rigident(at, &["merge", "--from", "many.txt", "-o", "many.factor"]);
    assert_eq!(status(&output), 2);
    assert!(said(&output).contains("rigident factor b.csv"), "{}", said(&output));
    // Ten and sixteen merge where the offsets are eliminated.
    let output = rigident(at, &["merge", "a.factor", "known.factor", "-o", "x"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
}

fn listing(folder: &Path) -> Vec<(String, u64)> {
    let mut names: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap())
        .map(|e| (e.file_name().to_string_lossy().into_owned(), e.metadata().unwrap().len()))
        .collect();
    names.sort();
    names
}

/// CRC-32 bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| (c >> 1) ^ (0xEDB8_8320 & (c & 1).wrapping_neg()))
    })
}
