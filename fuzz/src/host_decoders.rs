//! Decoders of the host, each as a check of any bytes: fuzzed here, and run by the host's tests on the corpus
//! and on bytes that are damaged by chance.

use std::io::{Cursor, Write};
use std::path::Path;

use hexapod::Geometry;
use rigident::answer::Answer;
use rigident::answer::predictor::Predictor;
use rigident::device::settings_file;
use rigident::fit::pool::PooledFactor;
use rigident::fit::prior::KnownValues;
use rigident::fit::tare::Tare;
use rigident::joint_offsets::poses_file::PosesTable;
use rigident::model::base::{Situation, base_parameters};
use rigident::model::rows::Rows;
use rigident::model::{check, write};
use rigident::motion_capture::c3d::C3d;
use rigident::motion_capture::motive::Take;
use rigident::motion_capture::opensim::model::OsimModel;
use rigident::motion_capture::opensim::storage::Storage;
use rigident::motion_capture::opensim::trc::Trc;
use rigident::people::inverse_kinematics::marker_file::MarkerFile;
use rigident::plan::plan_file::PlanFile;
use rigident::present::plain;
use rigident::recording::Recording;
use rigident::reference::ReferenceBody;
use rigident::rig::{RigCalibration, RigFile};
use rigident::sources::{Role, Row, ati, foxglove, lines, rtde, xsens};

/// Any bytes as a C3D file: no panic, and as many points and samples as it says.
pub fn c3d_file(bytes: &[u8]) {
    let Ok(file) = C3d::parse(bytes) else { return };
    assert_eq!(file.points_m.len(), file.frames * file.labels.len());
    assert_eq!(file.analog.len(), file.frames * file.samples_per_frame * file.channels.len());
    for plate in &file.plates {
        assert!(plate.channels.iter().all(|channel| *channel < file.channels.len()));
    }
}

/// Any text as OpenSim's files, or as Motive's CSV: no panic, tables as large as they say, and a model that
/// is written with other bodies and read again.
pub fn opensim_text(bytes: &[u8]) {
    if let Ok(take) = Take::read(bytes) {
        assert_eq!(take.points_m.len() % take.labels.len(), 0);
    }
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(markers) = Trc::parse(text) {
        assert_eq!(markers.points_m.len() % markers.labels.len().max(1), 0);
    }
    if let Ok(table) = Storage::parse(text) {
        assert_eq!(table.values.len(), table.times_s.len() * table.columns.len());
    }
    let Ok(model) = OsimModel::parse(text) else { return };
    assert_eq!(model.places().len(), model.bodies.len());
    assert!(model.lengths().iter().all(|(_, length)| length.is_finite()));
    let mut bodies = model.bodies.clone();
    bodies.iter_mut().for_each(|body| body.com_m = [1.0, 2.0, 3.0]);
    let Ok(written) = model.written(text, &bodies) else { return };
    let again = OsimModel::parse(&written).expect("what was written is read again");
    assert!(again.bodies.iter().all(|body| body.com_m == [1.0, 2.0, 3.0]));
}

/// Any CSV file, with any rig file before it: no panic, and what was read survives being written and read
/// again.
///
/// A zero byte ends the rig file; without one there is none.
pub fn recording_csv(bytes: &[u8]) {
    let (rig, csv) = match bytes.iter().position(|&byte| byte == 0) {
        Some(end) => (std::str::from_utf8(&bytes[..end]).unwrap_or_default(), &bytes[end + 1..]),
        None => ("", bytes),
    };
    let Ok(rig) = RigFile::parse(rig) else { return };
    let Ok(first) = Recording::from_csv_bytes("fuzz.csv", csv, &rig) else { return };
    let (rig, _) = first.rig_in_notation();
    let again = first.to_csv();
    let second = Recording::from_csv_bytes("fuzz.csv", again.as_bytes(), &rig).expect("we wrote it");
    assert_eq!(first.time_ns, second.time_ns);
    assert_eq!(first.wrench, second.wrench);
    assert_eq!(first.imus, second.imus);
    assert_eq!(first.gravity, second.gravity);
    assert_eq!(first.gauges, second.gauges);
    assert_eq!(first.platform, second.platform);
    assert_eq!(first.attitudes, second.attitudes);
}

/// Any rig file: no panic, and what was understood survives being written and read again.
pub fn rig_file(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(first) = RigFile::parse(text) else { return };
    let second = RigFile::parse(&first.to_toml()).expect("we wrote it");
    assert_eq!(first, second);
}

/// Any factor file, as it is and with a check sum that fits; then all that can be done with what was read.
pub fn factor_file(bytes: &[u8]) {
    factor(bytes);
    let sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(bytes);
    factor(&[b"RIGIDFAC".as_slice(), bytes, &sum.to_le_bytes()].concat());
}

fn factor(bytes: &[u8]) {
    let Ok(pooled) = PooledFactor::from_bytes(bytes, "fuzz") else { return };
    // Singular values of a large triangle take longer than an input may.
    if pooled.parameters.len() > 32 {
        return;
    }
    let written = pooled.to_bytes();
    assert_eq!(PooledFactor::from_bytes(&written, "fuzz").as_ref(), Ok(&pooled));
    let mut fit = pooled.fit();
    let _ = pooled.recordings();
    let bare = PooledFactor { sources: Vec::new(), ..pooled.clone() };
    let _ = PooledFactor::merged(vec![pooled.clone(), bare.clone()], true);
    let _ = PooledFactor::merged(vec![pooled.clone(), bare.clone()], false);
    if let Ok(tare) = Tare::new(bare) {
        let _ = tare.take_off(&mut fit);
    }
    let known = ["mass_kg=20±0.1", "com_x_m=0.1±0.01", "ixx_com_kgm2=1±0.1"].map(str::to_owned);
    if let Ok(known) = KnownValues::parse(&known, &["y".to_owned()]) {
        let _ = known.apply(&mut fit);
    }
}

/// Any MCAP file: no panic, and what was read survives being written and read again.
pub fn recording_mcap(bytes: &[u8]) {
    let Ok(first) = Recording::from_mcap_bytes("fuzz.mcap", bytes, None) else { return };
    if first.groups().is_empty() && first.extra.is_empty() {
        return;
    }
    let Ok(file) = first.write_mcap(Cursor::new(Vec::new())) else { return };
    let second = Recording::from_mcap_bytes("fuzz.mcap", file.get_ref(), None).expect("we wrote it");
    assert_eq!(first.time_ns, second.time_ns);
    assert_eq!(first.wrench, second.wrench);
    assert_eq!(first.gravity, second.gravity);
    assert_eq!(first.gauges, second.gauges);
    assert_eq!(first.platform, second.platform);
}

/// Any Parquet, XLSX, TDMS or MAT file, by how it begins: no panic, and what was read survives being written
/// and read again.
pub fn recording_table(bytes: &[u8]) {
    let name = match bytes {
        [b'P', b'A', b'R', b'1', ..] => "fuzz.parquet",
        [b'P', b'K', ..] => "fuzz.xlsx",
        [b'T', b'D', b'S', b'm', ..] => "fuzz.tdms",
        _ => "fuzz.mat",
    };
    let Ok(first) = Recording::from_columns(name, bytes.to_vec(), &RigFile::default()) else { return };
    let (rig, _) = first.rig_in_notation();
    let written = first.to_csv();
    let again = Recording::from_csv_bytes("fuzz.csv", written.as_bytes(), &rig);
    let again = again.unwrap_or_else(|error| panic!("{error}, of {written:.2000?}"));
    assert_eq!(first.time_ns, again.time_ns);
    assert_eq!(first.wrench, again.wrench);
    assert_eq!(first.imus, again.imus);
}

/// Any bag of ROS 2 in an SQLite database, or of ROS 1: no panic, and no end that does not come.
pub fn recording_bag(bytes: &[u8]) {
    let Ok(first) = Recording::from_mcap_bytes("fuzz.db3", bytes, None) else { return };
    assert!(first.time_ns.windows(2).all(|pair| pair[0] < pair[1]));
}

/// Any description of a robot, URDF, MJCF or SDF: no panic; it is checked, and a small one is counted.
pub fn robot_model(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(parsed) = write::parse(text, "fuzz") else { return };
    let model = parsed.model;
    let _ = check::check(&model, Some(text), Path::new("fuzz"));
    // The rank of a large tree takes longer than an input may.
    if model.links.len() <= 12 {
        let _ = base_parameters(&model, &Situation { floating: true, rows: Rows::Both, mimic: true });
    }
}

/// Any `result.json`: no panic; it is shown, used to predict, and survives being written and read again.
pub fn result_json(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(first) = Answer::read(text) else { return };
    let shown = plain::text(&first);
    assert!(!shown.chars().any(|c| c.is_control() && c != '\n'), "{shown:?}");
    let _ = Predictor::of_answer(&first);
    let again = serde_json::to_string(&first).expect("it is JSON");
    Answer::read(&again).expect("we wrote it");
}

/// Any text of the smaller files: settings, calibrations, reference bodies, markers, tables of poses. No
/// panic.
pub fn settings_text(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    for is_json in [false, true] {
        let _ = settings_file::parse("fuzz", text, is_json);
    }
    let _ = RigCalibration::parse(text, "fuzz");
    let _ = ReferenceBody::parse(text, "fuzz");
    let _ = MarkerFile::parse(text);
    let _ = PosesTable::parse(text, "fuzz");
}

/// Any plan, as a file: no panic, and none that a machine cannot do is taken.
pub fn plan_json(bytes: &[u8]) {
    let Ok(mut file) = tempfile::NamedTempFile::new() else { return };
    if file.write_all(bytes).is_err() {
        return;
    }
    let Ok(plan) = PlanFile::read(file.path(), &Geometry::thesis()) else { return };
    assert!(!plan.title.chars().any(char::is_control), "{:?}", plan.title);
}

/// Any bytes from any sensor: no panic, and every number that comes out is one.
///
/// The first byte says whose decoder it is; the bytes come in pieces of a length that the second one says.
pub fn source_streams(bytes: &[u8]) {
    let [whose, piece, bytes @ ..] = bytes else { return };
    let pieces = bytes.chunks(usize::from(*piece).max(1));
    let mut rows = Vec::new();
    match whose % 7 {
        0 => {
            let calibration = ati::Calibration { newton: 1e-6, newton_metre: 1e-6, rate_hz: Some(7000.0) };
            let mut decoder = ati::Decoder::new(calibration);
            rows.extend(bytes.chunks(ati::RECORD).filter_map(|datagram| decoder.datagram(datagram)));
            are_numbers(&rows, Some(6));
            let _ = ati::read_calibration(bytes);
        }
        1 => {
            if let Ok(found) = ati::read_page(&String::from_utf8_lossy(bytes)) {
                assert!(found.newton > 0.0 && found.newton_metre > 0.0);
            }
        }
        2 => {
            let types = b"\x01DOUBLE,VECTOR6D,VECTOR3D,VECTOR6D";
            let mut decoder = rtde::decoder_of_everything(types).expect("the types are right");
            let mut packages = rtde::Packages::default();
            for piece in pieces {
                packages.feed(piece);
                while let Ok(Some((_, payload))) = packages.next() {
                    rows.extend(decoder.data(payload));
                }
            }
            are_numbers(&rows, Some(16));
            let _ = rtde::decoder_of_everything(bytes);
        }
        3 => {
            let mut decoder = xsens::Decoder::default();
            pieces.for_each(|piece| decoder.feed(piece, &mut rows));
            are_numbers(&rows, Some(6));
            let _ = decoder.lacks();
        }
        4 => {
            let mut decoder = foxglove::Decoder::new(foxglove::Wanted::new(Role::Imu, None, true));
            let _ = decoder.text(&String::from_utf8_lossy(bytes));
            let _ = decoder.missing();
        }
        5 => {
            let role = [Role::Wrench, Role::Imu, Role::Pose][usize::from(*piece) % 3];
            let mut decoder = foxglove::Decoder::new(foxglove::Wanted::new(role, None, *piece < 128));
            for message in bytes.chunks(80) {
                if let Ok(row) = decoder.binary(message) {
                    rows.extend(row);
                }
            }
            rows.extend(decoder.binary(bytes).ok().flatten());
            are_numbers(&rows, None);
        }
        _ => {
            let mut decoder = lines::Decoder::new(None, &RigFile::default(), false);
            for piece in pieces {
                if decoder.feed(piece, &mut rows).is_err() {
                    break;
                }
            }
            are_numbers(&rows, None);
        }
    }
}

fn are_numbers(rows: &[Row], width: Option<usize>) {
    for row in rows {
        assert!(row.values.iter().all(|v| v.is_finite()), "{row:?}");
        assert!(width.is_none_or(|width| row.values.len() == width), "{row:?}");
    }
}
