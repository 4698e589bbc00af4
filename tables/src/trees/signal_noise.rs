//! Noise of all signals of two links and of an arm: efficiency against the bound that includes it, bias and
//! coverage.

use std::sync::atomic::AtomicBool;

use rigident::laboratory::trees::{TreeNoise, seven_axes, two_links};
use rigident::model::Model;
use rigident::study::{Judgement, TreeCampaign, TreeExperiment};

const RUNS: u64 = 100;

fn row(tree: &str, noise: &str, model: &Model, experiment: TreeExperiment) -> String {
    let known = if experiment.state_noise { "stated" } else { "from the data" };
    let campaign = TreeCampaign::new(model, experiment).expect("a motion that shows all");
    let verdict = campaign.run(RUNS, 1, &AtomicBool::new(false), |_| ()).expect("a fit each time");
    assert!(verdict.not_identified.is_empty(), "{:?}", verdict.not_identified);
    let own = verdict.parameters.iter().filter(|p| !p.name.starts_with("offset_"));
    let all: Vec<Judgement> = own.map(|p| p.judgement).collect();
    let mean = |of: &dyn Fn(&Judgement) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
    let least = |of: &dyn Fn(&Judgement) -> f64| all.iter().map(of).fold(f64::INFINITY, f64::min);
    format!(
        "| {tree} | {noise} | {known} | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} % | {:.0} % |\n",
        mean(&Judgement::efficiency),
        least(&Judgement::efficiency),
        mean(&|p| (p.bias / p.std).powi(2)).sqrt(),
        mean(&|p| p.predicted_std / p.std),
        100.0 * mean(&|p| p.coverage95),
        100.0 * least(&|p| p.coverage95),
    )
}

/// Returns the table.
pub fn table() -> String {
    let mut text =
        "| tree | noise of the signals, 1 σ a sample | noise | efficiency, mean | least | bias, sd, rms | σ \
         said/spread | coverage, mean | least |\n\
         |---|---|---|---|---|---|---|---|---|\n"
            .to_owned();
    let (two, seven) = (two_links(), seven_axes());
    let plain = TreeExperiment::default();
    for [accel, gyro] in [[0.02, 1e-4], [0.1, 0.002], [0.3, 0.002], [0.02, 0.01]] {
        for state_noise in [true, false] {
            let noise = TreeNoise { accel, gyro, ..plain.noise };
            let words = format!("{accel} m/s², {gyro} rad/s");
            text += &row("two links", &words, &two, TreeExperiment { noise, state_noise, ..plain.clone() });
        }
    }
    let noise = TreeNoise { attitude: 0.003, ..plain.noise };
    let turned = TreeExperiment { noise, state_noise: false, ..plain.clone() };
    text += &row("two links", "0.02 m/s², 1e-4 rad/s, attitude 0.003 rad", &two, turned);
    let arm = TreeExperiment { has_torques: true, ..plain };
    for rate in [0.001, 0.003, 0.01, 0.03] {
        for state_noise in [true, false] {
            let noise = TreeNoise { rate, ..arm.noise };
            let words = format!("rates {rate} rad/s");
            text += &row("seven axes", &words, &seven, TreeExperiment { noise, state_noise, ..arm.clone() });
        }
    }
    let noise = TreeNoise { position: 1e-4, ..arm.noise };
    let slopes = TreeExperiment { noise, state_noise: false, has_rates: false, ..arm };
    text += &row("seven axes", "positions 1e-4 rad, rates their slopes", &seven, slopes);
    text
}
