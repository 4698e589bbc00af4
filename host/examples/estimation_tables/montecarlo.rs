//! `rigident montecarlo`: the default experiment two thousand times over, once with the sensors' white noise and once with
//! their figure as a gain error.

use std::sync::atomic::AtomicBool;

use rigident::montecarlo::{Campaign, PARAMETERS, Verdict, gain_error_sensors};
use rigident_shared::inertia::{PARAMETER_NAMES, PARAMETER_UNITS};
use rigident_sim::rig::RigConfig;

use crate::report::short;

const RUNS: u64 = 2000;

fn verdict(campaign: Campaign, runs: u64) -> Verdict {
    let prepared = campaign.prepare().expect("the experiment is a fixed one");
    prepared.run(runs, 1, &AtomicBool::new(false), |_| ()).expect("every experiment can be identified")
}

/// The table.
pub fn table() -> String {
    let white = RigConfig::thesis_horizontal();
    let gains = white.clone().with_sensors(gain_error_sensors());
    let host = verdict(Campaign::new(white), RUNS);
    let told = verdict(Campaign::new(gains.clone()), RUNS);
    let untold = verdict(Campaign { tell_gain_errors: false, ..Campaign::new(gains) }, 500);
    let mut text = "| | unit | white: bound | efficiency | coverage | gain: bound | efficiency | coverage | not told: coverage |\n\
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
            short(told.parameters[j].crb_std),
            quality(&told),
            100.0 * untold.parameters[j].coverage95,
        );
    }
    text
}
