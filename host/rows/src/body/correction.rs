//! Signals without the errors that a calibration found: what the columns of those that are left are
//! linearised about.
//!
//! The columns are of first order, and with errors of a per cent the products of two of them, 1e-4, are no
//! longer small beside what a calibrated rig is good for. Errors that all runs of a rig share act on specific
//! force, rate and wrench by constant matrices, so that they are taken off the conditioned signals as they
//! are, products of rates included. With the axes A of the IMU in S
//! ```text
//! a ← R A E⁻¹ Aᵀ a        ω ← R A G D⁻¹ Aᵀ ω        w ← M⁻¹ w
//! ```
//! E being scales and angles of the accelerometer, D the scales of the gyro and G its rotation, R the
//! rotation of the IMU, and M the gains and the cross-talk of the load cell.

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3};
use rigident_shared::regressor::SIGNALS;

use super::WRENCH;
use super::sensitivities::{ImuError, PAIRS};
use rigident_fit::{Effect, Nuisance, Scope};

/// Signals of the wrench.
const FIRST_OF_WRENCH: usize = 9;
/// Signals of the angular acceleration.
const FIRST_OF_ACCELERATION: usize = FIRST_OF_WRENCH + WRENCH;

/// Returns true if an error can be taken off the signals.
pub(super) fn is_correctable(nuisance: &Nuisance) -> bool {
    let acts = match nuisance.effect {
        Effect::Gain { .. } | Effect::CrossTalk { .. } => true,
        Effect::Signal(k) => k < ImuError::Gravity.first(),
        Effect::Drift { .. } | Effect::None => false,
    };
    acts && nuisance.scope == Scope::Rig
}

/// The correction that takes errors off conditioned signals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Correction {
    force: Matrix3<f64>,
    rate: Matrix3<f64>,
    wrench: Matrix6<f64>,
    /// The distance of the IMU from its stated place, m.
    pub(super) lever_arm: Vector3<f64>,
    /// The turn of it against its stated attitude.
    rotation: Matrix3<f64>,
}

impl Correction {
    /// Returns the correction for errors with their values, of an IMU whose axes in S are the columns of
    /// `axes`; `None` if they leave no sensor.
    pub(super) fn new<'a>(
        errors: impl Iterator<Item = (&'a Nuisance, f64)>,
        axes: &Matrix3<f64>,
    ) -> Option<Self> {
        let mut all = vec![0.0; ImuError::Gravity.first()];
        let mut cell = Matrix6::identity();
        for (nuisance, value) in errors {
            match nuisance.effect {
                Effect::Gain { channel } if channel < WRENCH => cell[(channel, channel)] += value,
                Effect::CrossTalk { from, to } if from.max(to) < WRENCH => cell[(to, from)] += value,
                Effect::Signal(k) => all.iter_mut().skip(k).take(1).for_each(|own| *own = value),
                _ => {}
            }
        }
        let of = |error: ImuError| {
            Vector3::from_fn(|axis, _| all.get(error.first() + axis).copied().unwrap_or(0.0))
        };
        let scale = |error: ImuError| Matrix3::from_diagonal(&of(error).add_scalar(1.0));
        let mut accelerometer = scale(ImuError::AccelGain);
        for ((i, j), angle) in PAIRS.into_iter().zip(of(ImuError::AccelMisalignment).iter()) {
            accelerometer[(i, j)] = *angle;
        }
        let rotation = *Rotation3::new(of(ImuError::Rotation)).matrix();
        let turned = *Rotation3::new(of(ImuError::GyroRotation)).matrix();
        let gyro = turned * scale(ImuError::GyroGain).try_inverse()?;
        Some(Self {
            force: rotation * axes * accelerometer.try_inverse()? * axes.transpose(),
            rate: rotation * axes * gyro * axes.transpose(),
            wrench: cell.try_inverse()?,
            lever_arm: of(ImuError::LeverArm),
            rotation,
        })
    }

    /// Returns the axes of the IMU as they are.
    pub(super) fn axes(&self, axes: &Matrix3<f64>) -> Matrix3<f64> {
        self.rotation * axes
    }

    /// Returns the rate of turn without the errors.
    pub(super) fn rate(&self, rate: [f64; 3]) -> [f64; 3] {
        (self.rate * Vector3::from(rate)).into()
    }

    /// Takes the errors off signals in the axes of S.
    pub(super) fn signals(&self, signals: &mut [f64; SIGNALS]) {
        let [x, y, z, xx, yy, zz, yz, zx, xy, ..] = *signals;
        let force = self.force * Vector3::new(x, y, z);
        let products = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
        let p = self.rate * products * self.rate.transpose();
        let moved =
            [force.x, force.y, force.z, p[(0, 0)], p[(1, 1)], p[(2, 2)], p[(1, 2)], p[(2, 0)], p[(0, 1)]];
        let (motion, rest) = signals.split_at_mut(FIRST_OF_WRENCH);
        motion.copy_from_slice(&moved);
        let (wrench, acceleration) = rest.split_at_mut(FIRST_OF_ACCELERATION - FIRST_OF_WRENCH);
        wrench.copy_from_slice((self.wrench * nalgebra::Vector6::from_row_slice(wrench)).as_slice());
        acceleration.copy_from_slice((self.rate * Vector3::from_row_slice(acceleration)).as_slice());
    }
}

#[cfg(test)]
#[path = "correction_tests.rs"]
mod tests;
