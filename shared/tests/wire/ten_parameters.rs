//! The example for one's own firmware finds the body that it simulates, and needs nothing but `core`.

#[path = "../../examples/ten_parameters.rs"]
mod example;

use example::{identify, truth};

/// Sixteen numbers in twenty runs, each beyond 1.96 standard deviations in one of twenty.
#[test]
fn ten_parameters_hold_the_truth() {
    let (mut inside, mut all) = (0, 0);
    for seed in 0..20 {
        let answer = identify(20.0, seed).unwrap();
        for (i, truth) in truth().into_iter().enumerate() {
            assert!(answer.determined[i], "{i}");
            let off = (f64::from(answer.estimate[i]) - truth).abs() / f64::from(answer.standard_deviation[i]);
            assert!(off < 6.0, "parameter {i}, seed {seed}: {off} standard deviations");
            inside += u32::from(off < 1.96);
            all += 1;
        }
    }
    assert!(inside * 100 >= all * 90, "{inside} of {all}");
}

#[test]
fn ten_parameters_need_nothing_but_core() {
    let text = include_str!("../../examples/ten_parameters.rs");
    let (estimator, _) = text.split_once("/// The simulated body").unwrap();
    for word in ["std::", "Vec", "Box", "String", "f64", ".sqrt()", "println"] {
        assert!(!estimator.contains(word), "{word}");
    }
}
