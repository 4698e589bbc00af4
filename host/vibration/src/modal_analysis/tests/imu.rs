//! An IMU's signals of a motion that is written out, without small angles in it.

use nalgebra::{Complex, DMatrix, DVector, Matrix3, Rotation3, Vector3};

use super::super::{FreeDecay, Imu, Modes, Options, identify, platform_amplitudes, shapes};
use super::support::Normal;

const NAMES: [&str; 6] = ["fx", "fy", "fz", "wx", "wy", "wz"];
const RATE_HZ: f64 = 100.0;
/// Decay and damped angular frequency.
const POLES: [(f64, f64); 3] = [(0.05, 5.0), (0.12, 8.3), (0.08, 13.0)];

fn imu() -> Imu {
    Imu {
        lever: Vector3::new(0.4, -0.2, 0.15),
        axes: *Rotation3::from_euler_angles(0.3, -0.5, 1.1).matrix(),
        // The platform hangs a little out of level.
        gravity: Rotation3::from_euler_angles(0.02, -0.03, 0.0) * Vector3::new(0.0, 0.0, -9.80665),
    }
}

/// Returns complex amplitudes of x and θ, of about 10⁻⁵ m and rad.
fn truth() -> DMatrix<Complex<f64>> {
    let shape =
        [[1.0, 0.2, -0.3, 0.5, 1.2, 0.1], [0.3, -1.0, 0.4, -0.9, 0.2, 0.6], [0.2, 0.5, 1.0, 0.4, -0.3, 0.8]];
    let phase = [0.3, -0.2, 1.0];
    DMatrix::from_fn(6, 3, |c, r| Complex::from_polar(1e-5 * shape[r][c], phase[r]))
}

fn pose(t: f64) -> (Vector3<f64>, Matrix3<f64>) {
    let truth = truth();
    let q = DVector::from_fn(6, |c, _| {
        let of = |r: usize| (truth[(c, r)] * Complex::new(-POLES[r].0 * t, POLES[r].1 * t).exp()).re;
        (0..3).map(of).sum::<f64>()
    });
    let rotation = Rotation3::new(Vector3::new(q[3], q[4], q[5]));
    (Vector3::new(q[0], q[1], q[2]), *rotation.matrix())
}

/// Returns `Rᵀ(r̈ − g)` and the rate of `Rᵀ Ṙ`, by differences over five points, in the IMU's axes.
fn signals(seconds: f64) -> DMatrix<f64> {
    let imu = imu();
    let h = 4e-3;
    let at = |t: f64| {
        let (x, rotation) = pose(t);
        (x + rotation * imu.lever, rotation)
    };
    DMatrix::from_row_iterator(
        (RATE_HZ * seconds) as usize,
        6,
        (0..(RATE_HZ * seconds) as usize).flat_map(|k| {
            let t = k as f64 / RATE_HZ;
            let [a, b, c, d, e] = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|n| at(t + n * h));
            let second = (-a.0 + b.0 * 16.0 - c.0 * 30.0 + d.0 * 16.0 - e.0) / (12.0 * h * h);
            let force = imu.axes.transpose() * c.1.transpose() * (second - imu.gravity);
            let turning = c.1.transpose() * (a.1 - b.1 * 8.0 + d.1 * 8.0 - e.1) / (12.0 * h);
            let rate = Vector3::new(turning[(2, 1)], turning[(0, 2)], turning[(1, 0)]);
            let rate = imu.axes.transpose() * rate;
            [force.x, force.y, force.z, rate.x, rate.y, rate.z]
        }),
    )
}

fn run(y: &DMatrix<f64>) -> Modes {
    let decay = FreeDecay { rate_hz: RATE_HZ, samples: y, names: &NAMES };
    identify(&decay, &Options { modes: Some(3), ..Options::default() }).expect("modes")
}

#[test]
fn a_motion_is_found_again_from_the_readings_of_an_imu() {
    let found = run(&signals(20.0));
    assert_eq!(found.shapes.modes.len(), 3);
    let platform = platform_amplitudes(&imu(), &found.amplitudes).expect("six channels");
    let off = &platform.complex - truth();
    // Angles of 10⁻⁵ leave parts of 10⁻⁵ that are not linear, with gravity over ω² of 0.4 m in them.
    assert!(off.map(|z| z.norm()).max() < 1e-4 * 1e-5, "{off}");
    let shapes = shapes(&platform, &[]).expect("shapes");
    for (r, mode) in shapes.modes.iter().enumerate() {
        let wanted = truth().column(r).map(|z| z.norm()).normalize();
        assert!((mode.shape.map(f64::abs) - wanted).norm() < 1e-4);
    }
}

#[test]
fn covariance_of_the_platforms_amplitudes_holds() {
    let clean = signals(12.0);
    let truth = truth();
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in 0..60 {
        let mut y = clean.clone();
        Normal::new(seed).add(&mut y, &[2e-6, 2e-6, 2e-6, 1e-6, 1e-6, 1e-6]);
        let found = run(&y);
        assert_eq!(found.shapes.modes.len(), 3);
        let platform = platform_amplitudes(&imu(), &found.amplitudes).expect("six channels");
        let error = DVector::from_fn(3 * 14, |k, _| {
            let (r, place) = (k / 14, k % 14);
            let pole = Complex::new(-POLES[r].0, POLES[r].1);
            let off = |c: usize| platform.complex[(c, r)] - truth[(c, r)];
            match place {
                0 => platform.angular[r] - pole.norm(),
                1 => platform.damping[r] - POLES[r].0 / pole.norm(),
                2..8 => off(place - 2).re,
                _ => off(place - 8).im,
            }
        });
        let scale = platform.covariance.diagonal().map(|d| 1.0 / d.sqrt());
        let scaled = DMatrix::from_fn(42, 42, |i, j| platform.covariance[(i, j)] * scale[i] * scale[j]);
        let inverse = scaled.cholesky().expect("positive").inverse();
        let error = error.component_mul(&scale);
        squares += (error.transpose() * inverse * &error)[(0, 0)];
        count += 42.0;
    }
    let mean = squares / count;
    let four = 4.0 * (2.0_f64 / count).sqrt();
    assert!(mean < 1.0 + four && mean > 1.0 / 1.15 - four, "{mean}");
}

#[test]
fn channels_and_axes_that_cannot_be_are_named() {
    let found = run(&signals(12.0));
    let mut bad = imu();
    bad.axes *= 1.1;
    assert!(platform_amplitudes(&bad, &found.amplitudes).is_err());
    let mut few = found.amplitudes.clone();
    few.complex = few.complex.rows(0, 3).into_owned();
    assert!(platform_amplitudes(&imu(), &few).is_err());
}
