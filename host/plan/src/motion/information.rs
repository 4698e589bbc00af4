//! The information of a motion on the body, and how that changes with the motion.
//!
//! `M = Σ Aᵀ W A` with the pipeline's own regressor A (offsets' columns beside it) and W the load cell's
//! white noise. The pipeline's filter is not in it: up to 2.5 Hz it takes less than 2 % off a row.
//!
//! The gradient of `log det M` goes backwards through the rows: `d log det M = 2 Σ tr(M⁻¹ Aᵀ W dA)`, A is
//! linear in twelve signals, these are products of specific force, angular rate and acceleration. With the
//! small turn η of the plate in its own axes, `η = E δ(roll, pitch, yaw)`:
//! `δ(Rᵀv) = Rᵀδv + Rᵀv × η`, `δω = η' + ω × η`, `δω̇ = η'' + ω̇ × η + ω × η'`.

use hexapod::{BodySet, Coordinates, PlateState};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use rigident_shared::regressor::{SIGNALS, block};
use rigident_shared::spatial::{Position, Sensor};

/// The bound for every body over that for the middle of them: what is allowed leaves room for noise and for
/// what is not known of the body, 0.85 of a range; at worst it is 0.97.
const AT_WORST: f64 = 1.14;

/// The body's ten and six offsets.
pub const PARAMETERS: usize = 16;
/// Information of all parameters, SI.
pub type Information = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// Signals that the regressor depends on: specific force, products, angular acceleration.
const USED: [usize; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 15, 16, 17];

/// The load cell on the plate.
#[derive(Clone, Debug)]
pub struct Instrument {
    /// P's axes to S's.
    to_cell: Matrix3<f64>,
    /// Place of P's origin in S.
    lever: Position<Sensor, f64>,
    gravity_mps2: f64,
    weights: [f64; 6],
    /// The bodies that are possible, in S, and what the load cell and the accelerometer may see: N, N m,
    /// m/s².
    body: Option<BodySet>,
    wrench_limit: [f64; 6],
    felt_limit: f64,
    /// The regressor of each of the twelve signals at one.
    units: [[[f64; 6]; 10]; 12],
}

impl Instrument {
    /// Makes the instrument at `position` in P, its axes to the plate's by `rotation`; noise 1 σ of one
    /// reading, `readings` of them at each instant that will be examined.
    pub fn new(
        position: &Vector3<f64>,
        rotation: &Matrix3<f64>,
        gravity_mps2: f64,
        noise_n_nm: &[f64; 6],
        readings: f64,
    ) -> Self {
        let to_cell = rotation.transpose();
        let lever = Position::from_array((-(to_cell * position)).into());
        let units = USED.map(|s| {
            let mut signals = [0.0; SIGNALS];
            signals[s] = 1.0;
            block(&signals, &lever).columns
        });
        Self {
            to_cell,
            lever,
            gravity_mps2,
            weights: noise_n_nm.map(|s| readings / (s * s)),
            body: None,
            wrench_limit: [f64::INFINITY; 6],
            felt_limit: f64::INFINITY,
            units,
        }
    }

    /// Adds one of a set of bodies (S), whose wrench stays within `wrench_limit`, N and N m, and specific
    /// force within `felt_limit`, m/s².
    #[must_use]
    pub fn within(self, body: Option<BodySet>, wrench_limit: [f64; 6], felt_limit: f64) -> Self {
        Self { body, wrench_limit, felt_limit, ..self }
    }

    /// Returns the largest of these shares: the wrench in S of the middle of the bodies over what is allowed,
    /// that of any of them over 1.14 times that, and the specific force over what is allowed.
    pub fn load_share(&self, state: &PlateState) -> f64 {
        let felt = self.felt(state).norm() / self.felt_limit;
        let Some(body) = &self.body else { return felt };
        let wrench = self.wrench_of(state, body);
        wrench
            .into_iter()
            .zip(self.wrench_limit)
            .fold(felt, |most, ([middle, at_worst], limit)| most.max(middle.max(at_worst / AT_WORST) / limit))
    }

    /// Returns the magnitude in each channel that the middle of a set of bodies (S) takes and the largest of
    /// any of them, N and N m.
    pub fn wrench_of(&self, state: &PlateState, body: &BodySet) -> [[f64; 2]; 6] {
        let columns = self.columns(state);
        std::array::from_fn(|c| {
            let column = std::array::from_fn(|j| columns[j][c]);
            let [low, high] = body.range(&column);
            let middle: f64 = column.iter().zip(&body.middle).map(|(a, b)| a * b).sum();
            [middle.abs(), high.max(-low)]
        })
    }

    /// Returns `−Σ log slack` of these limits for the middle of the bodies and, in `worth`, `share` times its
    /// change; `None` outside.
    pub fn barrier(&self, state: &PlateState, share: f64, worth: &mut Variation) -> Option<f64> {
        let mut sum = 0.0;
        let mut pull = |value: f64, limit: f64| {
            let ratio = value / limit;
            let slack = 1.0 - ratio * ratio;
            (slack > 0.0).then(|| {
                sum -= slack.ln();
                share * 2.0 * ratio / (limit * slack)
            })
        };
        let columns = self.columns(state);
        let mut signals = [0.0; 12];
        let body = self.body.as_ref().map_or([0.0; 10], |body| body.middle);
        for c in 0..6 {
            if self.wrench_limit[c].is_finite() {
                let wrench = (0..10).map(|j| body[j] * columns[j][c]).sum();
                let pull = pull(wrench, self.wrench_limit[c])?;
                for (signal, unit) in signals.iter_mut().zip(&self.units) {
                    *signal += pull * (0..10).map(|j| body[j] * unit[j][c]).sum::<f64>();
                }
            }
        }
        self.pull_back(state, &signals, worth);
        if self.felt_limit.is_finite() {
            let felt = self.felt(state);
            let along = felt.normalize() * pull(felt.norm(), self.felt_limit)?;
            worth.acceleration += state.rotation * along;
            worth.turn[0] += along.cross(&felt);
        }
        Some(sum)
    }

    fn columns(&self, state: &PlateState) -> [[f64; 6]; 10] {
        let a = self.to_cell * self.felt(state);
        let w = self.to_cell * state.angular_rate;
        let mut signals = rigident_shared::regressor::signals(a.into(), w.into(), [0.0; 6]);
        signals[15..].copy_from_slice((self.to_cell * state.angular_acceleration).as_slice());
        block(&signals, &self.lever).columns
    }

    /// Returns the specific force at P's origin, in P.
    fn felt(&self, state: &PlateState) -> Vector3<f64> {
        state.rotation.transpose() * (state.acceleration + Vector3::new(0.0, 0.0, self.gravity_mps2))
    }

    /// Adds the readings of one instant, passed the given number of times.
    pub fn add(&self, state: &PlateState, times: f64, information: &mut Information) {
        let columns = self.columns(state);
        for c in 0..6 {
            let w = times * self.weights[c];
            for i in 0..10 {
                let x = w * columns[i][c];
                if x != 0.0 {
                    for j in i..10 {
                        information[(i, j)] += x * columns[j][c];
                    }
                    information[(i, 10 + c)] += x;
                }
            }
            information[(10 + c, 10 + c)] += w;
        }
    }

    /// Returns what a change of the coordinates at one instant is worth where a change of the information is
    /// worth `tr(Q dM)`, Q symmetric: `M⁻¹` for `log det M`; times a factor.
    pub fn worth(&self, state: &PlateState, slope: &Information, times: f64) -> Variation {
        let columns = self.columns(state);
        let mut worth = [0.0; 12];
        for c in 0..6 {
            let row = SVector::<f64, PARAMETERS>::from_fn(|j, _| match j {
                0..10 => columns[j][c],
                _ if j == 10 + c => 1.0,
                _ => 0.0,
            });
            let g = slope * row * (2.0 * times * self.weights[c]);
            for (worth, unit) in worth.iter_mut().zip(&self.units) {
                *worth += (0..10).map(|j| g[j] * unit[j][c]).sum::<f64>();
            }
        }
        let mut variation = Variation::default();
        self.pull_back(state, &worth, &mut variation);
        variation
    }

    /// Pulls a derivative back from the twelve signals to the plate's motion.
    fn pull_back(&self, state: &PlateState, worth: &[f64; 12], variation: &mut Variation) {
        let [ax, ay, az, xx, yy, zz, yz, zx, xy, dx, dy, dz] = *worth;
        let w = self.to_cell * state.angular_rate;
        let rate = Vector3::new(
            2.0 * xx * w.x + zx * w.z + xy * w.y,
            2.0 * yy * w.y + yz * w.z + xy * w.x,
            2.0 * zz * w.z + yz * w.y + zx * w.x,
        );
        let back = self.to_cell.transpose();
        let force = back * Vector3::new(ax, ay, az);
        variation.acceleration += state.rotation * force;
        variation.turn[0] += force.cross(&self.felt(state));
        variation.angular_rate(state, &(back * rate));
        variation.angular_acceleration(state, &(back * Vector3::new(dx, dy, dz)));
    }
}

/// Returns `log det M` and `M⁻¹`; `None` where something is left undetermined.
pub fn log_determinant(information: &Information) -> Option<(f64, Information)> {
    let full = Information::from_fn(|i, j| information[(i.min(j), i.max(j))]);
    // Units differ by orders of magnitude: a unit diagonal leaves the inverse its digits.
    let scale = full.diagonal().map(|d| 1.0 / d.sqrt());
    let scaled = Information::from_fn(|i, j| full[(i, j)] * scale[i] * scale[j]);
    let cholesky = scaled.cholesky()?;
    let log = 2.0 * cholesky.l_dirty().diagonal().map(f64::ln).sum() - 2.0 * scale.map(f64::ln).sum();
    let inverse = cholesky.inverse();
    let inverse = Information::from_fn(|i, j| inverse[(i, j)] * scale[i] * scale[j]);
    log.is_finite().then_some((log, inverse))
}

/// The value of small changes of the plate's motion: of the origin's place, velocity and acceleration in A,
/// and of the turn η in P and its two derivatives.
#[derive(Clone, Copy, Debug, Default)]
pub struct Variation {
    /// Variation of the place.
    pub place: Vector3<f64>,
    /// Variation of the velocity.
    pub velocity: Vector3<f64>,
    /// Variation of the acceleration.
    pub acceleration: Vector3<f64>,
    /// Variation of η, η', η''.
    pub turn: [Vector3<f64>; 3],
}

impl Variation {
    /// Adds what a change of ω is worth.
    pub fn angular_rate(&mut self, state: &PlateState, worth: &Vector3<f64>) {
        self.turn[1] += worth;
        self.turn[0] += worth.cross(&state.angular_rate);
    }

    fn angular_acceleration(&mut self, state: &PlateState, worth: &Vector3<f64>) {
        self.turn[2] += worth;
        self.turn[1] += worth.cross(&state.angular_rate);
        self.turn[0] += worth.cross(&state.angular_acceleration);
    }

    /// Converts the variation to one of the six coordinates and their derivatives: `η = E δr`,
    /// `η' = E' δr + E δr'`, `η'' = E'' δr + 2 E' δr' + E δr''`.
    pub fn coordinates(&self, c: &Coordinates) -> Coordinates {
        let [_, _, _, roll, pitch, _] = c.value;
        let [_, _, _, dr, dp, _] = c.rate;
        let [_, _, _, ddr, ddp, _] = c.acceleration;
        let ((sr, cr), (sp, cp)) = (roll.sin_cos(), pitch.sin_cos());
        // Columns of E: (1, 0, 0), (0, cr, −sr), (−sp, cp sr, cp cr); y and z by the product rule.
        let (d_cp, d_sp) = (-sp * dp, cp * dp);
        let (d_cr, d_sr) = (-sr * dr, cr * dr);
        let (dd_cp, dd_sp) = (-sp * ddp - cp * dp * dp, cp * ddp - sp * dp * dp);
        let (dd_cr, dd_sr) = (-sr * ddr - cr * dr * dr, cr * ddr - sr * dr * dr);
        let product = |a: [f64; 3], b: [f64; 3]| {
            [a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2.0 * a[1] * b[1] + a[0] * b[2]]
        };
        let zy = product([cp, d_cp, dd_cp], [sr, d_sr, dd_sr]);
        let zz = product([cp, d_cp, dd_cp], [cr, d_cr, dd_cr]);
        let (y1, y2) = ([cr, d_cr, dd_cr], [-sr, -d_sr, -dd_sr]);
        let zx = [-sp, -d_sp, -dd_sp];
        let e = |k: usize| {
            let one = if k == 0 { 1.0 } else { 0.0 };
            Matrix3::new(one, 0.0, zx[k], 0.0, y1[k], zy[k], 0.0, y2[k], zz[k]).transpose()
        };
        let [t0, t1, t2] = &self.turn;
        let six = |a: &Vector3<f64>, b: Vector3<f64>| [a.x, a.y, a.z, b.x, b.y, b.z];
        Coordinates {
            value: six(&self.place, e(0) * t0 + e(1) * t1 + e(2) * t2),
            rate: six(&self.velocity, e(0) * t1 + 2.0 * e(1) * t2),
            acceleration: six(&self.acceleration, e(0) * t2),
        }
    }
}
