//! The instrument that an error is of: recordings that were taken with one share it.

use rigident_fit::{Basis, Fingerprint, RigError};
use rigident_io::rig::{ImuTable, LoadCellTable, RigFile};

/// The label that names a rig where its instruments have no serial numbers.
const RIG: &str = "rig";

/// Names of what an error is of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    LoadCell,
    Imu,
    /// Place and attitude of the IMU: another one after it was mounted anew.
    Mounting,
    Gravity,
    /// Joints, springs, feet.
    Machine,
}

impl Part {
    fn of(error: &RigError) -> Self {
        match error.group.as_str() {
            "load-cell gain" | "cross-talk" => Self::LoadCell,
            "lever arm" | "IMU rotation" => Self::Mounting,
            "gravity" => Self::Gravity,
            group if group.starts_with("gyro") || group.starts_with("accelerometer") => Self::Imu,
            _ => Self::Machine,
        }
    }
}

/// Returns the instrument that an error is of: by its serial number, by the label `rig` of the recording, or
/// by what the rig file states of it, which begins with `#` then. A calibration makes it another one: what is
/// left of its errors is.
pub fn instrument(rig: &RigFile, error: &RigError) -> String {
    let part = Part::of(error);
    let label = rig.recording.labels.get(RIG).cloned();
    let imu = rig.imu.first();
    let name = match part {
        Part::LoadCell => rig.load_cell.serial.clone().or(label),
        Part::Imu => imu.and_then(|imu| imu.serial.clone()).or(label),
        Part::Mounting => {
            let own = imu.and_then(|imu| imu.serial.clone()).or(label);
            own.map(|name| format!("{name} as mounted {:08x}", mounting(imu)))
        }
        Part::Gravity => return format!("gravity {}", rig.recording.gravity_mps2),
        Part::Machine => label,
    };
    let name = name.unwrap_or_else(|| format!("#{:08x}", stated(rig, part)));
    let word = match part {
        Part::LoadCell => "load cell",
        Part::Imu | Part::Mounting => "IMU",
        Part::Gravity => "gravity",
        Part::Machine => "machine",
    };
    match (&error.basis, rig.calibrated()) {
        (Basis::Calibration(_), Some(own)) => format!("{word} {name}, calibrated {}", own.checksum),
        _ => format!("{word} {name}"),
    }
}

/// A fingerprint of what a rig file states of a part, noise and offsets left out: these are of a recording.
fn stated(rig: &RigFile, part: Part) -> u32 {
    let text = match part {
        Part::LoadCell => {
            let plain = LoadCellTable::default();
            let cell = LoadCellTable {
                noise_n_nm: plain.noise_n_nm,
                offset_n_nm: plain.offset_n_nm,
                offset_within_n_nm: plain.offset_within_n_nm,
                ..rig.load_cell.clone()
            };
            serde_json::to_string(&cell)
        }
        Part::Imu => serde_json::to_string(&rig.imu.iter().map(unmounted).collect::<Vec<_>>()),
        Part::Mounting => return mounting(rig.imu.first()),
        Part::Gravity => serde_json::to_string(&rig.recording.gravity_mps2),
        Part::Machine => serde_json::to_string(&(&rig.tree, &rig.joint, &rig.foot, &rig.suspension)),
    };
    let mut hash = Fingerprint::default();
    hash.add_text(&text.unwrap_or_default());
    hash.finish() as u32
}

fn unmounted(imu: &ImuTable) -> ImuTable {
    let plain = ImuTable::default();
    ImuTable {
        position_m: plain.position_m,
        rotation_wxyz: plain.rotation_wxyz,
        accel_bias_mps2: plain.accel_bias_mps2,
        gyro_bias_radps: plain.gyro_bias_radps,
        accel_noise_mps2: None,
        gyro_noise_radps: None,
        ..imu.clone()
    }
}

fn mounting(imu: Option<&ImuTable>) -> u32 {
    let mut hash = Fingerprint::default();
    let numbers = imu.into_iter().flat_map(|imu| imu.position_m.into_iter().chain(imu.rotation_wxyz));
    numbers.for_each(|v| hash.add(v.to_bits()));
    hash.finish() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(group: &str) -> RigError {
        RigError {
            instrument: String::new(),
            name: "error".into(),
            group: group.into(),
            unit: "1".into(),
            basis: Basis::Class("usual".into()),
            expected: 0.0,
            sigma: 0.01,
        }
    }

    #[test]
    fn an_instrument_is_known_by_its_number_or_its_settings() {
        let plain = RigFile { imu: vec![ImuTable::default()], ..RigFile::default() };
        let of = |rig: &RigFile, group: &str| instrument(rig, &error(group));
        let mut other = plain.clone();
        other.load_cell.noise_n_nm = Some([0.1; 6]);
        other.imu[0].accel_noise_mps2 = Some(0.01);
        for group in ["load-cell gain", "cross-talk", "gyro scale", "lever arm", "joint zero", "gravity"] {
            assert_eq!(of(&plain, group), of(&other, group), "noise makes no other instrument");
        }
        assert!(of(&plain, "cross-talk").contains('#') && !of(&plain, "gravity").contains('#'));
        other.load_cell.gain_uncertainty = Some([1e-3; 6]);
        assert_ne!(of(&plain, "load-cell gain"), of(&other, "load-cell gain"));
        assert_eq!(of(&plain, "gyro scale"), of(&other, "gyro scale"));
        // Mounted anew it is the same IMU.
        other.imu[0].position_m = [0.1, 0.0, 0.0];
        assert_eq!(of(&plain, "gyro scale"), of(&other, "gyro scale"));
        assert_ne!(of(&plain, "lever arm"), of(&other, "lever arm"));
        other.load_cell.serial = Some("FT 17".into());
        assert_eq!(of(&other, "cross-talk"), "load cell FT 17");
        other.recording.labels.insert("rig".into(), "north".into());
        assert_eq!(
            (of(&other, "joint zero"), of(&other, "gyro scale")),
            ("machine north".into(), "IMU north".into())
        );
    }
}
