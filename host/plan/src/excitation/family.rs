//! Motions of joints as Fourier series about a start: the fundamental is one over the duration, the highest
//! harmonic is the bandwidth, and the motion begins and ends at rest at the start, without acceleration.
//!
//! `q(t) = q₀ + Σ_k (a_k sin kωt + b_k (cos kωt − 1))`. With `a_k = r x_k/kω` and `b_k = r y_k/kω` the rate
//! is zero where `Σ x_k = 0` and the acceleration where `Σ k y_k = 0`: two planes, of each of which a
//! reflection gives an orthonormal basis.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

/// Instants for each harmonic that the search checks: 12 in the shortest period.
pub const INSTANTS: usize = 12;

/// Positions, rates and accelerations of all joints at an instant, rad or m and s; or what a change of each
/// is worth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Positions.
    pub positions: Vec<f64>,
    /// Rates.
    pub rates: Vec<f64>,
    /// Accelerations.
    pub accelerations: Vec<f64>,
}

impl Motion {
    /// Returns the given number of joints at rest at zero.
    pub fn zeros(joints: usize) -> Self {
        let zeros = vec![0.0; joints];
        Self { positions: zeros.clone(), rates: zeros.clone(), accelerations: zeros }
    }
}

/// A trajectory of all joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// The positions where the joints start and end, rad or m.
    pub start: Vec<f64>,
    /// The length of the series, s.
    pub duration_s: f64,
    /// The coefficients of sine and of cosine less one for every joint and harmonic, rad or m.
    pub terms: Vec<Vec<[f64; 2]>>,
}

impl Series {
    /// Returns where the joints are at a time, s; before and after it they rest.
    pub fn at(&self, t: f64) -> Motion {
        let mut motion = Motion::zeros(self.start.len());
        motion.positions.copy_from_slice(&self.start);
        if !(t > 0.0 && t < self.duration_s) {
            return motion;
        }
        let omega = TAU / self.duration_s;
        for (j, terms) in self.terms.iter().enumerate() {
            for (k, [a, b]) in terms.iter().enumerate() {
                let w = (k + 1) as f64 * omega;
                let (sin, cos) = (w * t).sin_cos();
                motion.positions[j] += a * sin + b * (cos - 1.0);
                motion.rates[j] += w * (a * cos - b * sin);
                motion.accelerations[j] -= w * w * (a * sin + b * cos);
            }
        }
        motion
    }

    /// Returns the same about the same start with all amplitudes times a factor.
    #[must_use]
    pub fn sized(&self, size: f64) -> Self {
        let terms = self.terms.iter().map(|own| own.iter().map(|term| term.map(|v| size * v)).collect());
        Self { terms: terms.collect(), ..self.clone() }
    }

    /// Returns for a joint the most that the derivative of a degree, 1, 2 or 3, can be at any instant: the
    /// sum of amplitudes, SI.
    pub fn most(&self, joint: usize, degree: i32) -> f64 {
        let omega = TAU / self.duration_s;
        let own = self.terms.get(joint).map_or(&[][..], Vec::as_slice);
        own.iter().enumerate().map(|(k, [a, b])| a.hypot(*b) * ((k + 1) as f64 * omega).powi(degree)).sum()
    }
}

/// The series of all joints with coefficients of like size.
#[derive(Clone, Debug)]
pub struct Family {
    start: Vec<f64>,
    duration_s: f64,
    /// Rate that a coefficient of one means, of every joint, rad/s or m/s.
    scales: Vec<f64>,
    /// Sine and cosine coefficients, over kω, of every free coefficient: harmonics by coefficients.
    sines: DMatrix<f64>,
    cosines: DMatrix<f64>,
    /// Value, rate, acceleration by instant and coefficient.
    waves: Vec<Vec<[f64; 3]>>,
}

/// Returns an orthonormal basis of the plane at right angles to a vector, n × (n − 1).
fn plane(normal: &DVector<f64>) -> DMatrix<f64> {
    let n = normal.len();
    // The reflection that brings the vector to the first axis; its other columns are in the plane.
    let mut mirror = normal.normalize();
    mirror[0] += if mirror[0] < 0.0 { -1.0 } else { 1.0 };
    let reflection = DMatrix::identity(n, n) - &mirror * mirror.transpose() * (2.0 / mirror.norm_squared());
    reflection.columns(1, n - 1).into_owned()
}

impl Family {
    /// Returns the series about a start that last `duration_s` and have the given number of harmonics, two at
    /// least; `rates` are those that the joints may have, rad/s or m/s.
    pub fn new(start: &[f64], duration_s: f64, harmonics: usize, rates: &[f64]) -> Self {
        let harmonics = harmonics.max(2);
        let ones = DVector::from_element(harmonics, 1.0);
        let steps = DVector::from_fn(harmonics, |k, _| (k + 1) as f64);
        let (sines, cosines) = (plane(&ones), plane(&steps));
        let share = (2.0 * harmonics as f64).sqrt().recip();
        let mut family = Self {
            start: start.to_vec(),
            duration_s,
            scales: rates.iter().map(|rate| rate * share).collect(),
            sines,
            cosines,
            waves: Vec::new(),
        };
        let (own, instants) = (family.own(), INSTANTS * harmonics);
        let unit: Vec<Series> = (0..own)
            .map(|m| {
                let mut z = vec![0.0; own];
                z[m] = 1.0;
                Series { start: vec![0.0], duration_s, terms: vec![family.terms(&z, 1.0)] }
            })
            .collect();
        family.waves = (0..instants)
            .map(|k| {
                let t = k as f64 * duration_s / instants as f64;
                let of = |series: &Series| {
                    let motion = series.at(t);
                    [motion.positions[0], motion.rates[0], motion.accelerations[0]]
                };
                unit.iter().map(of).collect()
            })
            .collect();
        family
    }

    /// Returns the coefficients of one joint.
    fn own(&self) -> usize {
        self.sines.ncols() + self.cosines.ncols()
    }

    /// Returns the number of coefficients.
    pub fn len(&self) -> usize {
        self.start.len() * self.own()
    }

    /// Returns true if no joint moves.
    pub fn is_empty(&self) -> bool {
        self.start.is_empty()
    }

    /// Returns the number of instants of the grid.
    pub fn instants(&self) -> usize {
        self.waves.len()
    }

    /// Returns the time between instants of the grid, s.
    pub fn step_s(&self) -> f64 {
        self.duration_s / self.instants().max(1) as f64
    }

    fn terms(&self, own: &[f64], scale: f64) -> Vec<[f64; 2]> {
        let (x, y) = own.split_at(self.sines.ncols());
        let (x, y) =
            (&self.sines * DVector::from_column_slice(x), &self.cosines * DVector::from_column_slice(y));
        let omega = TAU / self.duration_s;
        (0..x.len()).map(|k| [x[k], y[k]].map(|v| scale * v / ((k + 1) as f64 * omega))).collect()
    }

    /// Returns the trajectory of some coefficients.
    pub fn series(&self, z: &[f64]) -> Series {
        let own = z.chunks(self.own()).zip(&self.scales);
        let terms = own.map(|(own, scale)| self.terms(own, *scale)).collect();
        Series { start: self.start.clone(), duration_s: self.duration_s, terms }
    }

    /// Returns the motion at the instant `k` of the grid.
    pub fn motion(&self, z: &[f64], k: usize) -> Motion {
        let mut motion = Motion::zeros(self.start.len());
        for (j, (own, scale)) in z.chunks(self.own()).zip(&self.scales).enumerate() {
            let mut sum = [0.0; 3];
            for (z, wave) in own.iter().zip(&self.waves[k]) {
                (0..3).for_each(|d| sum[d] += z * wave[d]);
            }
            motion.positions[j] = self.start[j] + scale * sum[0];
            (motion.rates[j], motion.accelerations[j]) = (scale * sum[1], scale * sum[2]);
        }
        motion
    }

    /// Adds to `gradient` what a change of the motion at the instant `k` is worth.
    pub fn pull_back(&self, worth: &Motion, k: usize, gradient: &mut [f64]) {
        for (j, (own, scale)) in gradient.chunks_mut(self.own()).zip(&self.scales).enumerate() {
            for (to, [w0, w1, w2]) in own.iter_mut().zip(&self.waves[k]) {
                *to += scale * (worth.positions[j] * w0 + worth.rates[j] * w1 + worth.accelerations[j] * w2);
            }
        }
    }
}
