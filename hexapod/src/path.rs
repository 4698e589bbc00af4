//! A smooth curve through several poses.
//!
//! Each coordinate is the polynomial that passes through the poses at `u = 0, 1/n, …, 1`, and u is the
//! quintic of time.

use super::envelope::{envelope_peaks, quintic};
use super::kinematics::Coordinates;
use super::pose::Pose;

/// Most poses on the way, both ends not counted. Polynomials of a higher degree swing.
pub(super) const MOST_VIA: usize = 3;
/// Coefficients of the highest degree.
const COEFFICIENTS: usize = MOST_VIA + 2;

/// The polynomials of the six coordinates in u, the constant first.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    coefficients: [[f64; COEFFICIENTS]; 6],
    duration_s: f64,
}

impl Curve {
    /// Makes a path from a pose through at most [`MOST_VIA`] others to the last.
    pub(super) fn new(from: &[f64; 6], via: &[Pose], to: &Pose, duration_s: f64) -> Self {
        let mut points = vec![*from];
        points.extend(via.iter().take(MOST_VIA).chain([to]).map(Pose::coordinates));
        let last = (points.len() - 1) as f64;
        let coefficients = std::array::from_fn(|axis| {
            // Newton's divided differences, then Horner's scheme from the inside out.
            let mut differences: Vec<f64> = points.iter().map(|p| p[axis]).collect();
            for order in 1..differences.len() {
                for k in (order..differences.len()).rev() {
                    differences[k] = (differences[k] - differences[k - 1]) * last / order as f64;
                }
            }
            let mut sum = [0.0; COEFFICIENTS];
            for (k, difference) in differences.iter().enumerate().rev() {
                let node = k as f64 / last;
                for i in (0..COEFFICIENTS).rev() {
                    sum[i] = if i > 0 { sum[i - 1] } else { 0.0 } - node * sum[i];
                }
                sum[0] += difference;
            }
            sum
        });
        Self { coefficients, duration_s }
    }

    /// Returns the coordinates `t` after the beginning.
    pub(super) fn coordinates(&self, t: f64) -> Coordinates {
        let [u, s1, s2] = quintic(t / self.duration_s);
        let (u1, u2) = (s1 / self.duration_s, s2 / (self.duration_s * self.duration_s));
        let mut c = Coordinates::default();
        for (i, p) in self.coefficients.iter().enumerate() {
            let (mut p0, mut p1, mut p2) = (0.0, 0.0, 0.0);
            for coefficient in p.iter().rev() {
                p2 = p2 * u + 2.0 * p1;
                p1 = p1 * u + p0;
                p0 = p0 * u + coefficient;
            }
            c.value[i] = p0;
            c.rate[i] = p1 * u1;
            c.acceleration[i] = p2 * u1 * u1 + p1 * u2;
        }
        c
    }

    /// Bounds of the first, second and third derivatives of each coordinate by time.
    pub(super) fn peaks(&self) -> [[f64; 3]; 6] {
        let [u1, u2, u3] = envelope_peaks(self.duration_s);
        // u' u'' = 1800 x³ √(1 − 4x) with x = s (1 − s), largest at x = 3/14.
        let u12 = 1800.0 * (3.0_f64 / 14.0).powi(3) / 7.0_f64.sqrt() / self.duration_s.powi(3);
        self.coefficients.map(|p| {
            let [d1, d2, d3] = [1, 2, 3].map(|order| largest(&derivative(&p, order)));
            [d1 * u1, d2 * u1 * u1 + d1 * u2, d3 * u1.powi(3) + 3.0 * d2 * u12 + d1 * u3]
        })
    }
}

/// Returns the coefficients of a derivative.
fn derivative(p: &[f64; COEFFICIENTS], order: usize) -> [f64; COEFFICIENTS] {
    let mut d = *p;
    for _ in 0..order {
        d = std::array::from_fn(|i| d.get(i + 1).map_or(0.0, |next| (i + 1) as f64 * next));
    }
    d
}

/// Returns a bound of a polynomial's magnitude over `[0, 1]`: the largest of its coefficients in Bernstein's
/// basis, `b_k = Σ_i C(k, i) / C(n, i) a_i`, of which the polynomial is a mean at every u.
fn largest(p: &[f64; COEFFICIENTS]) -> f64 {
    let n = COEFFICIENTS - 1;
    let choose = |n: usize, k: usize| (0..k).fold(1.0, |c, i| c * (n - i) as f64 / (i + 1) as f64);
    (0..=n)
        .map(|k| (0..=k).map(|i| choose(k, i) / choose(n, i) * p[i]).sum::<f64>().abs())
        .fold(0.0, f64::max)
}
