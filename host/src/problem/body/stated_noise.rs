//! Noise that the rig file states of IMU and load cell, beside what their readings show.

use rigident_shared::calibration::Reading;

use super::{CHANNELS, Input};
use crate::fit::StatedNoise;
use crate::problem::white_noise::{certain_noise, sixth_differences};

/// Returns the noise of each channel of the wrench as differences of the readings show it; none of still poses.
pub(super) fn channel_noise(input: &Input) -> Vec<f64> {
    if input.is_static {
        return Vec::new();
    }
    let of = |c: usize| {
        let values = input.readings.iter().map(|r| (r.time_ns, [r.wrench.array()[c]]));
        sixth_differences(&values.collect::<Vec<_>>(), 1)
    };
    (0..CHANNELS.len()).map(of).collect()
}

/// Returns the noise that is stated of each sensor and channel with what differences of the readings show, if they show white noise;
/// nothing of still poses, whose differences are no noise. `stated` is that of accelerometer and gyro.
pub(super) fn stated_noise(input: &Input, stated: [Option<f64>; 2]) -> Vec<StatedNoise> {
    if input.is_static {
        return Vec::new();
    }
    let of = |name: &str, unit: &str, key, stated, found| StatedNoise {
        name: name.to_owned(),
        unit: unit.to_owned(),
        key,
        stated,
        found,
    };
    let found = |get: &dyn Fn(&Reading<f64>) -> [f64; 3]| {
        let signals = input.readings.iter().map(|r| (r.time_ns, get(r)));
        certain_noise(&signals.collect::<Vec<_>>(), 3)
    };
    let accel = stated[0].map(|stated| {
        let found = found(&|r| r.specific_force.array());
        of("accelerometer", "m/s2", "imu.accel_noise_mps2", stated, found)
    });
    let gyro = stated[1].map(|stated| {
        let found = found(&|r| r.angular_rate.array());
        of("gyro", "rad/s", "imu.gyro_noise_radps", stated, found)
    });
    let channel = |(c, stated): (usize, f64)| {
        let values = input.readings.iter().map(|r| (r.time_ns, [r.wrench.array()[c]]));
        let found = certain_noise(&values.collect::<Vec<_>>(), 1);
        of(CHANNELS[c], if c < 3 { "N" } else { "N m" }, "load_cell.noise_n_nm", stated, found)
    };
    let cell = input.channel_sigma.into_iter().flatten().enumerate().map(channel);
    accel.into_iter().chain(gyro).chain(cell).collect()
}
