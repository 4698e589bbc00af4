//! `rigident montecarlo`: the default experiment two thousand times over, once with the sensors' white noise
//! and once with their figure as a gain error, by parameter; then at other rates, with both at once, and by
//! the firmware's estimator.

use std::sync::atomic::AtomicBool;

use rigident::study::{
    Campaign, PARAMETERS, Solver, Verdict, gain_error_sensors, noise_and_gain_error_sensors,
};
use rigident_shared::inertia::{PARAMETER_NAMES, PARAMETER_UNITS};
use rigident_sim::rig::RigConfig;

use super::report::short;

const RUNS: u64 = 2000;

fn verdict(campaign: Campaign, runs: u64, seed: u64) -> Verdict {
    let prepared = campaign.prepare().expect("the experiment is a fixed one");
    prepared.run(runs, seed, &AtomicBool::new(false), |_| ()).expect("every experiment can be identified")
}

/// Returns the table.
pub fn table() -> String {
    let white = RigConfig::thesis_horizontal();
    let gains = white.clone().with_sensors(gain_error_sensors());
    let host = verdict(Campaign::new(white.clone()), RUNS, 1);
    let stated = verdict(Campaign::new(gains.clone()), RUNS, 1);
    let not_stated = verdict(Campaign { state_gain_errors: false, ..Campaign::new(gains.clone()) }, 500, 1);
    let mut text = "| | unit | white: bound | efficiency | coverage | gain: bound | efficiency | coverage | \
                    gains not stated: coverage |\n\
                    |---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for j in 0..PARAMETERS {
        let quality = |v: &Verdict| {
            let p = &v.parameters[j];
            format!("{:.3} | {:.1} %", p.efficiency(), 100.0 * p.coverage95)
        };
        text += &format!(
            "| {} | {} | {} | {} | {} | {} | {:.1} % |\n",
            PARAMETER_NAMES[j],
            PARAMETER_UNITS[j],
            short(host.parameters[j].crb_std),
            quality(&host),
            short(stated.parameters[j].crb_std),
            quality(&stated),
            100.0 * not_stated.parameters[j].coverage95,
        );
    }
    let both = white.clone().with_sensors(noise_and_gain_error_sensors());
    text += "\n| noise | rate, Hz | factor by | seed | efficiency | coverage |\n|---|---|---|---|---|---|\n";
    let mut line = |(noise, verdict): (&str, &Verdict), rate_hz: f64, solver: Solver, seed: u64| {
        let range = |of: &dyn Fn(usize) -> f64| {
            (0..PARAMETERS).map(of).fold((f64::INFINITY, 0.0_f64), |(l, m), v| (l.min(v), m.max(v)))
        };
        let (least, most) = range(&|j| verdict.parameters[j].efficiency());
        let (few, many) = range(&|j| 100.0 * verdict.parameters[j].coverage95);
        let solver = match solver {
            Solver::Host => "host, f64",
            Solver::Firmware => "firmware, f32",
        };
        text += &format!(
            "| {noise} | {rate_hz} | {solver} | {seed} | {least:.3}–{most:.3} | {few:.1}–{many:.1} % |\n"
        );
    };
    line(("white", &host), 200.0, Solver::Host, 1);
    line(("gain", &stated), 200.0, Solver::Host, 1);
    for (noise, config, rate_hz, solver, seed) in [
        ("white", &white, 200.0, Solver::Host, 2),
        ("white", &white, 1000.0, Solver::Host, 1),
        ("white", &white, 1000.0, Solver::Host, 2),
        ("white", &white, 1000.0, Solver::Firmware, 3),
        ("gain", &gains, 1000.0, Solver::Host, 1),
        ("both", &both, 200.0, Solver::Host, 1),
        ("both", &both, 1000.0, Solver::Host, 1),
    ] {
        let campaign = Campaign { rate_hz, solver, ..Campaign::new(config.clone()) };
        line((noise, &verdict(campaign, RUNS, seed)), rate_hz, solver, seed);
    }
    text
}
