//! Motions side by side, and what was predicted against what many runs find.

use std::sync::atomic::AtomicBool;

use rigident::plan::equipment::Equipment;
use rigident::plan::motion::Task;
use rigident::plan::motion::compare::{Row, compare, table};
use rigident::study::{motions, two_step};

/// Duration of every experiment, s, and rate of its readings, 1/s.
const DURATION_S: f64 = 40.0;
const RATE_HZ: f64 = 200.0;
const RUNS: u64 = 400;
/// Runs in two steps take longer.
const TWICE: u64 = 200;

fn rows() -> Vec<Row> {
    let task = Task { duration_s: DURATION_S, rate_hz: RATE_HZ, ..Task::new(Equipment::thesis_horizontal()) };
    compare(&task, &AtomicBool::new(false), |_| ()).expect("the built-in platform can do them all")
}

/// Returns the comparison.
pub fn comparison() -> String {
    table(&rows())
}

/// Returns found over predicted standard deviations of the ten parameters.
pub fn montecarlo() -> String {
    let repeated = motions::motions(&rows(), RATE_HZ, [RUNS, 1], &AtomicBool::new(false), |_, _, _| ());
    motions::table(&repeated.expect("every run is identified"))
}

/// Returns the tensor in one step and in two.
pub fn two_steps() -> String {
    let all = two_step::two_steps(&rows(), RATE_HZ, [TWICE, 1], &AtomicBool::new(false), |_, _, _| ());
    two_step::table(&all.expect("every run is identified"))
}
