//! Rows with a known answer: a body on the thesis' motion, and random rows of a given condition number.

use hexapod::{Axis, Geometry, MotionProgram, Segment, SineTerm};
use hexapod::{BodyParameters, FrameMotion};
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigident_shared::regressor;
use rigident_shared::spatial::Position;

/// Blocks of six whitened rows, by columns, in the target's scalar.
pub type Block<const N: usize> = ([[f32; 6]; N], [f32; 6]);

/// Independent standard normal deviates of one seed.
pub struct Normal(ChaCha8Rng);

impl Normal {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn draw(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

/// Returns 30 s at 200 Hz of a body on a platform: roll, pitch and yaw of 0.5 rad at 0.23, 0.31 and 0.41 Hz,
/// in full swing from the first row, or with a second of swelling from rest before that. The regressor is
/// exact, the wrench noisy; 36 000 rows, whitened by `sigma`. `N` is 10, or 16 with a constant offset.
pub fn rigid_body<const N: usize>(sigma: [f64; 6], from_rest: bool, seed: u64) -> Vec<Block<N>> {
    let term = |axis, frequency_hz| SineTerm { axis, amplitude: 0.5, frequency_hz, phase_rad: 0.0 };
    let program = MotionProgram {
        start: Geometry::thesis().home(),
        segments: vec![Segment::Multisine {
            duration_s: 32.0,
            ramp_s: 1.0,
            terms: vec![term(Axis::Roll, 0.23), term(Axis::Pitch, 0.31), term(Axis::Yaw, 0.41)],
        }],
    };
    let trajectory = program.trajectory().expect("the program is a fixed one");
    let body = BodyParameters::thesis_horizontal();
    let gravity = Vector3::new(0.0, 0.0, -9.80665);
    let mut normal = Normal::new(seed);
    let first_s = if from_rest { 0.0 } else { 1.0 };
    (0..6000)
        .map(|k| {
            let motion = FrameMotion::of_plate(&trajectory.state(first_s + f64::from(k) / 200.0));
            let (a, w, dw) =
                (motion.specific_force(&gravity), motion.angular_rate, motion.angular_acceleration);
            let r = motion.rotation.transpose();
            let (w, dw) = (r * w, r * dw);
            let wrench = body.wrench(&motion, &gravity);
            let [fx, fy, fz, mx, my, mz] = wrench;
            let signals = [
                a.x,
                a.y,
                a.z,
                w.x * w.x,
                w.y * w.y,
                w.z * w.z,
                w.y * w.z,
                w.z * w.x,
                w.x * w.y,
                fx,
                fy,
                fz,
                mx,
                my,
                mz,
                dw.x,
                dw.y,
                dw.z,
            ];
            let exact = regressor::block(&signals, &Position::zero());
            let mut columns = [[0.0; 6]; N];
            for (j, column) in columns.iter_mut().enumerate() {
                for (i, (entry, s)) in column.iter_mut().zip(sigma).enumerate() {
                    let value = exact.columns.get(j).map_or(f64::from(u8::from(j == 10 + i)), |c| c[i]);
                    *entry = (value / s) as f32;
                }
            }
            let rhs = std::array::from_fn(|i| (wrench[i] / sigma[i] + normal.draw()) as f32);
            (columns, rhs)
        })
        .collect()
}

/// Random rows `g M` with independent normal g. M has geometrically spaced singular values and columns of
/// unit length, so that many rows have this condition number with their columns scaled, whatever scaling they
/// get.
pub struct Mixed<const N: usize> {
    /// Row k of M.
    m: Vec<[f64; N]>,
    /// The parameters that the rows obey.
    pub phi: [f64; N],
    noise: f64,
    normal: Normal,
}

impl<const N: usize> Mixed<N> {
    /// Makes a problem. `noise` is 1 σ of the right-hand side where the rows' entries are of order one;
    /// `phi_scale` that of φ.
    pub fn new(condition: f64, noise: f64, phi_scale: f64, seed: u64) -> Self {
        let mut normal = Normal::new(seed);
        let m = with_unit_columns::<N>(condition, &mut normal);
        let phi = std::array::from_fn(|_| phi_scale * normal.draw());
        Self { m, phi, noise, normal }
    }

    /// Returns the next six rows, divided by the noise.
    pub fn block(&mut self) -> Block<N> {
        let mut columns = [[0.0_f32; 6]; N];
        let mut rhs = [0.0_f32; 6];
        for i in 0..6 {
            let mut row = [0.0; N];
            for m in &self.m {
                let g = self.normal.draw();
                for (entry, m) in row.iter_mut().zip(m) {
                    *entry += g * m;
                }
            }
            let exact: f64 = row.iter().zip(&self.phi).map(|(a, x)| a * x).sum();
            for (column, a) in columns.iter_mut().zip(row) {
                column[i] = (a / self.noise) as f32;
            }
            rhs[i] = (exact / self.noise + self.normal.draw()) as f32;
        }
        (columns, rhs)
    }
}

/// Returns `S Vᵀ` with `diag(V S² Vᵀ) = 1`: a random orthogonal V, then a rotation for each diagonal entry of
/// the Gram matrix (Bendel and Mickey, *Population correlation matrices for sampling experiments*, 1978).
fn with_unit_columns<const N: usize>(condition: f64, normal: &mut Normal) -> Vec<[f64; N]> {
    let mut singular: [f64; N] = std::array::from_fn(|k| condition.powf(-(k as f64) / (N as f64 - 1.0)));
    let norm = singular.iter().map(|s| s * s).sum::<f64>() / N as f64;
    singular.iter_mut().for_each(|s| *s /= norm.sqrt());
    let v = nalgebra::DMatrix::from_fn(N, N, |_, _| normal.draw()).qr().q();
    // Column j of M.
    let mut columns: Vec<[f64; N]> =
        (0..N).map(|j| std::array::from_fn(|k| singular[k] * v[(j, k)])).collect();
    let dot = |a: &[f64; N], b: &[f64; N]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    for _ in 0..N {
        let lengths: Vec<f64> = columns.iter().map(|c| dot(c, c)).collect();
        let least = (0..N).min_by(|a, b| lengths[*a].total_cmp(&lengths[*b])).unwrap_or(0);
        let most = (0..N).max_by(|a, b| lengths[*a].total_cmp(&lengths[*b])).unwrap_or(0);
        if lengths[most] - lengths[least] < 1e-9 {
            break;
        }
        // The rotation of two columns after which the first has length one: with t = tan θ,
        // (b − 1) t² + 2 c t + (a − 1) = 0.
        let (a, b, c) = (lengths[least], lengths[most], dot(&columns[least], &columns[most]));
        let t = (-c - (c * c - (a - 1.0) * (b - 1.0)).sqrt()) / (b - 1.0);
        let cosine = 1.0 / (1.0 + t * t).sqrt();
        let sine = t * cosine;
        for k in 0..N {
            let (x, y) = (columns[least][k], columns[most][k]);
            columns[least][k] = cosine * x + sine * y;
            columns[most][k] = cosine * y - sine * x;
        }
    }
    (0..N).map(|k| std::array::from_fn(|j| columns[j][k])).collect()
}
