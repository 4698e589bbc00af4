//! The recording docs/examples/bracket.csv: 3.2 kg with its centre of mass at (0, 10, 53) mm.

use in_firmware::ten_parameters;
use rigident_shared::calibration::Reading;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

fn readings(text: &str) -> impl Iterator<Item = Reading<f32>> {
    text.lines().skip(1).enumerate().map(|(number, line)| {
        let cells: Vec<f32> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
        let three = |from: usize| [cells[from], cells[from + 1], cells[from + 2]];
        Reading {
            time_ns: number as u64 * 10_000_000,
            wrench: Wrench::from_array(std::array::from_fn(|k| cells[1 + k])),
            specific_force: SpecificForce::from_array(three(7)),
            angular_rate: AngularRate::from_array(three(10)),
        }
    })
}

#[test]
fn ten_parameters_are_estimated() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../docs/examples/bracket.csv");
    let text = std::fs::read_to_string(path).expect("the example");
    let found = ten_parameters(readings(&text), [0.05, -0.02, 0.03]).expect("a filter");
    assert!(found.determined[..10].iter().all(|known| *known));
    let truth = [3.2, 0.0, 0.032, 0.1696];
    for (k, truth) in truth.into_iter().enumerate() {
        // Equal weights of forces and moments: 2 % of the mass, and of its lever arm of 60 mm.
        let tolerance = if k == 0 { 0.064 } else { 0.004 };
        assert!((found.estimate[k] - truth).abs() < tolerance, "{k}: {}", found.estimate[k]);
    }
}
