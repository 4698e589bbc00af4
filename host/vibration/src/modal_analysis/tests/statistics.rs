//! Intervals over many noisy decays.

use nalgebra::{DMatrix, DVector};

use super::super::{FreeDecay, Modes, Options, identify};
use super::support::{NAMES, Normal, System, unit};
use crate::study_length::runs;

const RATE_HZ: f64 = 100.0;
const SECONDS: f64 = 10.0;
const HZ: [f64; 3] = [1.1, 1.7, 3.2];
const RATIOS: [f64; 3] = [0.01, 0.004, 0.02];
const SIGMA: [f64; 3] = [3e-5, 1e-5, 6e-5];

/// Squared errors by predicted variances, of frequency, damping, and shape, over modes and runs.
struct Tally {
    /// Sums for ω of each mode, ζ of each mode, and the shapes of each mode (n − 1 degrees of freedom).
    squares: [[f64; 3]; 3],
    /// Runs in which |error| < 1.96 sd, for ω and ζ.
    covered: [[usize; 3]; 2],
    /// All ω and shapes jointly.
    joint: Vec<f64>,
    /// Sums of predicted variances of ω.
    predicted: [f64; 3],
    errors: [f64; 3],
    runs: usize,
}

fn system() -> System {
    System::new(&HZ, &RATIOS, 5)
}

fn clean(system: &System) -> DMatrix<f64> {
    system.decay(&DVector::from_row_slice(&[2e-3, -1e-3, 1.5e-3]), RATE_HZ, (RATE_HZ * SECONDS) as usize)
}

fn tally(mut noise: impl FnMut(&mut DMatrix<f64>, u64)) -> Tally {
    let system = system();
    let (omega, shapes) = system.modes();
    let clean = clean(&system);
    let mut tally = Tally {
        squares: [[0.0; 3]; 3],
        covered: [[0; 3]; 2],
        joint: Vec::new(),
        predicted: [0.0; 3],
        errors: [0.0; 3],
        runs: 0,
    };
    for run in 0..runs(200, 40) {
        let mut y = clean.clone();
        noise(&mut y, run);
        let decay = FreeDecay { rate_hz: RATE_HZ, samples: &y, names: &NAMES[..3] };
        let found = identify(&decay, &Options { modes: Some(3), ..Options::default() }).expect("modes");
        assert_eq!(found.shapes.modes.len(), 3, "run {run}: {:?} {:?}", found.components, found.findings);
        assert!(found.is_sound(), "run {run}: {:?}", found.findings);
        tally.add(&found, &omega, &shapes);
    }
    tally
}

impl Tally {
    fn add(&mut self, found: &Modes, omega: &[f64], shapes: &DMatrix<f64>) {
        self.runs += 1;
        let mut errors = DVector::zeros(found.shapes.covariance.nrows());
        for (k, mode) in found.shapes.modes.iter().enumerate() {
            let of = [mode.angular - omega[k], mode.damping - RATIOS[k]];
            for (j, (error, sd)) in of.into_iter().zip([mode.angular_sd, mode.damping_sd]).enumerate() {
                self.squares[j][k] += (error / sd).powi(2);
                self.covered[j][k] += usize::from(error.abs() < 1.96 * sd);
            }
            self.predicted[k] += mode.angular_sd.powi(2);
            self.errors[k] += of[0].powi(2);
            let off = &mode.shape - unit(&shapes.column(k).into_owned());
            let place = found.shapes.place(k);
            errors[place] = of[0];
            errors[place + 1] = of[1];
            errors.rows_mut(place + 2, 3).copy_from(&off);
            let block = found.shapes.covariance.view((place + 2, place + 2), (3, 3)).into_owned();
            self.squares[2][k] += quadratic(&block, &off, 2);
        }
        self.joint.push(quadratic(&found.shapes.covariance, &errors, 12));
    }
}

/// Returns `eᵀ C⁺ e` over the given number of the largest directions of the scaled covariance.
fn quadratic(covariance: &DMatrix<f64>, error: &DVector<f64>, rank: usize) -> f64 {
    let scale = covariance.diagonal().map(|d| 1.0 / d.sqrt());
    let n = error.len();
    let scaled = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] * scale[i] * scale[j]).symmetric_eigen();
    let error = error.component_mul(&scale);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| scaled.eigenvalues[*b].total_cmp(&scaled.eigenvalues[*a]));
    let take = |k: &usize| scaled.eigenvectors.column(*k).dot(&error).powi(2) / scaled.eigenvalues[*k];
    order.iter().take(rank).map(take).sum()
}

/// Checks a mean of squares of unit normal deviates, by four standard deviations `√(2 / freedom)`; below,
/// what the widening for coloured noise may take: the mean of max(1, χ²₆₄/64) of variance is 1.07.
fn check_mean(mean: f64, freedom: f64, what: &str) {
    let four = 4.0 * (2.0 / freedom).sqrt();
    assert!(mean < 1.0 + four && mean > 1.0 / 1.07 - four, "{what}: {mean}, limits {four}");
}

#[test]
fn intervals_hold_under_white_noise() {
    let tally = tally(|y, run| Normal::new(run).add(y, &SIGMA));
    let joint = tally.joint.iter().sum::<f64>() / tally.joint.len() as f64;
    for k in 0..3 {
        let runs = tally.runs as f64;
        for (j, what) in ["frequency", "damping"].into_iter().enumerate() {
            check_mean(tally.squares[j][k] / runs, runs, what);
            // Binomial: 95 % ± four standard deviations.
            let share = tally.covered[j][k] as f64 / runs;
            assert!((share - 0.95).abs() < 4.0 * (0.95 * 0.05 / runs).sqrt(), "{what}: {share}");
        }
        check_mean(tally.squares[2][k] / (2.0 * runs), 2.0 * runs, "shape");
    }
    check_mean(joint / 12.0, 12.0 * tally.runs as f64, "joint");
}

/// Returns the bound of Cramér and Rao from numerical derivatives of the samples by all parameters: nothing
/// of the module is in it.
fn bound() -> [f64; 3] {
    let system = system();
    let (omega, shapes) = system.modes();
    let clean = clean(&system);
    let rows = clean.nrows();
    // Amplitudes of the clean decay by least squares over columns of exponentials.
    let basis = |omega: &[f64], ratios: &[f64]| {
        DMatrix::from_fn(rows, 7, |row, j| {
            let t = row as f64 / RATE_HZ;
            if j == 0 {
                return 1.0;
            }
            let k = (j - 1) / 2;
            let (size, phase) =
                ((-ratios[k] * omega[k] * t).exp(), omega[k] * (1.0 - ratios[k].powi(2)).sqrt() * t);
            size * if j % 2 == 1 { phase.cos() } else { phase.sin() }
        })
    };
    let columns = basis(&omega, &RATIOS);
    let solved = columns.clone().svd(true, true).solve(&clean, 1e-14).expect("amplitudes");
    assert!((&columns * &solved - &clean).norm() < 1e-9 * clean.norm() && shapes.ncols() == 3);
    let mut information = DMatrix::<f64>::zeros(6 + 21, 6 + 21);
    for c in 0..3 {
        let mut jacobian = DMatrix::<f64>::zeros(rows, 27);
        for j in 0..6 {
            let step = if j < 3 { 1e-5 } else { 1e-7 };
            let at = |sign: f64| {
                let (mut omega, mut ratios) = (omega.clone(), RATIOS);
                if j < 3 {
                    omega[j] += sign * step
                } else {
                    ratios[j - 3] += sign * step
                }
                basis(&omega, &ratios) * solved.column(c)
            };
            jacobian.set_column(j, &((at(1.0) - at(-1.0)) / (2.0 * step)));
        }
        jacobian.view_mut((0, 6 + 7 * c), (rows, 7)).copy_from(&columns);
        jacobian /= SIGMA[c];
        information += jacobian.tr_mul(&jacobian);
    }
    let scale = information.diagonal().map(|d| 1.0 / d.sqrt());
    let scaled = DMatrix::from_fn(27, 27, |i, j| information[(i, j)] * scale[i] * scale[j]);
    let inverse = scaled.try_inverse().expect("regular");
    [0, 1, 2].map(|k| inverse[(k, k)] * scale[k] * scale[k])
}

#[test]
fn frequencies_are_as_exact_as_can_be() {
    let bound = bound();
    let tally = tally(|y, run| Normal::new(1000 + run).add(y, &SIGMA));
    for k in 0..3 {
        let runs = tally.runs as f64;
        let (reached, predicted) = (tally.errors[k] / runs / bound[k], tally.predicted[k] / runs / bound[k]);
        let four = 4.0 * (2.0 / runs).sqrt();
        assert!(reached > 1.0 - four && reached < 1.0 + four, "mode {k}: {reached}");
        assert!(predicted > 0.98 && predicted < 1.12, "mode {k}: {predicted}");
    }
}

#[test]
fn intervals_hold_under_autocorrelated_noise() {
    let tally = tally(|y, run| {
        let mut normal = Normal::new(2000 + run);
        for (c, sigma) in SIGMA.iter().enumerate() {
            // First order, with a pole at 0.9: eleven times the power of white noise at the modes, a share of
            // which all channels have.
            let mut state = 0.0;
            for row in 0..y.nrows() {
                state = 0.9 * state + 0.44 * sigma * normal.next();
                y[(row, c)] += state;
            }
        }
    });
    let runs = tally.runs as f64;
    for k in 0..3 {
        for (j, what) in ["frequency", "damping"].into_iter().enumerate() {
            let share = tally.covered[j][k] as f64 / runs;
            assert!(share > 0.95 - 3.0 * (0.95 * 0.05 / runs).sqrt(), "{what}: {share}");
            assert!(tally.squares[j][k] / runs > 0.5, "{what} is too wide");
        }
    }
}
