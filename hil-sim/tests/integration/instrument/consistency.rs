//! Every tensor that the device sends is one that a body can have.

use hexapod::BodyParameters;
use nalgebra::{Matrix4, SMatrix, SVector};
use rigident_shared::wire::{Consistency, EstimateReport};
use rigident_sim::rig::RigConfig;
use rigident_sim::sensors::SensorModels;

use super::host::{Host, message, readings, settings};

/// Returns the smallest eigenvalue of the pseudo-inertia `[[½ tr(I) 1 − I, mc], [mcᵀ, m]]`, of the numbers as
/// they were sent.
fn least_eigenvalue(report: &EstimateReport) -> f64 {
    let p: Vec<f64> = report.estimate.iter().map(|v| f64::from(*v)).collect();
    let half = 0.5 * (p[4] + p[5] + p[6]);
    #[rustfmt::skip]
    let pseudo = Matrix4::new(
        half - p[4], -p[9],       -p[8],       p[1],
        -p[9],       half - p[5], -p[7],       p[2],
        -p[8],       -p[7],       half - p[6], p[3],
        p[1],        p[2],        p[3],        p[0],
    );
    pseudo.symmetric_eigenvalues().min()
}

/// Sends an experiment whose wrench noise is `loud` times the thesis'.
fn run(body: BodyParameters, loud: f64, seed: u64) -> Host {
    let mut sensors = SensorModels::thesis();
    sensors.load_cell.noise_n_nm = sensors.load_cell.noise_n_nm.map(|s| loud * s);
    let config = RigConfig::thesis_horizontal().with_body(body).with_sensors(sensors);
    let rows: Vec<_> = readings(&config, 20.0).measured(seed).map(|row| message(&row)).collect();
    let mut host = Host::start(&settings(&config));
    assert_eq!(host.inject(0, &rows), rows.len() as u32);
    host
}

/// Returns a bar of 2 kg, 1 m long and 1 mm thick.
fn rod() -> BodyParameters {
    BodyParameters {
        mass_kg: 2.0,
        com_m: [0.1, 0.05, 0.5],
        inertia_com_kgm2: [2.0 / 12.0, 2.0 / 12.0, 2.0 * 1e-6 / 8.0, 0.0, 0.0, 0.0],
    }
}

#[test]
fn no_streamed_tensor_is_outside_the_cone_after_warm_up() {
    let cases = [
        (BodyParameters::thesis_horizontal(), 1.0),
        (BodyParameters::thesis_vertical(), 1.0),
        (BodyParameters::thesis_vertical(), 20.0),
        (rod(), 1.0),
        (rod(), 30.0),
    ];
    let mut projected = 0;
    for ((body, loud), seed) in cases.into_iter().zip(1..) {
        let mut host = run(body, loud, seed);
        let last = host.estimate();
        assert_eq!(host.counters().rejected, 0);
        let warm = host.estimates.iter().position(|r| r.consistency != Consistency::NotDetermined);
        let warm = warm.expect("twenty seconds determine a body");
        // Two poses, and their ways, at the latest.
        assert!(host.estimates[warm].time_ns < 10_000_000_000, "{warm}");
        for report in host.estimates[warm..].iter().chain([&last]) {
            assert_ne!(report.consistency, Consistency::NotDetermined);
            assert_ne!(report.consistency, Consistency::NotConverged);
            assert!(least_eigenvalue(report) > 0.0, "{report:?}");
            assert_eq!(report.distance_sd > 0.0, report.consistency == Consistency::Projected);
            projected += usize::from(report.consistency == Consistency::Projected);
        }
        // The distance, from its definition, by other means: the factor in f64 and a dense solution.
        let factor = host.factor::<16>();
        let r = SMatrix::<f64, 16, 16>::from_fn(|i, j| factor.r()[i][j]);
        let z = SVector::<f64, 16>::from_fn(|i, _| factor.z()[i]);
        let sent = SVector::<f64, 16>::from_fn(|i, _| f64::from(last.estimate[i]));
        let free = r.full_piv_lu().solve(&z).unwrap();
        let distance = (r * (sent - free)).norm();
        // f32 leaves some hundredths of a standard deviation, see the module of the projection.
        let allowed = 0.05 + 0.01 * distance;
        assert!((distance - f64::from(last.distance_sd)).abs() < allowed, "{distance} {}", last.distance_sd);
    }
    // Else nothing has been shown.
    assert!(projected > 50, "{projected}");
}
