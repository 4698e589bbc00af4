//! The rule for f32 on target, `max(0.05 sd, 20 ε cond ‖φ‖)` against least squares in f64 on the very same
//! rows, at a size for every day; `cargo xtask tables --long` goes to 1e7 samples and 128 parameters.

use super::{CONDITIONS, Line, body, pieces, random};

fn holds(line: &Line, condition: Option<f64>) {
    assert!(line.of_allowed <= 1.0, "{} N = {}: {}", line.rows, line.parameters, line.of_allowed);
    // A deviation of exactly zero would mean that the two are not independent.
    assert!(line.deviation_sd > 0.0);
    if let Some(condition) = condition {
        // Of the rows drawn, 600 at least, not of their expectation.
        assert!((line.condition / condition - 1.0).abs() < 0.3, "{}", line.condition);
    }
}

#[test]
fn f32_keeps_its_digits_at_every_condition_number() {
    for condition in CONDITIONS {
        random::<10>(condition, &[100, 10_000], 1).iter().for_each(|line| holds(line, Some(condition)));
        random::<16>(condition, &[100, 10_000], 2).iter().for_each(|line| holds(line, Some(condition)));
    }
}

#[test]
fn f32_keeps_its_digits_for_a_body_through_the_whole_estimator() {
    body::<10>(&[100, 10_000], 3).iter().for_each(|line| holds(line, None));
    body::<16>(&[100, 10_000], 4).iter().for_each(|line| holds(line, None));
}

#[test]
fn pieces_of_many_parameters_merge_to_the_whole() {
    holds(&pieces(1e3, 2, 1000, 5), Some(1e3));
}
