//! A knock in a recording hardly moves the answer.
#![cfg(feature = "simulator")]

use hexapod::experiment::thesis_program;
use rigident::fit::{Fit, FitOptions, RowSource, Silent, Whitening};
use rigident::rows::body::{BodySource, Input};
use rigident_shared::forgetting::Span;
use rigident_shared::spatial::Wrench;
use rigident_sim::rig::{Readings, RigConfig};
use rigident_sim::sensors::SensorModels;

use crate::factors::simulated;
use crate::fitting::{fit_body, fit_forgetting, fit_with, outliers, states};

/// A quiet load cell, so that 50 N for 20 ms are no matter of chance.
fn recording(seed: u64) -> Input {
    let mut sensors = SensorModels::thesis();
    sensors.load_cell.noise_n_nm = sensors.load_cell.noise_n_nm.map(|s| 0.1 * s);
    let config = RigConfig::thesis_horizontal().with_sensors(sensors);
    let program = thesis_program(&config.geometry, 20.0);
    let readings = Readings::new(&config, &program, simulated::RATE_HZ).unwrap();
    let channel_sigma = Some(simulated::SIGMA.map(|s| 0.1 * s));
    Input { channel_sigma, ..simulated::input(&config, &readings, seed) }
}

fn knocked(input: &Input) -> Input {
    let mut input = input.clone();
    let middle = input.readings.len() / 2;
    for reading in &mut input.readings[middle..middle + 4] {
        let mut wrench = reading.wrench.array();
        wrench[0] += 50.0;
        wrench[4] += 10.0;
        reading.wrench = Wrench::from_array(wrench);
    }
    input
}

fn largest_change(a: &Fit, b: &Fit) -> f64 {
    let (a, b) = (states(a), states(b));
    let measured = a.iter().zip(&b).map(|(a, b)| (a.measured().unwrap(), b.measured().unwrap()));
    measured.map(|(a, b)| (a.value - b.value).abs() / b.u95).fold(0.0, f64::max)
}

/// The largest change where every row counts fully: plain least squares of the filtered rows.
fn change_unweighted(input: &Input, reference: &Fit) -> f64 {
    let blocks = BodySource::new(input.clone(), None).condition(&Silent).unwrap();
    let weights: Vec<f64> = reference.channels.iter().map(|c| 1.0 / c.sigma).collect();
    let factor = blocks.absorb(0..blocks.len(), 16, &Whitening::diagonal(&weights), None);
    let plain = factor.solve(factor.rounding()).estimate;
    let changes = states(reference).into_iter().zip(plain).map(|(state, value)| {
        let measured = state.measured().unwrap();
        (measured.value - value).abs() / measured.u95
    });
    changes.fold(0.0, f64::max)
}

#[test]
fn a_knock_in_a_recording_is_found_and_its_rows_count_little() {
    for seed in 1..=3 {
        let clean = recording(seed);
        for (given, sigma) in [(true, clean.channel_sigma), (false, None)] {
            let with = |input: &Input| fit_body(&Input { channel_sigma: sigma, ..input.clone() });
            let reference = with(&clean);
            let answer = with(&knocked(&clean));
            assert!(change_unweighted(&knocked(&clean), &reference) > if given { 3.0 } else { 2.0 });
            assert!(largest_change(&answer, &reference) < 0.5);
            // The filter of 0.1 s, a hundred blocks a second, sees the 20 ms in twelve blocks, faintly in the
            // first and last.
            let spoilt = outliers(&answer);
            let (fx, my) = (spoilt[0], spoilt[4]);
            assert!((4..=12).contains(&fx) && (4..=12).contains(&my), "{spoilt:?}");
            assert_eq!(spoilt, [fx, 0, 0, 0, my, 0]);
            assert_eq!(outliers(&reference), [0; 6]);
        }
    }
}

/// The run begins with rests, after which next to nothing is known of the tensor.
#[test]
fn a_memory_weights_a_knock_and_counts_it_and_a_long_one_agrees_with_none() {
    let clean = recording(1);
    let whole = fit_body(&knocked(&clean));
    for span in [Span::TimeConstant(1e6), Span::TimeConstant(10.0), Span::Window(10.0)] {
        let answer = fit_forgetting(&knocked(&clean), span);
        let spoilt = outliers(&answer);
        assert!((4..=12).contains(&spoilt[0]) && (4..=12).contains(&spoilt[4]), "{span:?}: {spoilt:?}");
        assert!(largest_change(&answer, &fit_forgetting(&clean, span)) < 0.5, "{span:?}");
        if span == Span::TimeConstant(1e6) {
            assert!(largest_change(&answer, &whole) < 0.5);
        }
    }
}

#[test]
fn the_course_of_a_run_with_a_knock_ends_at_its_answer() {
    let input = knocked(&recording(1));
    let answer = fit_with(&input, &FitOptions { convergence_points: 200, ..FitOptions::default() });
    let course = answer.convergence.as_slice();
    let [.., before, last] = course else { panic!("{} points", course.len()) };
    for (j, state) in states(&answer).iter().enumerate() {
        let end = state.measured().unwrap();
        let (point, last) = (before.parameters[j].unwrap(), last.parameters[j].unwrap());
        assert_eq!((last.value, last.u95), (end.value, end.u95));
        // Half a per cent of the rows are between the two.
        assert!((point.value - end.value).abs() < 0.2 * end.u95, "{j}: {} {}", point.value, end.value);
        assert!((point.u95 / end.u95 - 1.0).abs() < 0.05, "{j}: {} {}", point.u95, end.u95);
    }
}
