//! A knock on the rig in the middle of a run.

use rigident_shared::wire::{ReadingMessage, Settings};
use rigident_sim::rig::{Readings, RigConfig};
use rigident_sim::sensors::SensorModels;

use super::host::{Host, RATE_HZ, message, readings, settings};

/// Returns the thesis' rig with a load cell of a tenth of its noise, so that a knock is no matter of chance.
fn quiet() -> RigConfig {
    let mut sensors = SensorModels::thesis();
    sensors.load_cell.noise_n_nm = sensors.load_cell.noise_n_nm.map(|s| 0.1 * s);
    RigConfig::thesis_horizontal().with_sensors(sensors)
}

/// The device's statement about the body, its 95 % uncertainty, and the truth.
struct Answer {
    values: Vec<f64>,
    u95: Vec<f64>,
    knocks: [u16; 6],
}

fn run(settings: &Settings, rows: &[ReadingMessage]) -> Answer {
    let mut host = Host::start(settings);
    assert_eq!(host.inject(0, rows), rows.len() as u32);
    let knocks = host.counters().knocks;
    let solution = host.factor::<16>().solve();
    Answer {
        values: solution.estimate.to_vec(),
        u95: solution.standard_deviation.iter().map(|sd| 1.96 * sd).collect(),
        knocks,
    }
}

fn measured(readings: &Readings, seed: u64) -> Vec<ReadingMessage> {
    readings.measured(seed).map(|row| message(&row)).collect()
}

/// Returns readings with 50 N along x for 20 ms in the middle, at a point 0.2 m above the load cell.
fn knocked(rows: &[ReadingMessage]) -> Vec<ReadingMessage> {
    let mut rows = rows.to_vec();
    let middle = rows.len() / 2;
    for row in &mut rows[middle..middle + (0.02 * RATE_HZ) as usize] {
        row.wrench[0] += 50.0;
        row.wrench[4] += 10.0;
    }
    rows
}

/// Returns the largest change of a parameter between two answers, in 95 % uncertainties.
fn largest_change(a: &Answer, b: &Answer) -> f64 {
    a.values.iter().zip(&b.values).zip(&b.u95).map(|((a, b), u)| (a - b).abs() / u).fold(0.0, f64::max)
}

#[test]
fn a_knock_spoils_the_answer_unless_its_rows_are_weighted_and_is_counted() {
    let config = quiet();
    let on = settings(&config);
    let off = Settings { knock_limit_sd: 0.0, ..on.clone() };
    let readings = readings(&config, 20.0);
    for seed in 1..=3 {
        let clean = measured(&readings, seed);
        let reference = run(&off, &clean);
        let planted = run(&off, &knocked(&clean));
        let weighted = run(&on, &knocked(&clean));
        assert!(largest_change(&planted, &reference) > 3.0);
        assert!(largest_change(&weighted, &reference) < 1.0);
        // Of the blocks whose filter of 60 ms sees the 20 ms, a hundred a second, all but the faint ends; no
        // channel else.
        let [fx, _, _, _, my, _] = weighted.knocks;
        assert!((4..=8).contains(&fx) && (4..=8).contains(&my), "{:?}", weighted.knocks);
        assert_eq!(weighted.knocks, [fx, 0, 0, 0, my, 0]);
        assert_eq!(planted.knocks, [0; 6]);
    }
}

#[test]
fn noise_alone_is_not_taken_for_knocks() {
    let config = quiet();
    let on = settings(&config);
    let off = Settings { knock_limit_sd: 0.0, ..on.clone() };
    let readings = readings(&config, 20.0);
    for seed in 1..=20 {
        let rows = measured(&readings, seed);
        let (with, without) = (run(&on, &rows), run(&off, &rows));
        assert_eq!(with.knocks, [0; 6]);
        assert_eq!(with.values, without.values);
    }
}
