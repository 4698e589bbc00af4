use crate::problem::{Problem, ProblemOptions};
use rigident_fit::{FitOptions, RowSource, Silent};
use rigident_laboratory::arm::ArmRun;
use rigident_laboratory::trees::{seven_axes, truth};
use rigident_rows::tree::drive::Friction;

/// Of seven axes at right angles the rotors of the first two are parts of the moments of inertia about them:
/// the sum is identified, the others are by themselves.
#[test]
fn rotors_that_occur_with_inertia_are_parts_of_it() {
    let run = ArmRun { rotor: 0.3, rest_s: 0.0, rate_noise: 1e-5, ..ArmRun::default() };
    let friction = Friction::parse(&["viscous,coulomb,offset,rotor"]).unwrap();
    let options = ProblemOptions { friction, ..ProblemOptions::default() };
    let model = seven_axes();
    let problem = Problem::from_recording(&run.recording(&model), Some(&model), &options).unwrap();
    let source = problem.tree().unwrap();
    assert_eq!(source.base().rotors(), ["l1_joint.rotor", "l2_joint.rotor"]);
    let own = |wanted: &str| source.parameters().iter().filter(|p| p.name.ends_with(wanted)).count();
    assert_eq!((own("+rotor"), own(".rotor")), (2, 5));
    let fit = problem.fit(&FitOptions::default(), &Silent).unwrap();
    assert_eq!(fit.estimate.rank(), fit.parameters.len());
    let mut wanted = truth(&model, source.base());
    for (wanted, parameter) in wanted.iter_mut().zip(&source.base().parameters) {
        *wanted += parameter.rotors.iter().map(|(_, weight)| weight * run.rotor).sum::<f64>();
    }
    for (j, wanted) in wanted.iter().enumerate() {
        let sd = fit.estimate.unjudged().covariance[(j, j)].sqrt();
        // Of 43 one is beyond four standard deviations once in 400.
        assert!((fit.estimate.unjudged().values[j] - wanted).abs() < 4.0 * sd, "{}", fit.parameters[j].name);
    }
}
