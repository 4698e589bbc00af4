//! Recordings that were cut off, damaged or made to harm: what is whole is read, the rest is said, nothing
//! panics, and memory stays in proportion to the file.

use std::io::{Cursor, Error, ErrorKind, Seek, SeekFrom, Write};
use std::sync::{Arc, Mutex};

use rigident::recording::Recording;
use rigident::recording::mcap::messages::ImuValues;
use rigident::recording::mcap::write::{Head, McapWriter, Row};

const ROWS: u64 = 1000;

fn wrench(n: u64) -> [f64; 6] {
    [n as f64, 0.5, -0.25, 1e-3, 2e-3, 3e-3]
}

/// Writes row after row until the end or until the disk is full.
fn record<W: Write + Seek>(to: W) -> Result<W, String> {
    let head = Head::default();
    let mut writer = McapWriter::new(to, &head).map_err(|e| e.to_string())?;
    for n in 0..ROWS {
        let imu = ImuValues { accel: Some([0.0, n as f64, 9.81]), gyro: Some([1e-3; 3]) };
        let row = Row { time_ns: n * 1_000_000, wrench: Some(wrench(n)), imus: &[imu], ..Row::default() };
        writer.append(&row).map_err(|e| e.to_string())?;
    }
    writer.finish().map_err(|e| e.to_string())
}

fn whole() -> Vec<u8> {
    record(Cursor::new(Vec::new())).unwrap().into_inner()
}

/// The rows are the first ones of the recording, complete and unchanged.
fn assert_beginning(recording: &Recording) -> usize {
    let rows = recording.rows();
    let written: Vec<[f64; 6]> = (0..rows as u64).map(wrench).collect();
    assert_eq!(recording.wrench.as_deref(), Some(&written[..]));
    assert_eq!(recording.time_ns.len(), rows);
    assert_eq!(recording.imus[0].accel.as_ref().map(Vec::len), Some(rows));
    rows
}

#[test]
fn a_recording_cut_off_anywhere_is_read_up_to_its_last_whole_chunk() {
    let bytes = whole();
    let mut last = 0;
    for cut in (0..bytes.len()).step_by(997) {
        match Recording::from_mcap_bytes("cut.mcap", &bytes[..cut], None) {
            Ok(recording) => {
                let rows = assert_beginning(&recording);
                assert!(rows >= last, "{cut}: fewer rows in more bytes");
                last = rows;
                if rows < ROWS as usize {
                    assert!(!recording.warnings.is_empty(), "{cut}: nothing is said");
                }
            }
            Err(error) => assert!(last == 0, "{cut}: {error}"),
        }
    }
    assert_eq!(last, ROWS as usize);
}

/// Half of what a row says is the same in every row.
#[test]
fn chunks_are_packed() {
    let summary = mcap::Summary::read(&whole()).unwrap().unwrap();
    assert!(!summary.chunk_indexes.is_empty());
    for chunk in &summary.chunk_indexes {
        assert_eq!(chunk.compression, "zstd");
        assert!(chunk.compressed_size < chunk.uncompressed_size / 2, "{chunk:?}");
    }
}

#[test]
fn changed_bytes_never_panic_and_never_pass_for_another_reading() {
    let bytes = whole();
    // A linear congruential generator (Knuth, MMIX): the same damage every time.
    let mut state = 1_u64;
    let mut next = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for _ in 0..400 {
        let mut damaged = bytes.clone();
        for _ in 0..=next(3) {
            let at = if next(2) == 0 { next(400) } else { next(bytes.len()) };
            damaged[at] = next(256) as u8;
        }
        if let Ok(recording) = Recording::from_mcap_bytes("damaged.mcap", &damaged, None) {
            for (time, row) in recording.time_ns.iter().zip(recording.wrench.iter().flatten()) {
                assert_eq!(*row, wrench(time / 1_000_000));
            }
        }
    }
}

/// A disk with little room.
#[derive(Clone)]
struct SmallDisk {
    bytes: Arc<Mutex<Vec<u8>>>,
    room: usize,
}

impl Write for SmallDisk {
    fn write(&mut self, data: &[u8]) -> std::io::Result<usize> {
        let mut bytes = self.bytes.lock().unwrap();
        let fits = data.len().min(self.room - bytes.len());
        bytes.extend(&data[..fits]);
        if fits == 0 && !data.is_empty() { Err(ErrorKind::StorageFull.into()) } else { Ok(fits) }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Seek for SmallDisk {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.bytes.lock().unwrap().len() as u64),
            _ => Err(Error::from(ErrorKind::Unsupported)),
        }
    }
}

#[test]
fn a_full_disk_is_reported_and_the_part_written_is_read() {
    let full_size = whole().len();
    let disk = SmallDisk { bytes: Arc::default(), room: full_size * 3 / 4 };
    let Err(error) = record(disk.clone()) else { panic!("the disk was full") };
    assert!(error.contains("the disk is full") && error.contains("can be read"), "{error}");
    let bytes = disk.bytes.lock().unwrap().clone();
    let rows = assert_beginning(&Recording::from_mcap_bytes("full.mcap", &bytes, None).unwrap());
    assert!(rows >= ROWS as usize / 2, "{rows}");
}

#[test]
fn other_files_are_refused_with_advice() {
    for bytes in [&b""[..], b"t_s,fx_n\n0,1\n", b"\x89MCAP0\r\n"] {
        let error = Recording::from_mcap_bytes("thing.mcap", bytes, None).unwrap_err().to_string();
        assert!(error.contains("thing.mcap"), "{error}");
    }
}
