use nalgebra::Vector3;

use super::*;
use crate::tree::ProblemOptions;
use crate::tree::prepare::prepare;
use rigident_io::recording::Recording;
use rigident_io::rig::ImuTable;
use rigident_laboratory::trees::{person_recording, seven_axes, seven_axis_recording, two_links};

fn input(recording: &Recording, model: &rigident_model::Model) -> Input {
    prepare(recording, model, &ProblemOptions::default()).unwrap().input
}

/// Returns the error allowed in a mean over `frames`. Noise of either sign has squares that are exact; of
/// products of n independent ones a mean is off by √(5/n) at most.
fn allowed(frames: usize) -> f64 {
    (25.0 / frames as f64).sqrt()
}

#[test]
fn noise_of_gyros_enters_the_joint_between_them_with_opposite_signs() {
    let model = two_links();
    let mut recording = person_recording(&model, 100.0, 10.0);
    let table = |link| ImuTable { link, gyro_noise_radps: Some(1e-3), ..ImuTable::default() };
    recording.rig.imu = vec![table(0), table(1)];
    let input = input(&recording, &model);
    let noise = signal_noise(&input);
    let k = noise.iter().position(|group| group.name == "gyros").unwrap();
    assert!((noise[k].stated.unwrap() - 1e-3).abs() < 1e-15, "{:?}", noise[k]);
    let sigma: Vec<f64> = (0..noise.len()).map(|j| if j == k { 1e-3 } else { 0.0 }).collect();
    let frames = input.frames.len();
    let noisy = with_noise(&input, 0..frames, &sigma, 3).unwrap();
    let (mut square, mut product) = (0.0, 0.0);
    for (frame, noisy) in input.frames.iter().zip(&noisy) {
        let turn = |frame: &Frame| Vector3::from_column_slice(&frame.rates);
        let joint = turn(noisy) - turn(frame);
        let base = noisy.base.rate - frame.base.rate;
        assert!((base.abs() - Vector3::repeat(1e-3)).norm() < 1e-12);
        assert_eq!(noisy.base.specific_force, frame.base.specific_force);
        let [w, x, y, z] = frame.positions[..] else { panic!("a ball") };
        let q = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        square += joint.norm_squared() * 1e6 / frames as f64;
        product += joint.dot(&(q.inverse() * base)) * 1e6 / frames as f64;
    }
    // Three axes of each gyro, and of the base's alone.
    assert!((square - 6.0).abs() < 3.0 * allowed(frames), "{square}");
    assert!((product + 3.0).abs() < 3.0 * allowed(frames), "{product}");
}

#[test]
fn rates_that_are_slopes_have_the_noise_of_the_positions_and_its_colour() {
    let model = seven_axes();
    let recording = seven_axis_recording(&model, 200.0, 5.0, false, None, 0.0);
    let mut input = input(&recording, &model);
    // Computed positions have none of their own.
    for (k, signal) in input.signals.iter_mut().enumerate() {
        assert_eq!(signal.found, 0.0);
        signal.found = 1e-5 * (k + 1) as f64;
    }
    let noise = signal_noise(&input);
    assert_eq!(noise.len(), 1, "{noise:?}");
    assert_eq!((noise[0].name.as_str(), noise[0].stated), ("joint positions", None));
    let frames = input.frames.len();
    let noisy = with_noise(&input, 0..frames, &[1e-4], 5).unwrap();
    let sizes: Vec<f64> = input.signals.iter().map(|s| s.found / noise[0].found * 1e-4).collect();
    let expected = Polynomial::new(200.0).slope_noise();
    for (k, size) in sizes.into_iter().enumerate() {
        let change: Vec<f64> =
            input.frames.iter().zip(&noisy).map(|(frame, noisy)| noisy.rates[k] - frame.rates[k]).collect();
        let mean = |lag: usize| {
            change.iter().zip(change.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>() / frames as f64
        };
        let square = mean(0) / (size * expected).powi(2);
        assert!((square - 1.0).abs() < allowed(frames), "{k}: {square}");
        // A difference: neighbours two apart have opposite signs.
        assert!(mean(2) < -0.3 * mean(0), "{k}: {} {}", mean(2), mean(0));
    }
}
