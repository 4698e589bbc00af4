//! Commanded against measured motion.

use hexapod::{Pose, Trajectory};

use super::MotionSample;
use rigident_identify::answer::Tracking;

/// The longest delay that is searched for, s.
const LONGEST_S: f64 = 0.6;
/// A rotation counts in the search for the delay as the way of a point so far from the axis, m.
const ARM_M: f64 = 0.25;

/// Returns measured less commanded: the way, and the rotation vector of `R_measured R_commandedᵀ`, in A.
pub fn difference(commanded: &Pose, measured: &Pose) -> [f64; 6] {
    let (c, m) = (commanded.rotation(), measured.rotation());
    let turn = |i: usize, j: usize| (0..3).map(|k| m[i][k] * c[j][k]).sum::<f64>();
    // sin(angle) axis, and the angle itself by its sine and cosine.
    let axis =
        [0.5 * (turn(2, 1) - turn(1, 2)), 0.5 * (turn(0, 2) - turn(2, 0)), 0.5 * (turn(1, 0) - turn(0, 1))];
    let sine = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
    let cosine = 0.5 * (turn(0, 0) + turn(1, 1) + turn(2, 2) - 1.0);
    let stretch = if sine > 1e-9 { sine.atan2(cosine) / sine } else { 1.0 };
    std::array::from_fn(|i| {
        if i < 3 { measured.position_m[i] - commanded.position_m[i] } else { axis[i - 3] * stretch }
    })
}

fn differences(trajectory: &Trajectory, measured: &[(f64, Pose)], delay_s: f64) -> Vec<[f64; 6]> {
    measured.iter().map(|(t, pose)| difference(&trajectory.state(t - delay_s).pose(), pose)).collect()
}

fn rms(differences: &[[f64; 6]]) -> [f64; 6] {
    let n = differences.len() as f64;
    std::array::from_fn(|i| (differences.iter().map(|d| d[i] * d[i]).sum::<f64>() / n).sqrt())
}

fn halves(six: [f64; 6]) -> ([f64; 3], [f64; 3]) {
    let [a, b, c, d, e, f] = six;
    ([a, b, c], [d, e, f])
}

/// Compares what was measured with the program; `None` if nothing was measured.
pub fn compare(trajectory: &Trajectory, samples: &[MotionSample]) -> Option<Tracking> {
    let measured: Vec<(f64, Pose)> =
        samples.iter().filter_map(|s| s.measured.map(|m| (s.time_s, m))).collect();
    if measured.is_empty() {
        return None;
    }
    let cost = |delay_s: f64| {
        let (m, rad) = halves(rms(&differences(trajectory, &measured, delay_s)));
        m.iter().map(|v| v * v).sum::<f64>() + rad.iter().map(|v| (ARM_M * v).powi(2)).sum::<f64>()
    };
    // The best of a grid, then closer by thirds.
    let grid = 60;
    let step = LONGEST_S / f64::from(grid);
    let best = (0..=grid)
        .map(|k| step * f64::from(k))
        .map(|delay| (delay, cost(delay)))
        .fold((0.0, f64::INFINITY), |best, now| if now.1 < best.1 { now } else { best });
    let [mut low, mut high] = [best.0 - step, best.0 + step];
    for _ in 0..30 {
        let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
        if cost(a) < cost(b) { high = b } else { low = a }
    }
    let delay_s = 0.5 * (low + high);
    let plain = differences(trajectory, &measured, 0.0);
    let (rms_m, rms_rad) = halves(rms(&plain));
    let (rms_without_delay_m, rms_without_delay_rad) =
        halves(rms(&differences(trajectory, &measured, delay_s)));
    let largest = |part: fn(&[f64; 6]) -> f64| plain.iter().map(part).fold(0.0, f64::max).sqrt();
    Some(Tracking {
        samples: measured.len() as u64,
        rms_m,
        rms_rad,
        largest_m: largest(|d| d[0] * d[0] + d[1] * d[1] + d[2] * d[2]),
        largest_rad: largest(|d| d[3] * d[3] + d[4] * d[4] + d[5] * d[5]),
        delay_s,
        rms_without_delay_m,
        rms_without_delay_rad,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexapod::{Axis, Geometry, MotionProgram, Segment, SineTerm};

    #[test]
    fn a_delay_and_a_constant_error_are_distinguished() {
        let home = Geometry::thesis().home();
        let term = |axis, amplitude, frequency_hz| SineTerm { axis, amplitude, frequency_hz, phase_rad: 0.3 };
        let program = MotionProgram {
            start: home,
            segments: vec![Segment::Multisine {
                duration_s: 20.0,
                ramp_s: 1.0,
                terms: vec![term(Axis::X, 0.02, 0.7), term(Axis::Roll, 0.1, 0.5)],
            }],
        };
        let trajectory = program.trajectory().unwrap();
        let samples: Vec<MotionSample> = (0..400)
            .map(|k| {
                let time_s = f64::from(k) * 0.05;
                let commanded = trajectory.state(time_s).pose();
                let mut late = trajectory.state(time_s - 0.085).pose();
                late.position_m[1] += 0.002;
                MotionSample { time_s, commanded, measured: Some(late) }
            })
            .collect();
        let tracking = compare(&trajectory, &samples).unwrap();
        assert!((tracking.delay_s - 0.085).abs() < 1e-6, "{tracking:?}");
        assert!((tracking.rms_m[1] - 0.002).abs() < 1e-12);
        assert!(tracking.rms_without_delay_m[0] < 1e-6 && tracking.rms_without_delay_rad[0] < 1e-6);
        // Where the ramps are over: amplitude · 2 sin(π f τ) / √2, over 19 of 20 s or so.
        let expected = 0.1 * 2.0 * (std::f64::consts::PI * 0.5 * 0.085).sin() / 2.0_f64.sqrt();
        assert!((tracking.rms_rad[0] / expected - 1.0).abs() < 0.05, "{tracking:?}");
        assert!(compare(&trajectory, &[]).is_none());
    }

    #[test]
    fn the_attitudes_difference_is_the_rotation_between_them() {
        let pose = |rpy_rad| Pose { position_m: [0.0; 3], rpy_rad };
        // From a yaw of a right angle, a further roll about the fixed x.
        let from = pose([0.0, 0.0, std::f64::consts::FRAC_PI_2]);
        let to = pose([0.2, 0.0, std::f64::consts::FRAC_PI_2]);
        let d = difference(&from, &to);
        // R = Rz Rx(0.2), Rzᵀ: the rotation about A's y.
        for (i, expected) in [(3, 0.0), (4, 0.2), (5, 0.0)] {
            assert!((d[i] - expected).abs() < 1e-12, "{d:?}");
        }
    }
}
