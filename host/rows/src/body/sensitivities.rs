//! Columns of the errors of the IMU: what each changes in the wrench that the parameters predict.
//!
//! The regressor is linear in specific force, rates' products and angular acceleration, so that an error
//! moves its signals first, and these the wrench: `c_k = A(∂s/∂θ_k) φ`. With the axis u of the IMU in S, an
//! error of size θ of the sensor leaves the truth θ the other way:
//! ```text
//! lever arm e      a_S ← a_S − (ω̇×e + ω×(ω×e))
//! rotation  e      a, ω̇ ← a + e×a, ω̇ + e×ω̇;  ωωᵀ ← ωωᵀ + [e]×ωωᵀ − ωωᵀ[e]×
//! skew             s ← s + ṡ
//! gyro bias u      ωωᵀ ← ωωᵀ − (u ωᵀ + ω uᵀ)
//! gyro scale u     ω̇ ← ω̇ − u uᵀω̇;  ωωᵀ ← ωωᵀ − (u uᵀ ωωᵀ + ωωᵀ u uᵀ)
//! gyro rotation u  ω̇ ← ω̇ + u×ω̇;  ωωᵀ ← ωωᵀ + [u]×ωωᵀ − ωωᵀ[u]×
//! accel. bias u    a ← a − u
//! accel. scale u   a ← a − u uᵀa
//! misalignment     a ← a − u_i u_jᵀa, (i, j) = (y, x), (z, x), (z, y)
//! gravity γ        a ← a (1 + γ)
//! ```

use nalgebra::{Matrix3, Vector3};
use rigident_shared::regressor::{self, SIGNALS};
use rigident_shared::spatial::{Position, Sensor};

use super::WRENCH;

/// Groups of errors.
pub const ERRORS: usize = 9;
/// Errors of all groups.
pub(super) const COLUMNS: usize = 26;
/// Axes of the misalignments: the first reads a share of the second.
pub const PAIRS: [(usize, usize); 3] = [(1, 0), (2, 0), (2, 1)];

/// A group of errors of the IMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImuError {
    /// Place of the IMU in S.
    LeverArm,
    /// Attitude of the IMU in S, about the axes of S.
    Rotation,
    /// Delay of the IMU's stamps: what it reads was earlier.
    Skew,
    /// Bias of the gyro, axes of the IMU.
    GyroBias,
    /// Scale of the gyro, axes of the IMU.
    GyroGain,
    /// Attitude of the gyro's axes against those of the IMU, about these.
    GyroRotation,
    /// Bias of the accelerometer, axes of the IMU.
    AccelBias,
    /// Scale of the accelerometer, axes of the IMU.
    AccelGain,
    /// Angles between the axes of the accelerometer.
    AccelMisalignment,
    /// Gravity that is stated in place of what an accelerometer reads, relative.
    Gravity,
}

impl ImuError {
    /// Returns the number of its first error.
    pub fn first(self) -> usize {
        match self {
            Self::LeverArm => 0,
            Self::Rotation => 3,
            Self::Skew => 6,
            Self::GyroBias => 7,
            Self::GyroGain => 10,
            Self::GyroRotation => 13,
            Self::AccelBias => 16,
            Self::AccelGain => 19,
            Self::AccelMisalignment => 22,
            Self::Gravity => 25,
        }
    }

    /// Returns how many errors there are of it.
    pub fn count(self) -> usize {
        if matches!(self, Self::Skew | Self::Gravity) { 1 } else { 3 }
    }

    /// Returns true if what is at rest does not show it.
    pub fn is_of_motion(self) -> bool {
        matches!(self, Self::LeverArm | Self::Skew | Self::GyroBias | Self::GyroGain | Self::GyroRotation)
    }
}

/// The moving part of a body's signals.
struct Kinematics {
    /// Specific force at the IMU.
    force: Vector3<f64>,
    /// `ωωᵀ`
    products: Matrix3<f64>,
    acceleration: Vector3<f64>,
}

impl Kinematics {
    fn of(signals: &[f64; SIGNALS]) -> Self {
        let [x, y, z, xx, yy, zz, yz, zx, xy, ..] = *signals;
        Self {
            force: Vector3::new(x, y, z),
            products: Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz),
            acceleration: Vector3::new(signals[15], signals[16], signals[17]),
        }
    }

    fn signals(&self) -> [f64; SIGNALS] {
        let (f, p, a) = (&self.force, &self.products, &self.acceleration);
        let mut signals = [0.0; SIGNALS];
        signals[..9].copy_from_slice(&[
            f.x,
            f.y,
            f.z,
            p[(0, 0)],
            p[(1, 1)],
            p[(2, 2)],
            p[(1, 2)],
            p[(2, 0)],
            p[(0, 1)],
        ]);
        signals[15..].copy_from_slice(a.as_slice());
        signals
    }
}

/// A row block with what its neighbours say.
pub(super) struct Block<'a> {
    /// Conditioned signals in the axes of S.
    pub(super) signals: &'a [f64; SIGNALS],
    /// The value of a constant in the block: one, and nothing in a difference of blocks.
    pub(super) one: f64,
    /// Conditioned rate of turn in the axes of S, rad/s.
    pub(super) rate: Vector3<f64>,
    /// The signals' derivatives, 1/s.
    pub(super) slope: [f64; SIGNALS],
    /// Axes of the IMU in S, columns.
    pub(super) axes: Matrix3<f64>,
    pub(super) lever_arm: Position<Sensor, f64>,
}

impl Block<'_> {
    /// Writes the columns of the first errors, six rows of as many as there is room for, about the body's
    /// parameters `phi`.
    pub(super) fn write(&self, phi: &[f64], out: &mut [f64]) {
        let now = Kinematics::of(self.signals);
        let count = out.len() / WRENCH;
        for (k, moved) in (0..count.min(COLUMNS)).map(|k| (k, self.moved(&now, k))) {
            // What moves the specific force at S's own origin has no lever arm.
            let at = if k < 3 { Position::zero() } else { self.lever_arm };
            let block = regressor::block(&moved.signals(), &at);
            for c in 0..WRENCH {
                if let Some(to) = out.get_mut(c * count + k) {
                    *to = block.columns.iter().zip(phi).map(|(column, phi)| column[c] * phi).sum();
                }
            }
        }
    }

    /// Returns what an error of unit size moves.
    fn moved(&self, now: &Kinematics, k: usize) -> Kinematics {
        let none = (Vector3::zeros(), Matrix3::zeros(), Vector3::zeros());
        let axis = |first: usize| self.axes.column(k - first).into_owned();
        let (force, products, acceleration) = match k {
            0..3 => {
                let e = Matrix3::identity().column(k).into_owned();
                let trace = now.products.trace();
                let turning = now.products * e - e * trace;
                (-(now.acceleration.cross(&e) + turning), none.1, none.2)
            }
            3..6 => {
                let e: Vector3<f64> = Matrix3::identity().column(k - 3).into_owned();
                let cross = e.cross_matrix();
                (cross * now.force, cross * now.products - now.products * cross, cross * now.acceleration)
            }
            6 => {
                let slope = Kinematics::of(&self.slope);
                (slope.force, slope.products, slope.acceleration)
            }
            7..10 => {
                let u = axis(7);
                (none.0, -(u * self.rate.transpose() + self.rate * u.transpose()), none.2)
            }
            10..13 => {
                let u = axis(10);
                let along = u * u.transpose();
                (none.0, -(along * now.products + now.products * along), -(along * now.acceleration))
            }
            13..16 => {
                let cross = axis(13).cross_matrix();
                (none.0, cross * now.products - now.products * cross, cross * now.acceleration)
            }
            16..19 => (-axis(16) * self.one, none.1, none.2),
            19..22 => {
                let u = axis(19);
                (-u * u.dot(&now.force), none.1, none.2)
            }
            25 => (now.force, none.1, none.2),
            _ => {
                let (i, j) = PAIRS.get(k.saturating_sub(22)).copied().unwrap_or((1, 0));
                let (to, from) = (self.axes.column(i).into_owned(), self.axes.column(j).into_owned());
                (-to * from.dot(&now.force), none.1, none.2)
            }
        };
        Kinematics { force, products, acceleration }
    }
}
