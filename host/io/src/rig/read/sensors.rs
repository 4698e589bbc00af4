//! IMUs and load cell.

use super::{Check, IMU_NOISE, NOISE, NOT_NEGATIVE, RigFileError, is_number_of_chip};
use crate::recording::columns::MOST_LINKS;
use crate::rig::{Calibrated, OffsetTable};

impl Check<'_> {
    pub(super) fn imus(&self) -> Result<(), RigFileError> {
        let mut links = Vec::new();
        for (i, imu) in self.rig.imu.iter().enumerate() {
            let key = |name: &str| format!("imu[{i}].{name}");
            if imu.link >= MOST_LINKS {
                return Err(self.refuse(&key("link"), imu.link, "no model has this many links"));
            }
            if links.contains(&imu.link) {
                return Err(self.refuse(
                    &key("link"),
                    imu.link,
                    "two [[imu]] tables are for one link: each needs a link of its own",
                ));
            }
            links.push(imu.link);
            let most = self.rig.link.len();
            if most > 0 && imu.link >= most {
                let names: Vec<&str> = self.rig.link.iter().map(|link| link.name.as_str()).collect();
                let advice = format!(
                    "the [[link]] tables are links 0 to {} ({}), in their order",
                    most - 1,
                    names.join(", ")
                );
                return Err(self.refuse(&key("link"), imu.link, advice));
            }
            self.finite(&key("position_m"), &imu.position_m)?;
            self.rotation(&key("rotation_wxyz"), &imu.rotation_wxyz)?;
            if let Calibrated::Numbers(scale) = &imu.accel_scale {
                self.positive(&key("accel_scale"), scale)?;
            }
            for (name, value) in
                [("accel_bias_mps2", imu.accel_bias_mps2), ("gyro_bias_radps", imu.gyro_bias_radps)]
            {
                if let Calibrated::Numbers(bias) = value {
                    self.finite(&key(name), &bias)?;
                }
            }
            self.delay(&key("group_delay_s"), imu.group_delay_s)?;
            for (name, value) in [
                ("bandwidth_hz", imu.bandwidth_hz),
                ("rate_hz", imu.rate_hz),
                ("range_mps2", imu.range_mps2),
                ("range_radps", imu.range_radps),
            ] {
                self.positive(&key(name), value.as_slice())?;
            }
            for (name, value) in [
                ("accel_noise_mps2", imu.accel_noise_mps2),
                ("gyro_noise_radps", imu.gyro_noise_radps),
                ("attitude_noise_rad", imu.attitude_noise_rad),
            ] {
                self.all(&key(name), value.as_slice(), |v| v > 0.0, IMU_NOISE)?;
            }
            for (name, value) in [
                ("position_std_m", imu.position_std_m),
                ("rotation_std_rad", imu.rotation_std_rad),
                ("skew_std_s", imu.skew_std_s),
                ("accel_bias_std_mps2", imu.accel_bias_std_mps2),
                ("accel_gain_std", imu.accel_gain_std),
                ("accel_misalignment_std_rad", imu.accel_misalignment_std_rad),
                ("gyro_bias_std_radps", imu.gyro_bias_std_radps),
                ("gyro_gain_std", imu.gyro_gain_std),
                ("gyro_rotation_std_rad", imu.gyro_rotation_std_rad),
            ] {
                self.all(&key(name), value.as_slice(), |v| v >= 0.0, NOT_NEGATIVE)?;
            }
        }
        Ok(())
    }

    pub(super) fn load_cell(&self) -> Result<(), RigFileError> {
        let cell = &self.rig.load_cell;
        let six = |values: &Option<[f64; 6]>| values.map(Vec::from).unwrap_or_default();
        self.all("load_cell.noise_n_nm", &six(&cell.noise_n_nm), |v| v > 0.0, NOISE)?;
        self.positive("load_cell.range_n_nm", &six(&cell.range_n_nm))?;
        self.positive("load_cell.excitation_v", cell.excitation_v.as_slice())?;
        if let Some(id) = cell.board_id.as_ref().filter(|id| !is_number_of_chip(id)) {
            let advice = "must be 24 hexadecimal digits, the `unique_id` that the device gives";
            return Err(self.refuse("load_cell.board_id", id, advice));
        }
        self.all("load_cell.gain_uncertainty", &six(&cell.gain_uncertainty), |v| v >= 0.0, NOT_NEGATIVE)?;
        self.all("load_cell.crosstalk_std", cell.crosstalk_std.as_slice(), |v| v >= 0.0, NOT_NEGATIVE)?;
        self.all("load_cell.drift_std_n_nm", &six(&cell.drift_std_n_nm), |v| v >= 0.0, NOT_NEGATIVE)?;
        self.positive("load_cell.bandwidth_hz", cell.bandwidth_hz.as_slice())?;
        if let OffsetTable::Known(offset) = &cell.offset_n_nm {
            self.finite("load_cell.offset_n_nm", offset)?;
        }
        for row in cell.calibration.iter().flatten() {
            self.finite("load_cell.calibration", row)?;
        }
        self.delay("load_cell.group_delay_s", cell.group_delay_s)
    }
}
