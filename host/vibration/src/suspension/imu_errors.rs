//! Errors of an IMU on the platform, counted in the modes that are found by it.
//!
//! Scales, axes, place and attitude of an IMU are the same in all modes: amplitudes X = T(e) Z of the
//! platform gain the covariance `Σ σ² (∂X/∂e) (∂X/∂e)ᵀ`, which couples the modes. Gravity in the IMU's axes
//! is what it reads on average, so that its attitude counts only in the axes of shifts and turns; a bias
//! tilts it. A delay of all channels and a bias of the gyro are in no mode.

use nalgebra::{Complex, DVector, Matrix3, Rotation3, Vector3};

use super::mount::Mount;
use crate::modal_analysis::{Amplitudes, Imu, ModalError, platform_amplitudes};
use rigident_io::rig::{ImuTable, RigFile, SuspensionTable};
use rigident_rows::body::errors::of_imu;
use rigident_rows::body::sensitivities::{ImuError, PAIRS};
use rigident_rows::tree::joints::attitude;

/// Step of derivatives: errors enter almost linearly, and rounding is ten orders smaller.
const STEP: f64 = 1e-5;
/// A mean specific force that is off gravity by more, relative, is no mean about rest.
const AT_REST: f64 = 0.1;

/// An IMU on a platform.
#[derive(Clone, Debug)]
pub(super) struct MountedImu {
    own: ImuTable,
    mount: Mount,
    /// Mean specific force, axes of the IMU, m/s².
    mean: Vector3<f64>,
    gravity_mps2: f64,
}

/// The possible errors of it: place in S, m; attitude about the axes of S, rad; bias of the accelerometer,
/// m/s².
#[derive(Clone, Copy, Debug)]
struct Off {
    place: Vector3<f64>,
    turn: Vector3<f64>,
    bias: Vector3<f64>,
}

impl Off {
    fn none() -> Self {
        Self { place: Vector3::zeros(), turn: Vector3::zeros(), bias: Vector3::zeros() }
    }
}

impl MountedImu {
    /// Returns the first IMU of a rig file with the mean of what it reads.
    pub(super) fn new(rig: &RigFile, table: &SuspensionTable, force: &[[f64; 3]]) -> Self {
        let mean = force.iter().map(|f| Vector3::from(*f)).sum::<Vector3<f64>>() / force.len().max(1) as f64;
        Self {
            own: rig.imu.first().cloned().unwrap_or_default(),
            mount: Mount::of(table),
            mean,
            gravity_mps2: rig.recording.gravity_mps2,
        }
    }

    /// Returns where it is against O, in the platform's axes.
    pub(super) fn as_stated(&self) -> Imu {
        self.imu(&Off::none())
    }

    fn imu(&self, off: &Off) -> Imu {
        let turned = Rotation3::from_scaled_axis(off.turn).into_inner();
        let own = attitude(&self.own.rotation_wxyz).unwrap_or_else(Matrix3::identity);
        let axes = self.mount.rotation * turned * own;
        let read = self.mean - off.bias;
        let rests = (read.norm() / self.gravity_mps2 - 1.0).abs() < AT_REST;
        let up = if rests { axes * read.normalize() } else { Vector3::z() };
        Imu {
            lever: self.mount.arm + self.mount.rotation * (Vector3::from(self.own.position_m) + off.place),
            axes,
            gravity: -up * self.gravity_mps2,
        }
    }

    /// Returns the amplitudes of the platform by those of the IMU's channels, with the IMU's errors in their
    /// covariance.
    ///
    /// # Errors
    /// [`ModalError`] if there are not six channels.
    pub(super) fn counted(&self, read: &Amplitudes, platform: &Amplitudes) -> Result<Amplitudes, ModalError> {
        let mut all = platform.clone();
        for (error, axis, nuisance) in of_imu(&self.own, false) {
            let Some(moved) = self.moved(read, error, axis)? else { continue };
            let stride = platform.stride();
            let channels = platform.complex.nrows();
            let mut change = DVector::zeros(platform.covariance.nrows());
            for r in 0..platform.complex.ncols() {
                for c in 0..channels {
                    let by: Complex<f64> = (moved.complex[(c, r)] - platform.complex[(c, r)]) / STEP;
                    let at = r * stride + 2 + c;
                    (change[at], change[at + channels]) = (by.re * nuisance.sigma, by.im * nuisance.sigma);
                }
            }
            all.covariance += &change * change.transpose();
        }
        Ok(all)
    }

    /// Returns the amplitudes of the platform if an error is a step larger; `None` of one that no mode has.
    fn moved(
        &self,
        read: &Amplitudes,
        error: ImuError,
        axis: usize,
    ) -> Result<Option<Amplitudes>, ModalError> {
        let unit = Vector3::ith(axis, STEP);
        let scaled = Matrix3::identity() + Matrix3::from_diagonal(&unit);
        let (i, j) = PAIRS[axis.min(2)];
        let mut crossed = Matrix3::identity();
        crossed[(i, j)] = STEP;
        let turned = Rotation3::from_scaled_axis(unit).into_inner();
        let none = Off::none();
        let (off, force, rate) = match error {
            ImuError::LeverArm => (Off { place: unit, ..none }, Matrix3::identity(), Matrix3::identity()),
            ImuError::Rotation => (Off { turn: unit, ..none }, Matrix3::identity(), Matrix3::identity()),
            ImuError::AccelBias => (Off { bias: unit, ..none }, Matrix3::identity(), Matrix3::identity()),
            ImuError::AccelGain => (none, scaled, Matrix3::identity()),
            ImuError::AccelMisalignment => (none, crossed, Matrix3::identity()),
            ImuError::GyroGain => (none, Matrix3::identity(), scaled),
            ImuError::GyroRotation => (none, Matrix3::identity(), turned),
            ImuError::Skew | ImuError::GyroBias | ImuError::Gravity => return Ok(None),
        };
        let mut other = read.clone();
        for r in 0..other.complex.ncols() {
            let z = read.complex.column(r);
            for c in 0..3 {
                let of = |by: &Matrix3<f64>, from: usize| -> Complex<f64> {
                    (0..3).map(|k| z[from + k] * by[(c, k)]).sum()
                };
                (other.complex[(c, r)], other.complex[(c + 3, r)]) = (of(&force, 0), of(&rate, 3));
            }
        }
        platform_amplitudes(&self.imu(&off), &other).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution as _, StandardNormal};

    use super::*;

    const RIG: &str = "[suspension]\nat_m = [0.0, 0.0, 0.02]\nbase_position_m = [0.1, 0.0, \
                       0.05]\nanchor_height_m = 0.0\nspring = \
                       [{ at_m = [0.4, 0.3, 0.0], axial_npm = 9e3 }]\n[[imu]]\nposition_m = [0.2, -0.1, \
                       0.3]\nrotation_wxyz = [0.5, 0.5, 0.5, 0.5]\n\
                       accel_bias_std_mps2 = 0.03\naccel_gain_std = 0.003\naccel_misalignment_std_rad = \
                       0.002\ngyro_gain_std = 0.004\n\
                       gyro_rotation_std_rad = 0.002\nposition_std_m = 0.002\nrotation_std_rad = 0.005\n";

    /// Returns what an IMU at a place reads of a swing, by the motion itself: shift X and turn Θ at the pole
    /// s.
    fn read(
        (x, turn): (Vector3<Complex<f64>>, Vector3<Complex<f64>>),
        s: Complex<f64>,
        (place, axes): (Vector3<f64>, Matrix3<f64>),
    ) -> (Vector3<Complex<f64>>, Vector3<Complex<f64>>) {
        let complex = |v: Vector3<f64>| v.map(|v| Complex::new(v, 0.0));
        let inverse = axes.transpose().map(|v| Complex::new(v, 0.0));
        let gravity = complex(Vector3::new(0.0, 0.0, -9.80665));
        let force = (x + turn.cross(&complex(place))) * (s * s) + turn.cross(&gravity);
        (inverse * force, inverse * turn * s)
    }

    #[test]
    fn errors_of_an_imu_are_as_large_in_the_modes_as_they_are_drawn() {
        let rig = RigFile::parse(RIG).unwrap();
        let table = rig.suspension.clone().unwrap();
        let axes = attitude(&[0.5; 4]).unwrap();
        let place = Vector3::new(0.3, -0.1, 0.33);
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut draw = |sigma: f64| -> f64 {
            let drawn: f64 = StandardNormal.sample(&mut rng);
            sigma * drawn
        };
        let s = Complex::new(-0.02, 11.0);
        let vector = |v: [f64; 3]| Vector3::from(v.map(|v| Complex::new(v, 0.2 * v)));
        let truth = (vector([2e-3, -1e-3, 5e-3]), vector([4e-3, 1e-2, -6e-3]));
        let (mut squares, runs) = (vec![0.0; 6], 400);
        for _ in 0..runs {
            let three = |draw: &mut dyn FnMut(f64) -> f64, sigma: f64| Vector3::from_fn(|_, _| draw(sigma));
            let turned = Rotation3::from_scaled_axis(three(&mut draw, 0.005)).into_inner() * axes;
            let (mut force, mut rate) = read(truth, s, (place + three(&mut draw, 0.002), turned));
            let (gains, spins, cross) =
                (three(&mut draw, 0.003), three(&mut draw, 0.004), three(&mut draw, 0.002));
            let mean = turned.transpose() * Vector3::new(0.0, 0.0, 9.80665) + three(&mut draw, 0.03);
            let other = Rotation3::from_scaled_axis(three(&mut draw, 0.002)).into_inner();
            rate = other.map(|v| Complex::new(v, 0.0)) * rate;
            let own = force;
            for (k, (i, j)) in PAIRS.iter().enumerate() {
                force[*i] += own[*j] * cross[k];
            }
            for k in 0..3 {
                force[k] *= 1.0 + gains[k];
                rate[k] *= 1.0 + spins[k];
            }
            let imu = MountedImu::new(&rig, &table, &[mean.into()]);
            let six: Vec<Complex<f64>> = force.iter().chain(rate.iter()).copied().collect();
            let amplitudes = Amplitudes {
                angular: vec![s.norm()],
                damping: vec![-s.re / s.norm()],
                complex: DMatrix::from_column_slice(6, 1, &six),
                covariance: DMatrix::zeros(14, 14),
            };
            let platform = platform_amplitudes(&imu.as_stated(), &amplitudes).unwrap();
            let counted = imu.counted(&amplitudes, &platform).unwrap();
            for (c, square) in squares.iter_mut().enumerate() {
                let wanted = if c < 3 { truth.0[c] } else { truth.1[c - 3] };
                let sd = counted.covariance[(2 + c, 2 + c)].sqrt();
                *square += ((platform.complex[(c, 0)].re - wanted.re) / sd).powi(2) / f64::from(runs);
            }
        }
        // Of 400 draws a variance has a standard deviation of 7 %.
        assert!(squares.iter().all(|square| (0.75..1.3).contains(square)), "{squares:?}");
    }
}
