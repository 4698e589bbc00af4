//! Motions side by side, and what was predicted against what many runs find.

use std::sync::atomic::AtomicBool;

use rigident::montecarlo::Campaign;
use rigident::plan::equipment::Equipment;
use rigident::plan::motion::Task;
use rigident::plan::motion::compare::{Row, bodies, compare, table};
use rigident_sim::rig::RigConfig;

/// Of every experiment, s, and of its readings, 1/s.
const DURATION_S: f64 = 40.0;
const RATE_HZ: f64 = 200.0;
const RUNS: u64 = 400;

fn rows() -> Vec<Row> {
    let task = Task { duration_s: DURATION_S, rate_hz: RATE_HZ, ..Task::new(Equipment::thesis_horizontal()) };
    compare(&task, &AtomicBool::new(false), |_| ()).expect("the built-in platform can do them all")
}

/// The comparison.
pub fn comparison() -> String {
    table(&rows())
}

/// Found over predicted standard deviations of the ten parameters.
pub fn montecarlo() -> String {
    let mut text = "| mounting | motion | m | mcx | mcy | mcz | Ixx | Iyy | Izz | Iyz | Izx | Ixy |\n\
                    |---|---|---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for row in rows() {
        let body = bodies().into_iter().find(|(_, name)| *name == row.body).expect("one of the two").0;
        let config = RigConfig::thesis_horizontal().with_body(body);
        let campaign = Campaign {
            duration_s: DURATION_S,
            rate_hz: RATE_HZ,
            program: Some(row.plan.program.clone()),
            ..Campaign::new(config)
        };
        let verdict = campaign.prepare().and_then(|p| p.run(RUNS, 1, &AtomicBool::new(false), |_| ()));
        let verdict = verdict.expect("every run is identified");
        let ratios = row.plan.prediction.parameters.iter().zip(&verdict.parameters);
        let ratios: Vec<_> = ratios.map(|(u95, found)| format!("{:.2}", 1.96 * found.std / u95)).collect();
        text += &format!("| {} | {} | {} |\n", row.body, row.objective, ratios.join(" | "));
    }
    text
}
