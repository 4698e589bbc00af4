use nalgebra::{DMatrix, DVector};

use super::*;
use crate::fit::{Filter, SampleCounts, Whitening};

const PHI: [f64; 10] = [20.0, 0.3, -0.2, 1.0, 0.4, 0.1, 0.5, 0.02, -0.03, 0.01];
const OFFSET: [f64; 6] = [3.0, -2.0, 5.0, 0.3, 0.1, -0.2];
const GAINS: [f64; 6] = [0.01, -0.004, 0.007, -0.012, 0.003, 0.0];
const GAIN_SIGMA: [f64; 6] = [8e-3, 8e-3, 5e-3, 6e-3, 8e-3, 0.0];
const WEIGHTS: [f64; 6] = [20.0, 20.0, 10.0, 300.0, 300.0, 300.0];
const N: usize = 16;

/// Blocks of random rows whose measurements follow the model with gains, and noise of the given size.
struct Blocks {
    filter: Filter,
    counts: SampleCounts,
    parts: Vec<Range<usize>>,
    rows: Vec<[[f64; N]; 6]>,
    measured: Vec<[f64; 6]>,
}

impl Blocks {
    fn new(count: usize, noise: f64) -> Self {
        let mut seed = 11_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
        };
        let (mut rows, mut measured) = (Vec::new(), Vec::new());
        for _ in 0..count {
            let block: [[f64; N]; 6] = std::array::from_fn(|c| {
                std::array::from_fn(
                    |j| if j < 10 { 4.0 * random() } else { f64::from(u8::from(j == 10 + c)) },
                )
            });
            measured.push(std::array::from_fn(|c| {
                let moved: f64 = block[c].iter().zip(PHI).map(|(a, phi)| a * phi).sum();
                (1.0 + GAINS[c]) * moved + OFFSET[c] + noise / WEIGHTS[c] * random()
            }));
            rows.push(block);
        }
        let parts = vec![0..count / 3, count / 3..count];
        Self { filter: Filter::default(), counts: SampleCounts::default(), parts, rows, measured }
    }
}

impl RowBlocks for Blocks {
    fn filter(&self) -> &Filter {
        &self.filter
    }

    fn counts(&self) -> &SampleCounts {
        &self.counts
    }

    fn parts(&self) -> &[Range<usize>] {
        &self.parts
    }

    fn time_s(&self, block: usize) -> f64 {
        block as f64
    }

    fn write(&self, block: usize, rows: &mut [f64], measured: &mut [f64]) {
        rows.copy_from_slice(self.rows[block].as_flattened());
        measured.copy_from_slice(&self.measured[block]);
    }
}

fn channels(gain_sigma: [f64; 6]) -> Vec<Channel> {
    let channel = |c: usize| Channel {
        name: format!("c{c}"),
        unit: "N".to_owned(),
        sigma: None,
        gain_sigma: gain_sigma[c],
        offset: Some(10 + c),
        group: 0,
    };
    (0..6).map(channel).collect()
}

/// Oracle: the dense normal matrix of all rows at the solution, inverted whole, and its block for φ and b; and the gradient
/// of the sum of squares, zero at the solution.
#[test]
fn the_marginal_is_that_of_the_dense_problem_with_gains() {
    let blocks = Blocks::new(200, 1.0);
    let channels = channels(GAIN_SIGMA);
    let (factor, gains) = fitted(&blocks, &channels);
    let Solved { estimate, covariance: marginal } = solved(&factor);
    let mut normal = DMatrix::<f64>::zeros(22, 22);
    let mut gradient = DVector::<f64>::zeros(22);
    let mut squares = 0.0;
    for (rows, measured) in blocks.rows.iter().zip(&blocks.measured) {
        for c in 0..6 {
            let mut row = DVector::<f64>::zeros(22);
            let moved: f64 = (0..10).map(|j| rows[c][j] * estimate[j]).sum();
            row[c] = if GAIN_SIGMA[c] > 0.0 { moved } else { 0.0 };
            for j in 0..10 {
                row[6 + j] = (1.0 + gains[c]) * rows[c][j];
            }
            row[16 + c] = 1.0;
            let e = measured[c] - (1.0 + gains[c]) * moved - estimate[10 + c];
            normal += WEIGHTS[c].powi(2) * &row * row.transpose();
            gradient += WEIGHTS[c].powi(2) * e * row;
            squares += (WEIGHTS[c] * e).powi(2);
        }
    }
    for c in 0..6 {
        let information = if GAIN_SIGMA[c] > 0.0 { GAIN_SIGMA[c].powi(-2) } else { 1.0 };
        normal[(c, c)] += information;
        gradient[c] -= information * gains[c];
        squares += information * gains[c].powi(2);
    }
    let covariance = normal.try_inverse().unwrap();
    let step = &covariance * gradient;
    for i in 0..N {
        let sd = covariance[(6 + i, 6 + i)].sqrt();
        // A further Newton step is far below the noise; SETTLED bounds it.
        assert!(step[6 + i].abs() < 1e-4 * sd, "{i}: {} {sd}", step[6 + i]);
        for j in 0..N {
            let scale = sd * covariance[(6 + j, 6 + j)].sqrt();
            assert!((marginal[(i, j)] - covariance[(6 + i, 6 + j)]).abs() < 1e-6 * scale);
        }
    }
    assert!((factor.residual_sum_of_squares() / squares - 1.0).abs() < 1e-9);
    assert_eq!(factor.rows(), 1200);
}

/// The factor with the gains eliminated, and the gains.
fn fitted(blocks: &Blocks, channels: &[Channel]) -> (Factor, Vec<f64>) {
    let rounding = 16.0 * f64::EPSILON;
    let start = Gains::new(channels, N, true);
    let absorb = |gains: &Gains| {
        let blocks = WithGains { blocks, gains };
        let mut factor = Factor::new(gains.columns());
        for part in blocks.parts() {
            factor.merge(&blocks.absorb(part.clone(), gains.columns(), &Whitening::diagonal(&WEIGHTS), None));
        }
        factor
    };
    let (joint, gains) = start.settle(rounding, absorb);
    gains.eliminate(&joint, 1.0, rounding)
}

struct Solved {
    estimate: Vec<f64>,
    covariance: DMatrix<f64>,
}

fn solved(factor: &Factor) -> Solved {
    let solution = factor.solve(factor.rounding());
    Solved { estimate: solution.estimate, covariance: solution.covariance }
}

#[test]
fn without_gain_errors_there_is_nothing_to_eliminate() {
    let blocks = Blocks::new(50, 1.0);
    assert!(Gains::new(&channels([0.0; 6]), N, true).is_empty());
    // Where they are next to certain the factor is that of plain least squares.
    let channels = channels([1e-12, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let (factor, gains) = fitted(&blocks, &channels);
    assert!(gains.iter().all(|g| g.abs() < 1e-9), "{gains:?}");
    let plain = blocks.absorb(0..50, N, &Whitening::diagonal(&WEIGHTS), None);
    let (got, want) = (solved(&factor), solved(&plain));
    for j in 0..N {
        let sd = want.covariance[(j, j)].sqrt();
        assert!((got.estimate[j] - want.estimate[j]).abs() < 1e-6 * sd, "{j}");
        assert!((got.covariance[(j, j)].sqrt() / sd - 1.0).abs() < 1e-6, "{j}");
    }
}
