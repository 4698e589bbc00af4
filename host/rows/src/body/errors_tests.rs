use nalgebra::{DMatrix, SymmetricEigen, Vector3};
use rigident_shared::regressor::{self, SIGNALS};
use rigident_shared::spatial::{Position, Wrench};

use super::*;
use crate::body::sensitivities::Block;
use rigident_io::rig::RigFile;
use rigident_io::rig::calibration::CalibratedRig;

/// A calibration file may hold every error that runs of a rig share, in the unit that it has here.
#[test]
fn a_calibration_knows_every_error_of_a_rig() {
    let reading =
        Reading { wrench: Wrench::from_array([30.0, 20.0, 10.0, 1.0, 2.0, 3.0]), ..Reading::default() };
    let mut all = nuisances(&ImuTable::default(), &LoadCellTable::default(), &[reading], false);
    all.extend(of_gravity(9.80665, None, true));
    all.retain(|k| k.scope == Scope::Rig);
    // Place, attitude, scale and attitude of the gyro, scale and angles of the accelerometer, gains,
    // cross-talk, gravity.
    assert_eq!(all.len(), 18 + 6 + 30 + 1);
    let known: Vec<(String, f64, f64)> = all.iter().map(|k| (k.name.clone(), 0.0, k.sigma)).collect();
    let units: Vec<String> = all.iter().map(|k| k.unit.clone()).collect();
    let of = CalibratedRig::of(&RigFile::default()).unwrap();
    let written = RigCalibration::of(&Gaussian::independent(&known).unwrap(), &units, of).sealed();
    assert_eq!(RigCalibration::parse(&written.to_toml(), "x").unwrap().error.len(), all.len());
}

/// Turning the IMU, turning its gyro, and the triangle of the accelerometer are twelve directions: none is a
/// sum of the others.
#[test]
fn the_rotation_of_the_gyro_is_no_other_error() {
    const PHI: [f64; 10] = [3.2, 0.1, -0.06, 0.26, 0.05, 0.05, 0.02, 0.001, -0.002, 0.003];
    let first = |error: ImuError| error.first()..error.first() + error.count();
    let columns: Vec<usize> =
        [ImuError::Rotation, ImuError::GyroRotation, ImuError::AccelGain, ImuError::AccelMisalignment]
            .into_iter()
            .flat_map(first)
            .collect();
    let count = ImuError::Gravity.first();
    let mut gram = DMatrix::zeros(columns.len(), columns.len());
    for k in 0..60 {
        let wave = |i: usize| (0.7 * k as f64 * (1.0 + 0.31 * i as f64) + i as f64).sin();
        let three = |i: usize| std::array::from_fn(|axis| wave(3 * i + axis));
        let force = [2.0 * wave(0), 2.0 * wave(1), 9.8 + wave(2)];
        let mut signals = regressor::signals(force, three(1), [0.0; 6]);
        signals[SIGNALS - 3..].copy_from_slice(&three(2).map(|v| 4.0 * v));
        let block = Block {
            signals: &signals,
            one: 1.0,
            rate: Vector3::from(three(1)),
            slope: [0.0; SIGNALS],
            axes: *nalgebra::Rotation3::from_euler_angles(0.2, -0.4, 1.1).matrix(),
            lever_arm: Position::zero(),
        };
        let mut out = vec![0.0; WRENCH * count];
        block.write(&PHI, &mut out);
        // Moments in units of a tenth of the forces, as a load cell has them.
        for (c, row) in out.chunks_exact(count).enumerate() {
            let own = nalgebra::DVector::from_iterator(columns.len(), columns.iter().map(|k| row[*k]));
            gram += &own * own.transpose() * if c < 3 { 1.0 } else { 100.0 };
        }
    }
    let size = gram.diagonal().map(f64::sqrt);
    let correlation = DMatrix::from_fn(size.len(), size.len(), |i, j| gram[(i, j)] / (size[i] * size[j]));
    let least = SymmetricEigen::new(correlation).eigenvalues.min();
    // A duplicate has rounding, 1e-16.
    assert!(least > 1e-4, "{least}");
}
