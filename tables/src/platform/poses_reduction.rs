//! The reduction of the uncertainty lying against standing, which is not 73 %, by what Table 1 allows.

use nalgebra::Vector3;
use rigident::plan::poses::estimators::measured_forces_covariance;
use rigident_sim::sensors::SensorModels;

use rigident::plan::poses::montecarlo::{Errors, Mounting, reduction};

use super::poses_montecarlo::thesis;

/// Returns the worst uncertainty of three orthogonal directions, the best there are.
fn worst(lever_m: f64, noise: &[f64; 6]) -> f64 {
    let tilt = (1.0_f64 / 3.0).sqrt().acos();
    let forces: Vec<_> = (0..3)
        .map(|k| {
            let (s, c) = (std::f64::consts::TAU * f64::from(k) / 3.0).sin_cos();
            Vector3::new(tilt.sin() * c, tilt.sin() * s, tilt.cos()) * 20.0 * 9.80665
        })
        .collect();
    let r = Vector3::new(0.0, 0.0, lever_m);
    let covariance =
        measured_forces_covariance(&forces, &r, noise, &[0.0; 6]).expect("orthogonal forces determine it");
    covariance.diagonal().max().sqrt()
}

/// Predicts to first order, with the noise of the forces `gain` times that of Table 1.
fn predicted(gain: f64) -> f64 {
    let [fx, fy, fz, mx, my, mz] = SensorModels::thesis().load_cell.noise_n_nm;
    let noise = [gain * fx, gain * fy, gain * fz, mx, my, mz];
    1.0 - worst(0.053, &noise) / worst(0.247, &noise)
}

/// Returns the table.
pub fn table() -> String {
    let [fx, _, _, mx, my, _] = SensorModels::thesis().load_cell.noise_n_nm;
    let lateral = |gain: f64| format!("{:.0}–{:.0}", gain * fx / my, gain * fx / mx);
    let (mut low, mut high) = (1.0, 100.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if predicted(middle) < 0.73 { low = middle } else { high = middle }
    }
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let [v, h] = Mounting::ALL.map(|mounting| thesis(3, mounting, Errors::Precision));
    let mut text = "| | σ_F/σ_M, lateral, 1/m | reduction |\n|---|---|---|\n".to_owned();
    for (name, ratio, reduction) in [
        ("printed".to_owned(), "not printed".to_owned(), "73 %".to_owned()),
        ("Table 1, Monte Carlo, n = 3".to_owned(), lateral(1.0), percent(reduction(&v, &h))),
        (
            "Table 1, first order, three orthogonal directions".to_owned(),
            lateral(1.0),
            percent(predicted(1.0)),
        ),
        (format!("what 73 % needs: forces {low:.1} times as noisy"), lateral(low), percent(predicted(low))),
        ("limit, moments without noise: 1 − 53/247".to_owned(), "∞".to_owned(), percent(1.0 - 53.0 / 247.0)),
    ] {
        text += &format!("| {name} | {ratio} | {reduction} |\n");
    }
    text
}
