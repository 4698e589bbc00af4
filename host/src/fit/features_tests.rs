use rigident_shared::calibration::Reading;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

use super::super::condition;
use super::super::linearised::{Columns, Linearised};
use super::*;
use crate::fit::{RowSource, Silent};
use crate::problem::body::{BodySource, prepare};
use crate::rig::RigFile;

const RATE_HZ: f64 = 200.0;

/// Two seconds of sines of unlike frequencies in every signal, and no readings for a while after the first.
fn source() -> BodySource {
    let wave = |t: f64, hz: f64, k: usize| (std::f64::consts::TAU * hz * t + k as f64).sin();
    let reading = |i: usize| {
        let t = i as f64 / RATE_HZ;
        Reading {
            time_ns: (t * 1e9) as u64 + if i > 200 { 300_000_000 } else { 0 },
            wrench: Wrench::from_array(std::array::from_fn(|k| 3.0 * wave(t, 1.1 + 0.7 * k as f64, k))),
            specific_force: SpecificForce::from_array(std::array::from_fn(|k| {
                9.0 * wave(t, 0.6 + 0.9 * k as f64, k)
            })),
            angular_rate: AngularRate::from_array(std::array::from_fn(|k| {
                2.0 * wave(t, 0.8 + 0.5 * k as f64, k)
            })),
        }
    };
    let rig =
        RigFile::parse("[[imu]]\nposition_m = [0.04, -0.03, 0.02]\nrotation_wxyz = [0.9, 0.1, -0.3, 0.3]\n")
            .unwrap();
    BodySource::new(prepare::input(&rig, (0..600).map(reading).collect(), false, RATE_HZ), rig.imu.first())
}

/// A covariance with correlated channels, and noise that rises with the frequency in two directions.
fn whitening() -> Whitening {
    let white =
        DMatrix::from_fn(
            6,
            6,
            |i, j| if i == j { 1.0 + 0.1 * i as f64 } else { 0.2 / (1.0 + (i + j) as f64) },
        );
    let j = DMatrix::from_fn(6, 2, |i, k| 3e-3 * ((1 + i) as f64 * (0.4 + k as f64)).cos());
    Whitening::of_spectrum(&white, &(&j * j.transpose()), 2.0, 2.0 / RATE_HZ).unwrap()
}

/// The triangle of the features has all that the rows have: the same factor, by another way.
#[test]
fn factors_of_features_are_those_of_rows() {
    let source = source();
    let blocks = source.condition(&Silent).unwrap();
    let columns = Columns::of(&source);
    let phi: Vec<f64> = (0..16).map(|j| 3.0 / (1.0 + j as f64)).collect();
    let linearised = Linearised::new(&source, &*blocks, &columns, &phi).unwrap();
    let (all, range) = (columns.all(), 3..blocks.len());
    for whitening in [whitening(), Whitening::diagonal(&[20.0, 21.0, 22.0, 300.0, 310.0, 320.0])] {
        let by_features = absorb(&linearised, range.clone(), all, &whitening);
        let by_rows = condition::absorb(&linearised, range.clone(), all, &whitening, None);
        let square = |factor: &Factor| factor.r().tr_mul(&factor.r());
        let (own, other) = (square(&by_features), square(&by_rows));
        for i in 0..all {
            for j in 0..all {
                let scale = (other[(i, i)] * other[(j, j)]).sqrt();
                assert!((own[(i, j)] - other[(i, j)]).abs() <= 1e-10 * scale, "{i} {j}");
            }
        }
        let pull = |factor: &Factor| factor.r().tr_mul(&nalgebra::DVector::from_column_slice(factor.z()));
        let whole = |factor: &Factor| {
            factor.z().iter().map(|z| z * z).sum::<f64>() + factor.residual_sum_of_squares()
        };
        assert!((pull(&by_features) - pull(&by_rows)).norm() < 1e-10 * pull(&by_rows).norm());
        assert!((whole(&by_features) / whole(&by_rows) - 1.0).abs() < 1e-10);
        assert_eq!(by_features.rows(), by_rows.rows());
    }
}

/// So has the Gram matrix.
#[test]
fn gram_matrices_of_features_are_those_of_rows() {
    let source = source();
    let blocks = source.condition(&Silent).unwrap();
    let columns = Columns::of(&source);
    let linearised = Linearised::new(&source, &*blocks, &columns, &[0.5; 16]).unwrap();
    let (whitening, all, count) = (whitening(), columns.all(), linearised.features());
    let mut features = vec![0.0; blocks.len() * count];
    features.chunks_exact_mut(count).enumerate().for_each(|(k, row)| linearised.write_features(k, row));
    let times: Vec<f64> = (0..blocks.len()).map(|k| blocks.time_s(k)).collect();
    let own = gram(&linearised, all, &whitening, &[(&times, &features)]);
    let r = condition::absorb(&linearised, 0..blocks.len(), all, &whitening, None).r();
    let other = r.tr_mul(&r);
    assert!((&own - &other).norm() < 1e-10 * other.norm());
}
