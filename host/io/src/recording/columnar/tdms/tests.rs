use std::path::{Path, PathBuf};

use super::*;
use crate::recording::csv::exports_tests::{ROWS, check, number as exact, thousandths};
use crate::recording::import::{Choices, understand};
use crate::recording::{Recording, RecordingError};
use crate::rig::RigFile;

/// Files of nptdms; `fuzz/make_tables.py` writes them.
fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/recording_table").join(name)
}

fn read(bytes: &[u8]) -> Result<Recording, RecordingError> {
    Recording::from_columns("a.tdms", bytes.to_vec(), &RigFile::default())
}

#[test]
fn waveforms_in_two_segments_are_one_table_with_a_time() {
    let recording = Recording::load(&path("waveform.tdms"), None).unwrap();
    check(&recording, "waveform");
    assert_eq!((recording.time_ns[0], recording.rate_hz), (1_795_169_553_000_000_000, Some(500.0)));
    assert!(recording.warnings.iter().any(|w| w.contains("Settings/gain (2)")), "{:?}", recording.warnings);
    let found = understand(&path("waveform.tdms")).unwrap();
    let columns = found.proposal(&Choices::default()).unwrap();
    assert_eq!(columns["mz_nm"], ("Mz".to_owned(), Some("Nm".to_owned())));
    assert_eq!(columns["t_s"], ("Time".to_owned(), Some("s".to_owned())));
}

#[test]
fn whole_numbers_are_scaled_as_the_channel_says() {
    let recording = Recording::load(&path("scaled.tdms"), None).unwrap();
    assert_eq!(recording.time_ns[1], 1_795_169_553_002_000_000);
    for (row, own) in recording.wrench.as_ref().unwrap().iter().enumerate() {
        for (k, value) in own.iter().enumerate() {
            let wanted = exact(thousandths(row, k + 1)) + 0.25;
            assert!((value - wanted).abs() < 1e-12, "row {row}: {value} {wanted}");
        }
    }
    let notes = recording.extra.iter().find(|(name, _)| name == "note").unwrap();
    assert_eq!((notes.1.len(), notes.1[39].as_str()), (ROWS, "row 39"));
    let bytes = std::fs::read(path("scaled.tdms")).unwrap();
    let other = |from: &[u8], to: &[u8]| {
        assert_eq!(from.len(), to.len());
        let mut changed = bytes.clone();
        while let Some(at) = changed.windows(from.len()).position(|w| w == from) {
            changed[at..at + to.len()].copy_from_slice(to);
        }
        changed
    };
    let said = read(&other(b"Linear\x16", b"Strain\x16")).err().map(|e| e.to_string());
    let said = said.unwrap_or_else(|| read(&other(b"Linear", b"Strain")).unwrap_err().to_string());
    assert!(said.contains("\"Strain\", which is not read"), "{said}");
    // A first scale that is not stated leaves the counts to the second; a last one that is not stated is
    // none.
    let second = Recording::load(&path("second_scale.tdms"), None).unwrap();
    assert_eq!(second.wrench, recording.wrench);
    let said = read(&other(b"NI_Scale[0]_Scale_Type", b"NI_Scale[9]_Scale_Type")).unwrap_err().to_string();
    assert!(said.contains("a scale of kind \"none\""), "{said}");
    // What is scaled already stays as it is.
    let as_it_is = read(&other(b"NI_Number_Of_Scales", b"NI_Number_Of_Shades")).unwrap();
    assert_eq!(as_it_is.wrench.unwrap()[0][0], 1_234_567.0);
}

#[test]
fn counts_of_two_devices_are_scaled_and_lines_are_bits() {
    let recording = Recording::load(&path("daqmx.tdms"), None).unwrap();
    assert_eq!((recording.rows(), recording.rate_hz), (ROWS, Some(500.0)));
    assert_eq!(recording.wrench, Recording::load(&path("second_scale.tdms"), None).unwrap().wrench);
    let gate = recording.extra.iter().find(|(name, _)| name == "gate").unwrap();
    let lines: Vec<f64> = gate.1.iter().map(|cell| cell.parse().unwrap()).collect();
    assert!(lines.iter().enumerate().all(|(row, line)| *line == (row % 2) as f64), "{lines:?}");
    let bytes = std::fs::read(path("daqmx.tdms")).unwrap();
    // Counts that nothing scales are no forces.
    let mut bare = bytes.clone();
    while let Some(at) = bare.windows(19).position(|w| w == b"NI_Number_Of_Scales") {
        bare[at..at + 19].copy_from_slice(b"NI_Number_Of_Shades");
    }
    let said = read(&bare).unwrap_err().to_string();
    assert!(said.contains("counts of the converter") && said.contains("save it scaled"), "{said}");
    // The last sample of the first device is cut off, and all of the second device's second half: what is
    // whole is read.
    let objects = segments::read(&bytes[..bytes.len() - 8 * ROWS / 2 - 1]).unwrap();
    let lengths: Vec<usize> = objects[1..].iter().map(length).collect();
    assert_eq!(lengths, [39, 39, 39, 39, 20, 20, 39]);
    for length in 0..bytes.len() {
        let _ = read(&bytes[..length]);
    }
    let mut draw = 1_u32;
    for _ in 0..3000 {
        let mut damaged = bytes.clone();
        for _ in 0..3 {
            draw = draw.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let at = draw as usize % damaged.len();
            damaged[at] = (draw >> 24) as u8;
        }
        let _ = read(&damaged);
    }
}

/// Makes a segment by the specification, in either byte order: channels of f32, i16 and f64, three values
/// each.
fn segment(is_big: bool, is_interleaved: bool) -> Vec<u8> {
    let order = |mut bytes: Vec<u8>| {
        if is_big {
            bytes.reverse();
        }
        bytes
    };
    let word = |value: u32| order(value.to_le_bytes().to_vec());
    let long = |value: u64| order(value.to_le_bytes().to_vec());
    let text = |text: &str| [word(text.len() as u32), text.as_bytes().to_vec()].concat();
    let mut meta = word(3);
    for (name, kind) in [("/'g'/'it''s'", 9), ("/'g'/'b'", 2), ("/'g'/'c'", 10)] {
        meta.extend([text(name), word(20), word(kind), word(1), long(3), word(0)].concat());
    }
    let values = |k: usize, row: usize| {
        let value = (10 * k + row) as f64 - 12.0;
        order(match k {
            0 => (value as f32).to_le_bytes().to_vec(),
            1 => (value as i16).to_le_bytes().to_vec(),
            _ => value.to_le_bytes().to_vec(),
        })
    };
    let mut raw = Vec::new();
    for n in 0..9 {
        let (k, row) = if is_interleaved { (n % 3, n / 3) } else { (n / 3, n % 3) };
        raw.extend(values(k, row));
    }
    let contents = 0b1110 | if is_interleaved { 1 << 5 } else { 0 } | if is_big { 1 << 6 } else { 0_u32 };
    let mut lead = b"TDSm".to_vec();
    lead.extend(contents.to_le_bytes());
    lead.extend([word(4713), long((meta.len() + raw.len()) as u64), long(meta.len() as u64)].concat());
    [lead, meta, raw].concat()
}

#[test]
fn both_byte_orders_and_both_orders_of_values_are_read() {
    for (is_big, is_interleaved) in [(false, false), (false, true), (true, false), (true, true)] {
        let one = segment(is_big, is_interleaved);
        // A second segment, and a third that was cut off within its second row.
        let bytes = [one.clone(), one.clone(), one[..one.len() - 14].to_vec()].concat();
        let table = table(&bytes).unwrap();
        let what = format!("{is_big}, {is_interleaved}");
        let column = |name: &str| {
            let own = table.columns.iter().find(|(own, _)| own == name);
            own.map(|(_, cells)| cells.iter().map(|cell| cell.parse::<f64>().unwrap()).collect::<Vec<_>>())
        };
        let expected = |k: f64| {
            let three = [10.0 * k - 12.0, 10.0 * k - 11.0, 10.0 * k - 10.0];
            let count = if is_interleaved { 8 } else { 9 };
            let mut all: Vec<f64> = three.iter().cycle().take(9).copied().collect();
            all.truncate(count);
            all
        };
        assert_eq!(column("it's"), Some(expected(0.0)), "{what}");
        assert_eq!(column("b").map(|c| c[..6].to_vec()), Some(expected(1.0)[..6].to_vec()), "{what}");
    }
}

#[test]
fn rates_that_differ_and_other_files_are_refused() {
    let bytes = std::fs::read(path("waveform.tdms")).unwrap();
    let step = 0.002_f64.to_le_bytes();
    let at = bytes.windows(8).position(|w| w == step).unwrap();
    let mut other = bytes.clone();
    other[at..at + 8].copy_from_slice(&0.004_f64.to_le_bytes());
    let second = other.windows(8).rposition(|w| w == step);
    assert!(second.is_some());
    // The second segment states the first channel's step again.
    let positions: Vec<usize> = (0..bytes.len() - 8).filter(|k| bytes[*k..*k + 8] == step).collect();
    let mut other = bytes.clone();
    for k in [positions[0], positions[positions.len() / 2]] {
        other[k..k + 8].copy_from_slice(&0.004_f64.to_le_bytes());
    }
    let said = read(&other).unwrap_err().to_string();
    assert!(said.contains("not at the same times") && said.contains("a file of their own"), "{said}");
    let said = read(b"TDSh").unwrap_err().to_string();
    assert!(said.contains("tdms_index"), "{said}");
    for length in (0..bytes.len()).step_by(13) {
        // Cut off at any byte: whole values that were written, or a word.
        let _ = read(&bytes[..length]);
    }
}
