//! The estimator's promises about its answers, against a simulator that shares none of its algebra.
#![cfg(feature = "simulator")]

use hexapod::experiment::thesis_program;
use rigident::fit::{FILTER_WIDTH_S, row_every};
use rigident::laboratory::{mounting, reading};
use rigident::rig::FROZEN_AFTER;
use rigident::rows::body::Input;
use rigident_shared::Scalar;
use rigident_shared::estimator::{Estimator, EstimatorConfig};
use rigident_shared::screening::Limits;
use rigident_sim::rig::{Readings, RigConfig};
use rigident_sim::sensors::SensorModels;

use crate::fitting::{fit_body, states};

/// Thesis, Table 1: 95 % figures over 1.96.
const SIGMA: [f64; 6] = [9.9 / 1.96, 9.9 / 1.96, 19.8 / 1.96, 0.75 / 1.96, 0.9 / 1.96, 0.9 / 1.96];

fn estimator_config<T: Scalar>(
    config: &RigConfig,
    rate_hz: f64,
    known_offset: [f64; 6],
) -> EstimatorConfig<T> {
    let f = T::from_f64_const;
    EstimatorConfig {
        rate_hz: f(rate_hz),
        filter_width_s: f(FILTER_WIDTH_S),
        row_every: row_every(rate_hz),
        channel_sigma: SIGMA.map(f),
        known_offset: known_offset.map(f),
        mounting: mounting(config),
        limits: Limits::none(),
    }
}

/// Relative errors of mass, of m·c against m·|c|, and of the tensor in the Frobenius norm.
fn errors(got: &[f64], truth: &[f64; 10]) -> [f64; 3] {
    let norm = |v: &[f64], w: &[f64]| v.iter().zip(w).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    // Off-diagonal elements are twice in the matrix.
    let tensor = |p: &[f64]| -> Vec<f64> {
        p[4..10].iter().enumerate().map(|(k, v)| if k < 3 { *v } else { v * 2_f64.sqrt() }).collect()
    };
    let zero = [0.0; 6];
    [
        (got[0] - truth[0]).abs() / truth[0],
        norm(&got[1..4], &truth[1..4]) / norm(&truth[1..4], &zero[..3]),
        norm(&tensor(got), &tensor(truth)) / norm(&tensor(truth), &zero),
    ]
}

/// Noise, bias, bandwidth and quantisation off, float samples after the drivers: the firmware's f32 to 1e-4,
/// the host's batch in f64 to 1e-6; both mountings, both rates, ten and sixteen parameters.
#[test]
fn perfect_sensors_give_the_body() {
    for config in [RigConfig::thesis_horizontal(), RigConfig::thesis_vertical()] {
        let config = config.with_sensors(SensorModels::ideal());
        let program = thesis_program(&config.geometry, 30.0);
        for rate_hz in [200.0, 1000.0] {
            let readings = Readings::new(&config, &program, rate_hz).unwrap();
            let truth = readings.truth(1);
            let phi = truth.body.parameters();
            for known in [false, true] {
                let input = Input {
                    readings: readings.ideal().iter().map(reading).collect(),
                    is_static: false,
                    rate_hz,
                    mounting: mounting(&config),
                    channel_sigma: Some(SIGMA),
                    gyro_sigma: None,
                    known_offset: known.then_some([0.0; 6]),
                    nuisances: Vec::new(),
                    rests: Vec::new(),
                    beforehand: None,
                    limits: Limits { frozen_after: FROZEN_AFTER, ..Limits::none() },
                };
                let values: Vec<f64> =
                    states(&fit_body(&input)).iter().map(|state| state.measured().unwrap().value).collect();
                let e = errors(&values, &phi);
                assert!(e.iter().all(|e| *e < 1e-6), "f64 {rate_hz} {known}: {e:?}");

                let narrow: Vec<f64> = if known {
                    firmware::<10>(&config, rate_hz, &readings)
                } else {
                    firmware::<16>(&config, rate_hz, &readings)
                };
                let e = errors(&narrow, &phi);
                assert!(e.iter().all(|e| *e < 1e-4), "f32 {rate_hz} {known}: {e:?}");
            }
        }
    }
}

fn firmware<const N: usize>(config: &RigConfig, rate_hz: f64, readings: &Readings) -> Vec<f64> {
    let mut estimator = Estimator::<f32, N, 256>::new(&estimator_config(config, rate_hz, [0.0; 6])).unwrap();
    for row in readings.ideal() {
        estimator.absorb(&reading(row));
    }
    estimator.factor().solve().estimate.iter().map(|v| f64::from(*v)).collect()
}
