//! Springs with a cubic part: said at a large amplitude, not at a small one, and never of linear springs.

use nalgebra::{DMatrix, DVector};

use super::super::{Finding, FreeDecay, Modes, Options, identify};
use super::support::{NAMES, Normal, System};
use crate::study_length::runs;

const RATE_HZ: f64 = 200.0;

/// Returns Duffing's decay of two coupled masses by Runge's and Kutta's method: `k x + β x³` in each spring
/// to the ground.
fn cubic(beta: f64, amplitude: f64, seconds: f64) -> DMatrix<f64> {
    let steps = 20;
    let (k1, k2, k12, c) = (90.0, 160.0, 25.0, 0.15);
    let force = |s: [f64; 4]| {
        let pull = k12 * (s[0] - s[1]);
        [
            s[2],
            s[3],
            -k1 * s[0] - beta * s[0].powi(3) - pull - c * s[2],
            -k2 * s[1] - beta * s[1].powi(3) + pull - c * s[3],
        ]
    };
    let moved = |s: [f64; 4], d: [f64; 4], h: f64| std::array::from_fn::<f64, 4, _>(|k| s[k] + h * d[k]);
    let h = 1.0 / (RATE_HZ * f64::from(steps));
    let mut state = [amplitude, 0.4 * amplitude, 0.0, 0.0];
    let samples = (RATE_HZ * seconds) as usize;
    let mut y = DMatrix::zeros(samples, 2);
    for row in 0..samples {
        y[(row, 0)] = state[0];
        y[(row, 1)] = state[1];
        for _ in 0..steps {
            let a = force(state);
            let b = force(moved(state, a, 0.5 * h));
            let c = force(moved(state, b, 0.5 * h));
            let d = force(moved(state, c, h));
            state = std::array::from_fn(|k| state[k] + h / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]));
        }
    }
    y
}

fn run(beta: f64, amplitude: f64, seed: u64) -> Modes {
    let mut y = cubic(beta, amplitude, 20.0);
    Normal::new(seed).add(&mut y, &[2e-5, 2e-5]);
    let decay = FreeDecay { rate_hz: RATE_HZ, samples: &y, names: &NAMES[..2] };
    identify(&decay, &Options { modes: Some(2), ..Options::default() }).expect("modes")
}

#[test]
fn cubic_springs_are_said_at_large_amplitudes_with_shift_and_harmonic() {
    // 3 β A² / 8 k = 0.4 % of the frequency, 1.7 % and 6.7 %.
    for (amplitude, least) in [(0.02, 5e-4), (0.04, 2e-3), (0.08, 8e-3)] {
        for seed in 0..runs(5, 1) {
            let found = run(2500.0, amplitude, seed);
            let said = found.findings.iter().any(|f| match f {
                Finding::LargeAmplitude { shift, limit, .. }
                | Finding::FrequencyShift { shift, limit, .. } => *shift > least && shift > limit,
                _ => false,
            });
            assert!(said, "amplitude {amplitude}, seed {seed}: {:?}", found.findings);
        }
    }
    let found = run(2500.0, 0.04, 1);
    assert!(
        found
            .findings
            .iter()
            .any(|f| matches!(f, Finding::LargeAmplitude { smaller_by, .. } if *smaller_by > 2.0))
            && !found.is_sound(),
        "{:?}",
        found.findings
    );
}

#[test]
fn the_same_springs_at_a_small_amplitude_are_linear() {
    let mut said = 0;
    for seed in 0..30 {
        let found = run(2500.0, 0.0015, seed);
        assert_eq!(found.shapes.modes.len(), 2);
        said += usize::from(!found.findings.is_empty());
    }
    assert!(said <= 1, "{said}");
}

/// Each test of a run is made so that noise alone gives a finding in less than one of a thousand runs. More
/// than two in 200 have a probability of 0.1 % then.
#[test]
fn linear_springs_are_not_blamed() {
    let system = System::new(&[0.8, 1.1, 1.7, 2.9], &[0.003, 0.01, 0.006, 0.02], 21);
    let clean = system.decay(&DVector::from_row_slice(&[2e-3, 1e-3, -2e-3, 1e-3]), 100.0, 1200);
    let mut said = 0;
    for seed in 0..runs(200, 20) {
        let mut y = clean.clone();
        Normal::new(500 + seed).add(&mut y, &[1e-5, 2e-5, 5e-6, 1e-5]);
        let decay = FreeDecay { rate_hz: 100.0, samples: &y, names: &NAMES[..4] };
        let found = identify(&decay, &Options { modes: Some(4), ..Options::default() }).expect("modes");
        assert_eq!(found.shapes.modes.len(), 4, "seed {seed}");
        if !found.findings.is_empty() {
            said += 1;
        }
    }
    assert!(said <= 2, "{said}");
}
