//! Noise of an IMU: what its readings show, or the rig file states.

use rigident_shared::calibration::Reading;
use rigident_shared::forgetting::ImuNoise;

use crate::white_noise::sixth_differences_of;
use rigident_io::rig::ImuTable;

/// Noise of an IMU of which nothing is known: of a good consumer one.
const TYPICAL: ImuNoise<f64> = ImuNoise { accel: 0.02, gyro: 4.3e-4 };

/// Returns the noise of the IMU: the larger of the rig file's and that of these readings, because noise that
/// is taken for motion winds the memory up. Without either, it is the noise of a good consumer IMU.
pub fn imu_noise(imu: Option<&ImuTable>, readings: &[Reading<f64>]) -> ImuNoise<f64> {
    let larger = |stated: Option<f64>, shown: f64, typical: f64| {
        let found = stated.unwrap_or(0.0).max(shown);
        if found > 0.0 { found } else { typical }
    };
    ImuNoise {
        accel: larger(
            imu.and_then(|imu| imu.accel_noise_mps2),
            second_differences(readings, |r| r.specific_force.array()),
            TYPICAL.accel,
        ),
        gyro: larger(
            imu.and_then(|imu| imu.gyro_noise_radps),
            second_differences(readings, |r| r.angular_rate.array()),
            TYPICAL.gyro,
        ),
    }
}

/// Returns the noise of the IMU that rows are weighed by: the rig file's; where it states none, sixth
/// differences of the readings.
pub fn white_imu_noise(imu: Option<&ImuTable>, readings: &[Reading<f64>]) -> ImuNoise<f64> {
    let found = |of: fn(&Reading<f64>) -> [f64; 3]| sixth_differences_of(readings, |r| (r.time_ns, of(r)), 3);
    ImuNoise {
        accel: imu
            .and_then(|imu| imu.accel_noise_mps2)
            .unwrap_or_else(|| found(|r| r.specific_force.array())),
        gyro: imu.and_then(|imu| imu.gyro_noise_radps).unwrap_or_else(|| found(|r| r.angular_rate.array())),
    }
}

/// Returns σ of the gyro from second differences, rad/s.
pub fn gyro_sigma(readings: &[Reading<f64>]) -> f64 {
    second_differences(readings, |r| r.angular_rate.array())
}

/// Returns σ of a sensor, the largest of its axes, from second differences: motion hardly enters, noise by
/// √6.
pub fn second_differences(readings: &[Reading<f64>], of: impl Fn(&Reading<f64>) -> [f64; 3]) -> f64 {
    let mut sums = [0.0; 3];
    let mut count = 0_u32;
    for triple in readings.windows(3) {
        let [a, b, c] = triple else { continue };
        let (a, b, c) = (of(a), of(b), of(c));
        for ((sum, (a, b)), c) in sums.iter_mut().zip(a.iter().zip(b)).zip(c) {
            *sum += (a - 2.0 * b + c).powi(2);
        }
        count += 1;
    }
    let largest = sums.iter().copied().fold(0.0, f64::max);
    if count == 0 || !largest.is_finite() { 0.0 } else { (largest / (6.0 * f64::from(count))).sqrt() }
}
