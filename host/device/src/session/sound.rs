//! The evidence of the readings of a run about the sensors that the device read: channels that are dead,
//! readings that no motion takes.
//!
//! The device sees a reading and those before it; a spike is recognised by those after it too, and a dead
//! channel by the whole run.

use rigident_shared::calibration::Reading;

use super::Take;
use rigident_io::recording::{ImuColumns, Recording};
use rigident_io::rig::RigFile;

/// Returns the readings of one body as a recording.
pub fn recording(name: &str, rig: &RigFile, rate_hz: f64, readings: &[Reading<f64>]) -> Recording {
    let imu = ImuColumns {
        accel: Some(readings.iter().map(|r| r.specific_force.array()).collect()),
        gyro: Some(readings.iter().map(|r| r.angular_rate.array()).collect()),
    };
    Recording {
        name: name.to_owned(),
        rig: rig.clone(),
        rate_hz: Some(rate_hz),
        time_ns: readings.iter().map(|r| r.time_ns).collect(),
        wrench: Some(readings.iter().map(|r| r.wrench.array()).collect()),
        imus: vec![imu],
        ..Recording::default()
    }
}

/// Leaves out of a take what its recording shows to be wrong: spikes of an IMU, which the device's factor
/// holds still, so that it is dropped; a channel that is dead breaks the take. Returns what was left out, in
/// words.
pub fn judge(recording: &mut Recording, take: &mut Take) -> Vec<String> {
    let left_out = leave_out_bad_readings(recording, &mut take.readings);
    if !left_out.is_empty() {
        take.factor = None;
    }
    if let Some(dead) = dead(recording) {
        take.broken.get_or_insert(dead);
    }
    left_out
}

/// Says which channels of a run never changed; `None` if all did, or nothing shows that they should have.
pub fn dead(recording: &Recording) -> Option<String> {
    let dead = recording.dead_channels();
    (!dead.is_empty()).then(|| {
        format!(
            "{} never changed, to the last digit, while the other channels of the same sensor have noise: \
             dead, or not connected; check that sensor's cable and supply",
            dead.join(", ")
        )
    })
}

/// Leaves out the rows of a run in which an IMU's channel is far off, and the readings of one body that they
/// are; returns what was left out, in words. The device's factor holds these rows still.
pub fn leave_out_bad_readings(recording: &mut Recording, readings: &mut Vec<Reading<f64>>) -> Vec<String> {
    recording.leave_out_bad_readings();
    let said = std::mem::take(&mut recording.warnings);
    if !said.is_empty() {
        readings.retain(|reading| recording.time_ns.binary_search(&reading.time_ns).is_ok());
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

    /// Returns two seconds at 200/s of channels with noise, but for a gyro's axis.
    fn readings(gyro_y: impl Fn(usize) -> f64) -> Vec<Reading<f64>> {
        let noise = |k: usize, c: usize| ((k * 7919 + c * 104_729) as f64 * 0.618_033_988_75).fract() - 0.5;
        (0..400)
            .map(|k| Reading {
                time_ns: 5_000_000 * k as u64,
                wrench: Wrench::from_array(std::array::from_fn(|c| noise(k, c))),
                specific_force: SpecificForce::new(noise(k, 6), noise(k, 7), 9.8 + noise(k, 8)),
                angular_rate: AngularRate::new(noise(k, 9), gyro_y(k), noise(k, 10)),
            })
            .collect()
    }

    #[test]
    fn a_dead_axis_of_a_gyro_is_named_and_a_spike_left_out() {
        let rig = RigFile::default();
        let of = |gyro_y: &dyn Fn(usize) -> f64| recording("run", &rig, 200.0, &readings(gyro_y));
        let said = dead(&of(&|_| 0.0)).unwrap();
        assert!(said.starts_with("imu_gy_radps never changed"), "{said}");
        let alive = |k: usize| ((k * 31) as f64 * 0.618_033_988_75).fract();
        assert_eq!(dead(&of(&alive)), None);
        let mut taken = readings(|k| if k == 200 { 35.0 } else { alive(k) });
        let mut spoilt = recording("run", &rig, 200.0, &taken);
        let said = leave_out_bad_readings(&mut spoilt, &mut taken);
        assert!(said.len() == 1 && said[0].contains("imu_gy_radps"), "{said:?}");
        // With the readings beside it, which it makes appear far off, too.
        assert!((397..400).contains(&taken.len()) && spoilt.rows() == taken.len(), "{}", taken.len());
        assert!(taken.iter().all(|r| r.time_ns != 200 * 5_000_000));
        assert!(leave_out_bad_readings(&mut spoilt, &mut taken).is_empty());
    }
}
