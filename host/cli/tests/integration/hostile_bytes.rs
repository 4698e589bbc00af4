//! The fuzzer's checks of the host's decoders, on the committed corpus and on what chance makes of it.
//!
//! The fuzzer itself, which searches for new paths, runs for long at night: `cargo xtask fuzz`.

use std::path::Path;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

#[path = "../../../../fuzz/src/host_decoders.rs"]
mod host_decoders;

/// Damaged inputs for each decoder.
const INPUTS: usize = 3000;

/// Runs a check on each file of its corpus and on damaged copies.
fn survives(name: &str, check: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(name);
    let mut files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let corpus: Vec<Vec<u8>> = files.iter().map(|file| std::fs::read(file).unwrap()).collect();
    assert!(!corpus.is_empty(), "{} is empty", folder.display());
    corpus.iter().for_each(|bytes| check(bytes));
    let mut rng = ChaCha8Rng::seed_from_u64(name.bytes().map(u64::from).sum());
    for _ in 0..INPUTS {
        check(&damaged(&corpus, &mut rng));
    }
}

/// Returns an input of the corpus with up to four faults: a bit, a byte, a piece lost, repeated or of another
/// input, an end cut off.
fn damaged(corpus: &[Vec<u8>], rng: &mut ChaCha8Rng) -> Vec<u8> {
    /// Bytes of a piece, at most.
    const PIECE: usize = 40;
    let mut below = |n: usize| (rng.next_u32() as usize) % n.max(1);
    let mut bytes = corpus[below(corpus.len())].clone();
    for _ in 0..=below(4) {
        let at = below(bytes.len());
        let end = (at + 1 + below(PIECE)).min(bytes.len());
        match below(6) {
            _ if bytes.is_empty() => bytes.push(below(256) as u8),
            0 => bytes[at] ^= 1 << below(8),
            1 => bytes[at] = b"\0\xff,.-e+9\n\"<"[below(11)],
            2 => drop(bytes.drain(at..end)),
            3 => bytes.extend_from_within(at..end),
            4 => {
                let other = &corpus[below(corpus.len())];
                let from = below(other.len());
                let piece = other[from..(from + PIECE).min(other.len())].to_vec();
                bytes.splice(at..at, piece);
            }
            _ => bytes.truncate(at),
        }
    }
    bytes
}

#[test]
fn c3d_files() {
    survives("c3d_file", host_decoders::c3d_file);
}

#[test]
fn texts_of_opensim() {
    survives("opensim_text", host_decoders::opensim_text);
}

#[test]
fn csv_recordings() {
    survives("recording_csv", host_decoders::recording_csv);
}

#[test]
fn mcap_recordings() {
    survives("recording_mcap", host_decoders::recording_mcap);
}

#[test]
fn rig_files() {
    survives("rig_file", host_decoders::rig_file);
}

#[test]
fn factor_files() {
    survives("factor_file", host_decoders::factor_file);
}

#[test]
fn streams_of_sensors() {
    survives("source_streams", host_decoders::source_streams);
}

#[test]
fn tables_of_columns() {
    survives("recording_table", host_decoders::recording_table);
}

#[test]
fn bags_in_databases() {
    survives("recording_bag", host_decoders::recording_bag);
}

#[test]
fn models_of_robots() {
    survives("robot_model", host_decoders::robot_model);
}

#[test]
fn results() {
    survives("result_json", host_decoders::result_json);
}

#[test]
fn settings_and_other_texts() {
    survives("settings_text", host_decoders::settings_text);
}

#[test]
fn plans() {
    survives("plan_json", host_decoders::plan_json);
}
