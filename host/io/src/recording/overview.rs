//! A recording at a glance, before anything is identified from it: rows, rate, gaps, and how much it moves
//! and turns.

use serde::Serialize;

use super::{GAP, Recording};

/// The content of a recording, and what its motion lets be seen.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Overview {
    /// Rows.
    pub rows: usize,
    /// Rows are still poses without time.
    pub is_static: bool,
    /// Measured rate, 1/s.
    pub rate_hz: Option<f64>,
    /// From the first row to the last, s.
    pub duration_s: Option<f64>,
    /// Steps of the time that are longer than 1.5 periods.
    pub gaps: usize,
    /// The longest of them, s; zero without one.
    pub longest_gap_s: f64,
    /// Columns that have a meaning here, with the time.
    pub columns: Vec<String>,
    /// Root mean square of the first IMU's angular rate about each of its axes, rad/s.
    pub rate_rms_radps: Option<[f64; 3]>,
    /// Angles by which the direction of gravity moves over the body about the most and the second most tilted
    /// axis, 1 σ, rad: from the gravity columns or the first accelerometer. Both are needed for all of the
    /// centre of mass.
    pub tilt_rms_rad: Option<[f64; 2]>,
    /// Mean length of the measured force, N.
    pub force_n: Option<f64>,
}

impl Recording {
    /// Returns the recording at a glance.
    pub fn overview(&self) -> Overview {
        let period_s = self.rate_hz.map(|rate| 1.0 / rate);
        let steps = self.time_ns.windows(2).map(|w| (w[1] - w[0]) as f64 * 1e-9);
        let long: Vec<f64> = steps.filter(|step| period_s.is_some_and(|p| *step > GAP * p)).collect();
        let imu = self.imus.first();
        let accel = imu.and_then(|imu| imu.accel.as_ref());
        Overview {
            rows: self.rows(),
            is_static: self.is_static,
            rate_hz: self.rate_hz,
            duration_s: self
                .time_ns
                .first()
                .zip(self.time_ns.last())
                .map(|(first, last)| (last - first) as f64 * 1e-9),
            gaps: long.len(),
            longest_gap_s: long.iter().copied().fold(0.0, f64::max),
            columns: self.column_names(),
            rate_rms_radps: imu.and_then(|imu| imu.gyro.as_ref()).map(|rows| rms(rows)),
            tilt_rms_rad: self.gravity.as_ref().or(accel).and_then(|rows| tilts(rows)),
            force_n: self.wrench.as_ref().filter(|rows| !rows.is_empty()).map(|rows| {
                let length = |row: &[f64; 6]| (row[0].powi(2) + row[1].powi(2) + row[2].powi(2)).sqrt();
                rows.iter().map(length).sum::<f64>() / rows.len() as f64
            }),
        }
    }
}

/// Returns the root mean square of each column; NaN without rows.
fn rms(rows: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|k| (rows.iter().map(|row| row[k].powi(2)).sum::<f64>() / rows.len() as f64).sqrt())
}

/// Returns how far directions spread: the two larger standard deviations of the unit vectors over their three
/// principal axes. A direction that never changes gives zeros, one that turns in a plane one zero.
fn tilts(rows: &[[f64; 3]]) -> Option<[f64; 2]> {
    use nalgebra::{Matrix3, Vector3};
    let units = rows.iter().filter_map(|row| Vector3::from(*row).try_normalize(1e-9));
    let units: Vec<Vector3<f64>> = units.filter(|unit| unit.iter().all(|x| x.is_finite())).collect();
    let count = units.len() as f64;
    let mean = units.iter().sum::<Vector3<f64>>() / count;
    let spread = units.iter().map(|unit| (unit - mean) * (unit - mean).transpose()).sum::<Matrix3<f64>>();
    let mut variances: Vec<f64> = (spread / count).symmetric_eigenvalues().iter().copied().collect();
    variances.sort_by(|a, b| b.total_cmp(a));
    let first = *variances.first().filter(|v| v.is_finite())?;
    Some([first.max(0.0).sqrt(), variances.get(1)?.max(0.0).sqrt()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::RigFile;

    /// A body that is tilted by ±0.1 rad about one axis, a gap of three periods in the middle.
    #[test]
    fn rate_gaps_and_motion_are_seen() {
        let mut text = "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,\
                        imu_gx_radps,imu_gy_radps,imu_gz_radps\n"
            .to_owned();
        for k in 0..400 {
            let row = if k < 200 { k } else { k + 2 };
            let t = f64::from(row) * 0.01;
            let angle = if k % 2 == 0 { 0.1_f64 } else { -0.1 };
            let (y, z) = (9.8 * angle.sin(), 9.8 * angle.cos());
            text += &format!("{t:.2},0,0,20,0,0,0,0,{y},{z},{},0,0\n", if k % 2 == 0 { 0.5 } else { -0.5 });
        }
        let recording = Recording::from_csv_bytes("a.csv", text.as_bytes(), &RigFile::default()).unwrap();
        let seen = recording.overview();
        assert_eq!((seen.rows, seen.gaps, seen.rate_hz), (400, 1, Some(100.0)));
        assert!((seen.longest_gap_s - 0.03).abs() < 1e-9);
        assert_eq!(seen.rate_rms_radps, Some([0.5, 0.0, 0.0]));
        let [most, second] = seen.tilt_rms_rad.unwrap();
        assert!((most - 0.1_f64.sin()).abs() < 1e-9 && second < 1e-6, "{most} {second}");
        assert_eq!(seen.force_n, Some(20.0));
        assert_eq!(Recording::default().overview().tilt_rms_rad, None);
    }
}
