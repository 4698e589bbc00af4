//! Noise that the rig file states of IMU and load cell, beside what their readings show.

use super::{CHANNELS, Input};
use crate::white_noise::{certain_noise, sixth_differences_of};
use rigident_fit::StatedNoise;

/// Returns the noise of each channel of the wrench as differences of the readings show it; none of still
/// poses.
pub(super) fn channel_noise(input: &Input) -> Vec<f64> {
    if input.is_static {
        return Vec::new();
    }
    let of = |c: usize| sixth_differences_of(&input.readings, |r| (r.time_ns, [r.wrench.array()[c]]), 1);
    (0..CHANNELS.len()).map(of).collect()
}

/// Returns the noise that is stated of each sensor and channel with what differences of the readings show, if
/// they show white noise; nothing of still poses, whose differences are no noise. `stated` is that of
/// accelerometer and gyro.
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
    let accel = stated[0].map(|stated| {
        let found = certain_noise(&input.readings, |r| (r.time_ns, r.specific_force.array()), 3);
        of("accelerometer", "m/s2", "imu.accel_noise_mps2", stated, found)
    });
    let gyro = stated[1].map(|stated| {
        let found = certain_noise(&input.readings, |r| (r.time_ns, r.angular_rate.array()), 3);
        of("gyro", "rad/s", "imu.gyro_noise_radps", stated, found)
    });
    let channel = |(c, stated): (usize, f64)| {
        let found = certain_noise(&input.readings, |r| (r.time_ns, [r.wrench.array()[c]]), 1);
        of(CHANNELS[c], if c < 3 { "N" } else { "N m" }, "load_cell.noise_n_nm", stated, found)
    };
    let cell = input.channel_sigma.into_iter().flatten().enumerate().map(channel);
    accel.into_iter().chain(gyro).chain(cell).collect()
}
