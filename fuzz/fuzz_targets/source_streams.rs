//! Any bytes from any sensor: no panic, and every number that comes out is one.
//!
//! The first byte says whose decoder it is; the bytes come in pieces of a length that the second one says.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rigident::rig::RigFile;
use rigident::sources::{Role, Row, ati, foxglove, lines, rtde, xsens};

fn check(rows: &[Row], width: Option<usize>) {
    for row in rows {
        assert!(row.values.iter().all(|v| v.is_finite()), "{row:?}");
        assert!(width.is_none_or(|width| row.values.len() == width), "{row:?}");
    }
}

fuzz_target!(|bytes: &[u8]| {
    let [whose, piece, bytes @ ..] = bytes else { return };
    let pieces = bytes.chunks(usize::from(*piece).max(1));
    let mut rows = Vec::new();
    match whose % 7 {
        0 => {
            let calibration = ati::Calibration { newton: 1e-6, newton_metre: 1e-6, rate_hz: Some(7000.0) };
            let mut decoder = ati::Decoder::new(calibration);
            rows.extend(bytes.chunks(ati::RECORD).filter_map(|datagram| decoder.datagram(datagram)));
            check(&rows, Some(6));
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
            check(&rows, Some(16));
            let _ = rtde::decoder_of_everything(bytes);
        }
        3 => {
            let mut decoder = xsens::Decoder::default();
            pieces.for_each(|piece| decoder.feed(piece, &mut rows));
            check(&rows, Some(6));
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
            check(&rows, None);
        }
        _ => {
            let mut decoder = lines::Decoder::new(None, &RigFile::default(), false);
            for piece in pieces {
                if decoder.feed(piece, &mut rows).is_err() {
                    break;
                }
            }
            check(&rows, None);
        }
    }
});
