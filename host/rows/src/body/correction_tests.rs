use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::regressor::{self, SMOOTHED};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, Position, Rotation, SpecificForce, Wrench};

use super::*;
use crate::body::{BodySource, Input, errors};
use rigident_fit::{Fit, FitOptions, Gaussian, RowSource, Silent, fit};
use rigident_io::rig::{ImuTable, LoadCellTable};

const RATE_HZ: f64 = 200.0;
const PHI: [f64; 10] = [3.2, 0.09, -0.06, 0.25, 0.045, 0.05, 0.02, 1e-3, -2e-3, 3e-3];
const LEVER_ARM: [f64; 3] = [0.04, -0.03, 0.02];

fn nominal() -> ImuMounting<f64> {
    let q = nalgebra::UnitQuaternion::from_euler_angles(0.2, -0.4, 1.1);
    ImuMounting {
        position: Position::from_array(LEVER_ARM),
        rotation: Rotation::from_quaternion([q.w, q.i, q.j, q.k]).unwrap(),
        ..ImuMounting::default()
    }
}

/// Returns error `k` of a rig: about its standard deviation, of either sign.
fn size(nuisance: &Nuisance, k: usize) -> f64 {
    nuisance.sigma * [1.3, -0.8, 1.7, -1.1, 0.6][k % 5]
}

/// Readings of a body that turns, of sensors with errors, by what each sensor does: nothing here is
/// linearised.
fn readings(of: &dyn Fn(&str) -> f64) -> Vec<Reading<f64>> {
    let three = |stem: &str| Vector3::from(["x", "y", "z"].map(|axis| of(&format!("{stem}_{axis}"))));
    let mounted = Rotation3::new(three("imu_rotation")).matrix() * nominal().rotation.matrix();
    let gyro_in_imu = *Rotation3::new(three("gyro_rotation")).matrix();
    let place = Vector3::from(LEVER_ARM) + three("lever_arm");
    let [yx, zx, zy] = <[f64; 3]>::from(three("accelerometer_misalignment"));
    let scale = three("accelerometer_scale");
    (0..3000)
        .map(|row| {
            let t = row as f64 / RATE_HZ;
            let sine = |k: usize| {
                let w = 1.5 + 1.3 * k as f64;
                [(w * t + 3.0 * k as f64).sin(), w * (w * t + 3.0 * k as f64).cos()]
            };
            let rate = Vector3::from_fn(|k, _| sine(k)[0]);
            let turning = Vector3::from_fn(|k, _| sine(k)[1]);
            let force = Vector3::new(2.0 * sine(3)[0], 2.0 * sine(4)[0], 9.8 + sine(5)[0]);
            let mut signals = regressor::signals(force.into(), rate.into(), [0.0; 6]);
            signals[SMOOTHED..].copy_from_slice(turning.as_slice());
            let block = regressor::block(&signals, &Position::zero());
            let load: [f64; 6] = std::array::from_fn(|c| {
                block.columns.iter().zip(PHI).map(|(column, phi)| column[c] * phi).sum()
            });
            let names = crate::body::CHANNELS;
            let wrench = std::array::from_fn(|to| {
                let leaked = (0..6)
                    .filter(|from| *from != to)
                    .map(|from| of(&format!("crosstalk_{}_{}", names[to], names[from])) * load[from]);
                load[to] * (1.0 + of(&format!("gain_{}", names[to]))) + leaked.sum::<f64>()
            });
            let felt = force + turning.cross(&place) + rate.cross(&rate.cross(&place));
            let a = mounted.tr_mul(&felt);
            let read = [
                a.x * (1.0 + scale.x),
                a.y * (1.0 + scale.y) + yx * a.x,
                a.z * (1.0 + scale.z) + zx * a.x + zy * a.y,
            ];
            let w = gyro_in_imu.tr_mul(&mounted.tr_mul(&rate));
            let w = w + w.component_mul(&three("gyro_scale"));
            Reading {
                time_ns: (t * 1e9).round() as u64,
                wrench: Wrench::from_array(wrench),
                specific_force: SpecificForce::from_array(read),
                angular_rate: AngularRate::from_array(w.into()),
            }
        })
        .collect()
}

fn source(readings: Vec<Reading<f64>>) -> BodySource {
    let cell =
        LoadCellTable { range_n_nm: Some([100.0, 100.0, 100.0, 5.0, 5.0, 5.0]), ..LoadCellTable::default() };
    let input = Input {
        nuisances: errors::nuisances(&ImuTable::default(), &cell, &readings, false),
        readings,
        is_static: false,
        rate_hz: RATE_HZ,
        mounting: nominal(),
        channel_sigma: Some([0.01, 0.01, 0.01, 4e-4, 4e-4, 4e-4]),
        gyro_sigma: None,
        known_offset: None,
        rests: Vec::new(),
        beforehand: None,
        limits: Limits { frozen_after: 0, ..Limits::none() },
    };
    let imu = ImuTable { accel_noise_mps2: Some(1e-6), gyro_noise_radps: Some(1e-7), ..ImuTable::default() };
    BodySource::new(input, Some(&imu))
}

fn fitted(source: &BodySource) -> Fit {
    fit(source, &FitOptions { convergence_points: 0, ..FitOptions::default() }, &Silent).unwrap()
}

/// A rig of data-sheet errors whose sizes a calibration tells gives the body that an exact rig gives, and its
/// errors as they were reported. To first order alone the largest of the ten parameters is off by more than
/// what noise leaves of them.
#[test]
fn errors_that_are_known_move_nothing() {
    let shared: Vec<Nuisance> =
        source(readings(&|_| 0.0)).nuisances().into_iter().filter(|k| k.scope == Scope::Rig).collect();
    let sizes: Vec<(String, f64)> =
        shared.iter().enumerate().map(|(k, own)| (own.name.clone(), size(own, k))).collect();
    let of = |name: &str| sizes.iter().find(|(own, _)| own == name).map_or(0.0, |(_, value)| *value);
    let stated = |scale: f64| {
        let known: Vec<(String, f64, f64)> =
            shared.iter().map(|k| (k.name.clone(), scale * of(&k.name), 1e-3 * k.sigma)).collect();
        Gaussian::independent(&known).unwrap()
    };
    let exact = fitted(&source(readings(&|_| 0.0)).informed(stated(0.0)));
    let rig = source(readings(&of)).informed(stated(1.0));
    let (first_order, corrected) = (fitted(&rig), fitted(&rig.clone().linearised(&stated(1.0))));
    let furthest = |found: &Fit| {
        (0..10).fold(0.0_f64, |most, j| {
            let (a, b) = (exact.estimate.measured(j).unwrap(), found.estimate.measured(j).unwrap());
            most.max((a.value - b.value).abs() / a.u95)
        })
    };
    assert!(furthest(&first_order) > 1.0, "{}", furthest(&first_order));
    assert!(furthest(&corrected) < 1e-2, "{}", furthest(&corrected));
    for found in corrected.nuisances.iter().filter(|k| k.nuisance.scope == Scope::Rig) {
        let truth = of(&found.nuisance.name);
        assert!((found.expected - truth).abs() < 1e-12, "{}", found.nuisance.name);
        assert!((found.value - truth).abs() < found.nuisance.sigma, "{} {truth}", found.nuisance.name);
    }
}
