//! Decays for the tests, made without anything of the module.

use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

pub(super) const NAMES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// A linear system `M q̈ + C q̇ + K q = 0`.
pub(super) struct System {
    pub(super) mass: DMatrix<f64>,
    pub(super) damping: DMatrix<f64>,
    pub(super) stiffness: DMatrix<f64>,
}

impl System {
    /// Makes a system with these undamped frequencies and damping ratios, a full mass matrix and shapes that
    /// are oblique: `M = L Lᵀ`, `K = L Q Ω² Qᵀ Lᵀ`, `C = L Q (2 ζ Ω) Qᵀ Lᵀ` with Q orthogonal.
    pub(super) fn new(hz: &[f64], ratios: &[f64], seed: u64) -> Self {
        let n = hz.len();
        let mut random = Normal::new(seed);
        let lower = DMatrix::from_fn(n, n, |i, j| match i.cmp(&j) {
            std::cmp::Ordering::Equal => 2.0 + 0.3 * i as f64,
            std::cmp::Ordering::Greater => 0.4 * random.next(),
            std::cmp::Ordering::Less => 0.0,
        });
        let q = DMatrix::from_fn(n, n, |_, _| random.next()).qr().q();
        let omega = |k: usize| std::f64::consts::TAU * hz[k];
        let with =
            |d: DVector<f64>| &lower * &q * DMatrix::from_diagonal(&d) * q.transpose() * lower.transpose();
        Self {
            stiffness: with(DVector::from_fn(n, |k, _| omega(k).powi(2))),
            damping: with(DVector::from_fn(n, |k, _| 2.0 * ratios[k] * omega(k))),
            mass: &lower * lower.transpose(),
        }
    }

    /// Returns frequencies (rad/s) and shapes of `K ψ = ω² M ψ`, by the roots of M (not by its triangle, from
    /// which the system was made).
    pub(super) fn modes(&self) -> (Vec<f64>, DMatrix<f64>) {
        let eigen = self.mass.clone().symmetric_eigen();
        let roots = DMatrix::from_diagonal(&eigen.eigenvalues.map(|v| 1.0 / v.sqrt()));
        let inverse = &eigen.eigenvectors * roots * eigen.eigenvectors.transpose();
        let modes = (&inverse * &self.stiffness * &inverse).symmetric_eigen();
        let mut order: Vec<usize> = (0..modes.eigenvalues.len()).collect();
        order.sort_by(|a, b| modes.eigenvalues[*a].total_cmp(&modes.eigenvalues[*b]));
        let shapes = inverse * modes.eigenvectors.select_columns(&order);
        (order.iter().map(|k| modes.eigenvalues[*k].sqrt()).collect(), shapes)
    }

    /// Returns exact samples from rest at a deflection: steps of the matrix exponential of the state.
    pub(super) fn decay(&self, deflection: &DVector<f64>, rate_hz: f64, samples: usize) -> DMatrix<f64> {
        let n = deflection.len();
        let inverse = self.mass.clone().try_inverse().expect("masses are positive");
        let mut state = DMatrix::zeros(2 * n, 2 * n);
        state.view_mut((0, n), (n, n)).fill_with_identity();
        state.view_mut((n, 0), (n, n)).copy_from(&(-&inverse * &self.stiffness));
        state.view_mut((n, n), (n, n)).copy_from(&(-&inverse * &self.damping));
        let step = exponential(&(state / rate_hz));
        let mut x = DVector::zeros(2 * n);
        x.rows_mut(0, n).copy_from(deflection);
        let mut y = DMatrix::zeros(samples, n);
        for row in 0..samples {
            y.row_mut(row).copy_from(&x.rows(0, n).transpose());
            x = &step * x;
        }
        y
    }
}

/// Returns the exponential by its series, of the matrix halved ten times and squared ten times.
fn exponential(a: &DMatrix<f64>) -> DMatrix<f64> {
    let small = a / 1024.0;
    let n = a.nrows();
    let mut term = DMatrix::identity(n, n);
    let mut sum = DMatrix::identity(n, n);
    for k in 1..14 {
        term = term * &small / f64::from(k);
        sum += &term;
    }
    for _ in 0..10 {
        sum = &sum * &sum;
    }
    sum
}

/// Normal deviates of a seed.
pub(super) struct Normal(ChaCha8Rng);

impl Normal {
    pub(super) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub(super) fn next(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Adds white noise of a standard deviation for each channel.
    pub(super) fn add(&mut self, y: &mut DMatrix<f64>, sigma: &[f64]) {
        for row in 0..y.nrows() {
            for (channel, sigma) in sigma.iter().enumerate() {
                y[(row, channel)] += sigma * self.next();
            }
        }
    }
}

/// Returns a shape brought to unit norm, its largest entry positive.
pub(super) fn unit(shape: &DVector<f64>) -> DVector<f64> {
    let unit = shape.normalize();
    let largest = unit[unit.iamax()];
    unit * largest.signum()
}
