//! Recordings with something wrong: what it is, is said.

use nalgebra::{DMatrix, DVector};

use super::super::{Finding, FreeDecay, ModalError, Modes, Options, Role, Severity, identify, spectrum};
use super::support::{NAMES, Normal, System, unit};

const RATE_HZ: f64 = 200.0;
const HZ: [f64; 4] = [0.9, 1.4, 2.3, 3.7];

fn system() -> System {
    System::new(&HZ, &[0.004, 0.006, 0.003, 0.008], 7)
}

fn noisy(system: &System, deflection: &[f64], seconds: f64, sigma: f64, seed: u64) -> DMatrix<f64> {
    let samples = (RATE_HZ * seconds) as usize;
    let mut y = system.decay(&DVector::from_row_slice(deflection), RATE_HZ, samples);
    let channels = y.ncols();
    Normal::new(seed).add(&mut y, &vec![sigma; channels]);
    y
}

fn good() -> DMatrix<f64> {
    noisy(&system(), &[1e-3, 2e-3, -1e-3, 1.5e-3], 20.0, 2e-6, 1)
}

fn run(y: &DMatrix<f64>, modes: Option<usize>) -> Result<Modes, ModalError> {
    let decay = FreeDecay { rate_hz: RATE_HZ, samples: y, names: &NAMES[..y.ncols()] };
    identify(&decay, &Options { modes, ..Options::default() })
}

#[test]
fn a_good_recording_has_no_findings_whether_the_number_of_modes_is_given_or_not() {
    for modes in [Some(4), None] {
        let found = run(&good(), modes).expect("modes");
        assert_eq!(found.shapes.modes.len(), 4);
        assert!(found.findings.is_empty(), "{:?}", found.findings);
    }
}

#[test]
fn a_number_that_is_missing_is_named() {
    let mut y = good();
    y[(400, 2)] = f64::NAN;
    let Err(ModalError::NotFinite { channel, time_s }) = run(&y, None) else { panic!("named") };
    assert_eq!((channel.as_str(), time_s), ("z", 2.0));
}

#[test]
fn clipped_channels_are_named_and_rounded_ones_are_not() {
    let mut y = good();
    let limit = 0.7 * y.column(1).max();
    y.column_mut(1).apply(|v| *v = v.min(limit));
    let Err(ModalError::Clipped { channel, limit: found, .. }) = run(&y, None) else { panic!("named") };
    assert_eq!((channel.as_str(), found), ("y", limit));
    // A converter of coarse steps has flat tops, too: of 5 000 and of 50 steps to the amplitude, with noise
    // below a step.
    for step in [4e-7, 4e-5] {
        let mut y = noisy(&system(), &[1e-3, 2e-3, -1e-3, 1.5e-3], 20.0, 0.3 * step, 1);
        y.apply(|v| *v = (*v / step).round() * step);
        let found = run(&y, Some(4)).expect("modes");
        assert_eq!(found.shapes.modes.len(), 4, "{step}: {:?}", found.findings);
    }
}

#[test]
fn frozen_and_repeated_channels_are_named() {
    let mut y = good();
    let value = y[(1000, 3)];
    y.view_mut((1000, 3), (60, 1)).fill(value);
    let Err(ModalError::Frozen { channel, time_s, duration_s, .. }) = run(&y, None) else { panic!("named") };
    assert_eq!((channel.as_str(), time_s, duration_s), ("rx", 5.0, 0.3));
    let mut y = good();
    y.column_mut(0).fill(0.25);
    assert!(matches!(run(&y, None), Err(ModalError::Frozen { channel, .. }) if channel == "x"));
    let y = good();
    let held = DMatrix::from_fn(y.nrows(), 4, |row, c| y[(row / 5 * 5, c)]);
    assert!(matches!(run(&held, None), Err(ModalError::Repeated { times: 5, .. })));
}

#[test]
fn inputs_that_do_not_fit_together_are_named() {
    let y = good();
    let with = |rate_hz: f64, names: &[&str], options: &Options| {
        identify(&FreeDecay { rate_hz, samples: &y, names }, options)
    };
    let plain = Options::default();
    let names = &NAMES[..4];
    assert!(matches!(with(0.0, names, &plain), Err(ModalError::Input(_))));
    assert!(matches!(with(RATE_HZ, &NAMES[..3], &plain), Err(ModalError::Input(_))));
    let scales = Options { scales: vec![1.0, -1.0, 1.0, 1.0], ..Options::default() };
    assert!(matches!(with(RATE_HZ, names, &scales), Err(ModalError::Input(_))));
    let band = Options { band_hz: Some([2.0, 500.0]), ..Options::default() };
    assert!(matches!(with(RATE_HZ, names, &band), Err(ModalError::Input(_))));
    let short = y.rows(0, 20).into_owned();
    assert!(matches!(run(&short, None), Err(ModalError::TooFew { samples: 20, .. })));
}

#[test]
fn nothing_that_vibrates_is_said_and_noise_is_no_mode() {
    for seed in 0..40 {
        let mut y = DMatrix::zeros(2000, 4);
        Normal::new(seed).add(&mut y, &[1e-6, 1e-5, 2e-6, 1e-4]);
        assert!(matches!(run(&y, Some(4)), Err(ModalError::NothingVibrates { .. })), "seed {seed}");
    }
}

#[test]
fn a_recording_of_one_cycle_is_too_short_and_one_of_three_is_warned_of() {
    let system = System::new(&[0.5], &[0.01], 1);
    let y = noisy(&system, &[1e-3], 2.2, 1e-6, 3);
    assert!(matches!(run(&y, None), Err(ModalError::TooShort { cycles, .. }) if (cycles - 1.1).abs() < 0.2));
    let y = noisy(&system, &[1e-3], 6.0, 1e-6, 3);
    let found = run(&y, None).expect("a mode");
    assert_eq!(found.shapes.modes.len(), 1);
    assert!(
        matches!(found.findings.as_slice(), [Finding::FewCycles { is_refused: false, .. }]),
        "{:?}",
        found.findings
    );
}

#[test]
fn a_mode_that_was_not_excited_is_missing_and_its_direction_is_named() {
    let system = system();
    let (_, shapes) = system.modes();
    // Deflected along three shapes only.
    let deflection = (shapes.column(0) + shapes.column(1) * 0.7 + shapes.column(3) * 0.5) * 2e-3;
    let y = noisy(&system, deflection.as_slice(), 20.0, 2e-6, 4);
    let found = run(&y, Some(4)).expect("modes");
    let Some(Finding::MissingModes { wanted: 4, found: 3, vector, channel, .. }) = found.findings.first()
    else {
        panic!("{:?}", found.findings)
    };
    for k in [0, 1, 3] {
        assert!(unit(&shapes.column(k).into_owned()).dot(&DVector::from_row_slice(vector)).abs() < 1e-2);
    }
    assert_eq!(channel, NAMES[DVector::from_row_slice(vector).iamax()]);
    assert!(!found.is_sound() && found.shapes.modes.len() == 3);
}

#[test]
fn hum_is_a_disturbance_and_a_further_decay_another_line() {
    let mut y = good();
    for row in 0..y.nrows() {
        let t = row as f64 / RATE_HZ;
        y[(row, 2)] += 3e-5 * (std::f64::consts::TAU * 50.0 * t + 0.4).sin();
    }
    let found = run(&y, Some(4)).expect("modes");
    assert_eq!(found.shapes.modes.len(), 4);
    let hum = |f: &Finding| matches!(f, Finding::Disturbance { hz, channel, .. } if (hz - 50.0).abs() < 1e-2 && channel == "z");
    assert!(found.findings.iter().any(hum) && found.is_sound(), "{:?}", found.findings);
    let y = good();
    let found = run(&y, Some(3)).expect("modes");
    let other = |f: &Finding| matches!(f, Finding::OtherLine { hz, .. } if HZ.iter().any(|own| (own - hz).abs() < 1e-2));
    assert!(found.shapes.modes.len() == 3 && found.findings.iter().any(other), "{:?}", found.findings);
}

/// Two modes 1 % apart: in 6 s their frequencies differ by 0.09 of what the length resolves.
#[test]
fn two_close_modes_are_refused_in_a_short_recording_and_parted_in_a_long_one() {
    let system = System::new(&[1.5, 1.515, 3.0], &[0.002, 0.002, 0.004], 9);
    let (omega, shapes) = system.modes();
    for seed in 0..20 {
        let y = noisy(&system, &[1e-3, 2e-3, -1e-3], 6.0, 1e-5, seed);
        let found = run(&y, Some(3)).expect("modes");
        assert!(!found.is_sound(), "seed {seed}: {:?}", found.components);
        let y = noisy(&system, &[1e-3, 2e-3, -1e-3], 60.0, 1e-5, seed);
        let found = run(&y, Some(3)).expect("modes");
        assert!(found.is_sound() && found.shapes.modes.len() == 3, "seed {seed}: {:?}", found.findings);
        for (k, mode) in found.shapes.modes.iter().enumerate() {
            assert!((mode.angular - omega[k]).abs() < 5.0 * mode.angular_sd);
            let off = &mode.shape - unit(&shapes.column(k).into_owned());
            let place = found.shapes.place(k) + 2;
            let sd = found.shapes.covariance.view((place, place), (3, 3)).trace().sqrt();
            assert!(off.norm() < 5.0 * sd && sd < 0.05, "seed {seed}, mode {k}: {} {sd}", off.norm());
        }
    }
}

/// Between both: whatever is given one by one is right within its intervals, over lengths and noise.
#[test]
fn close_modes_are_never_wrong_with_small_deviations() {
    let system = System::new(&[1.5, 1.53, 3.0], &[0.003, 0.002, 0.004], 9);
    let (omega, _) = system.modes();
    let (mut squares, mut count, mut refused) = (0.0, 0, 0);
    for seed in 0..60 {
        let seconds = 4.0 + 0.5 * (seed % 20) as f64;
        let sigma = [3e-6, 3e-5, 2e-4][seed as usize / 20];
        let y = noisy(&system, &[1e-3, 2e-3, -1e-3], seconds, sigma, seed);
        let found = run(&y, Some(3)).expect("modes");
        let close = found.components.iter().filter(|c| matches!(c.role, Role::TooClose(_))).count();
        refused += usize::from(close > 0 || !found.is_sound());
        if found.shapes.modes.len() < 3 {
            continue;
        }
        for (mode, omega) in found.shapes.modes.iter().zip(&omega) {
            let z = (mode.angular - omega) / mode.angular_sd;
            assert!(z.abs() < 5.0, "seed {seed} {seconds} s {sigma}: {z} {:?}", found.components);
            squares += z * z;
            count += 1;
        }
    }
    assert!(count > 30 && refused > 5, "{count} {refused}");
    assert!(squares / f64::from(count) < 1.0 + 4.0 * (2.0 / f64::from(count)).sqrt());
}

#[test]
fn findings_weigh_and_speak() {
    let finding = Finding::FewCycles { hz: 0.5, cycles: 1.2, needed_s: 10.0, is_refused: true };
    assert_eq!(finding.severity(), Severity::Error);
    assert!(finding.to_string().contains("left out"));
}

#[test]
fn the_spectrum_has_lines_where_modes_are_and_the_power_of_noise() {
    let y = good();
    let decay = FreeDecay { rate_hz: RATE_HZ, samples: &y, names: &NAMES[..4] };
    let spectrum = spectrum(&decay, 10.0).expect("a spectrum");
    for hz in HZ {
        let row = (hz * 10.0).round() as usize;
        let around = |row: usize| spectrum.density.row(row).norm();
        assert!((spectrum.hz[row] - hz).abs() < 1e-9 && around(row) > 3.0 * around(row + 3), "{hz}");
    }
    let mut noise = DMatrix::zeros(20_000, 1);
    Normal::new(8).add(&mut noise, &[2e-3]);
    let decay = FreeDecay { rate_hz: RATE_HZ, samples: &noise, names: &NAMES[..1] };
    let spectrum = super::super::spectrum(&decay, 2.0).expect("a spectrum");
    // Variance σ² over the band up to half the rate.
    let power = spectrum.density.column(0).norm_squared() / 2.0;
    assert!((power / 4e-6 - 1.0).abs() < 0.05, "{power}");
}
