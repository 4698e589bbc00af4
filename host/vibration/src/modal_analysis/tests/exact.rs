//! Noise-free decays of known systems.

use nalgebra::DVector;

use super::super::{FreeDecay, Options, identify};
use super::support::{NAMES, Normal, System, unit};

fn check(hz: &[f64], ratios: &[f64], rate_hz: f64, duration_s: f64) {
    let system = System::new(hz, ratios, 3);
    let n = hz.len();
    let deflection = DVector::from_fn(n, |k, _| 1e-3 * (1.0 + 0.7 * (k as f64).sin()));
    let mut y = system.decay(&deflection, rate_hz, (rate_hz * duration_s) as usize);
    for (c, mut column) in y.column_iter_mut().enumerate() {
        column.add_scalar_mut(0.01 * c as f64);
    }
    let decay = FreeDecay { rate_hz, samples: &y, names: &NAMES[..n] };
    let found = identify(&decay, &Options { modes: Some(n), ..Options::default() }).expect("modes");
    let (omega, shapes) = system.modes();
    assert_eq!(found.shapes.modes.len(), n);
    for (k, mode) in found.shapes.modes.iter().enumerate() {
        let error = (mode.angular / omega[k] - 1.0).abs();
        let ratio = ratios[k];
        let off = (&mode.shape - unit(&shapes.column(k).into_owned())).norm();
        assert!(error < 1e-9 && off < 1e-8 && (mode.damping - ratio).abs() < 1e-9, "mode {k}");
    }
    assert!(found.findings.is_empty(), "{:?}", found.findings);
}

#[test]
fn modes_of_a_platform_are_exact_without_noise() {
    check(&[0.7, 0.9, 1.3, 2.2, 3.1, 4.0], &[0.002, 0.003, 0.01, 0.004, 0.02, 0.001], 1000.0, 10.0);
}

#[test]
fn modes_of_widely_different_damping_are_exact_without_noise() {
    check(&[0.7, 1.5, 1.9, 2.2, 8.1, 14.0], &[0.0005, 0.1, 0.01, 0.1, 0.0005, 0.05], 200.0, 20.0);
}

#[test]
fn modes_two_hundredths_apart_are_exact_without_noise() {
    check(&[1.0, 1.02, 1.04, 3.0, 3.06, 5.0], &[0.003, 0.004, 0.003, 0.01, 0.002, 0.001], 100.0, 60.0);
}

/// Six channels of a thousand samples a second for ten seconds, with noise of a thousandth and a hundred
/// thousandth of the amplitude.
#[test]
fn a_platform_of_six_coordinates_has_its_six_modes_under_noise() {
    let system = System::new(&[0.7, 0.9, 1.3, 2.2, 3.1, 4.0], &[0.002, 0.003, 0.01, 0.004, 0.02, 0.001], 3);
    let deflection = DVector::from_row_slice(&[2e-3, -1e-3, 1e-3, 1e-3, 2e-3, -1e-3]);
    let clean = system.decay(&deflection, 1000.0, 10_000);
    let (omega, _) = system.modes();
    for sigma in [1e-8, 1e-6] {
        let mut y = clean.clone();
        Normal::new(4).add(&mut y, &[sigma; 6]);
        let decay = FreeDecay { rate_hz: 1000.0, samples: &y, names: &NAMES };
        let found = identify(&decay, &Options { modes: Some(6), ..Options::default() }).expect("modes");
        assert!(found.findings.is_empty() && found.shapes.modes.len() == 6, "{:?}", found.findings);
        for (mode, omega) in found.shapes.modes.iter().zip(&omega) {
            assert!((mode.angular - omega).abs() < 4.5 * mode.angular_sd);
            assert!(mode.imaginary_share < 1e-2 && mode.collinearity > 0.999);
        }
    }
}
