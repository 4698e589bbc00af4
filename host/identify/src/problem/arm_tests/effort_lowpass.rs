//! Efforts that went through a filter, positions not: a low-pass of first order by the bilinear transform.

use crate::problem::{Problem, ProblemOptions};
use rigident_fit::{FitOptions, Silent};
use rigident_io::recording::Recording;
use rigident_io::rig::JointTable;
use rigident_laboratory::arm::ArmRun;
use rigident_laboratory::trees::{seven_axes, truth};
use rigident_rows::tree::drive::Friction;

/// y of `y + ẏ/ω = x`, ω warped to the rate, of columns that end so.
pub(super) fn lowpass(recording: &mut Recording, end: &str, cutoff_hz: f64) {
    let c = (std::f64::consts::PI * cutoff_hz / recording.rate_hz.unwrap()).tan();
    for (_, cells) in recording.extra.iter_mut().filter(|(name, _)| name.ends_with(end)) {
        let x: Vec<f64> = cells.iter().map(|cell| cell.parse().unwrap()).collect();
        let mut y = x[0];
        for k in 1..x.len() {
            y = (c * (x[k] + x[k - 1]) - (c - 1.0) * y) / (1.0 + c);
            cells[k] = format!("{y:e}");
        }
    }
}

/// Errors of all parameters over their U95, the rig file saying which filter the efforts went through.
fn errors(run: &ArmRun, said_hz: Option<f64>) -> Vec<f64> {
    let model = seven_axes();
    let mut recording = run.recording(&model);
    lowpass(&mut recording, "_nm", 10.0);
    let names = model.links.iter().skip(1).map(|link| link.joint_name.clone());
    let table = |name| JointTable { name, effort_lowpass_hz: said_hz, ..JointTable::default() };
    recording.rig.joint = names.map(table).collect();
    let friction = Friction::parse(&["viscous,coulomb:0,offset"]).unwrap();
    let options = ProblemOptions { friction, ..ProblemOptions::default() };
    let problem = Problem::from_recording(&recording, Some(&model), &options).unwrap();
    let fit = problem.fit(&FitOptions { convergence_points: 0, ..FitOptions::default() }, &Silent).unwrap();
    let mut wanted = truth(&model, problem.tree().unwrap().base());
    (0..7).for_each(|k| wanted.extend(run.friction_of(k)));
    assert_eq!(wanted.len(), fit.parameters.len());
    let values = fit.estimate.unjudged();
    let over = |(j, wanted): (usize, &f64)| {
        (values.values[j] - wanted) / (fit.estimate.coverage_factor() * values.covariance[(j, j)].sqrt())
    };
    wanted.iter().enumerate().map(over).collect()
}

#[test]
fn efforts_behind_a_filter_are_those_before_it() {
    // Without dry friction, whose law would have to be that of the columns.
    let friction = [2.0, 0.0, 0.2];
    let run = ArmRun { friction, rest_s: 0.0, effort_noise: 0.1, rate_noise: 1e-5, ..ArmRun::default() };
    let (said, silent) = (errors(&run, Some(10.0)), errors(&run, None));
    let outside = |errors: &[f64]| errors.iter().filter(|error| error.abs() > 1.6).count();
    println!("{said:.2?}\n{silent:.2?}");
    assert!(outside(&said) <= 2, "{said:.2?}");
    assert!(outside(&silent) >= 6, "{silent:.2?}");
}
