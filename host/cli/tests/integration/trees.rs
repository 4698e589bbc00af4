//! Trees whose parameters are known come out as they are, and with noise as often inside their intervals as
//! stated.

use nalgebra::{DMatrix, DVector};
use rigident::answer::result::{ParameterState, Status};
use rigident::answer::standard_parameters::{BaseEstimate, nearest};
use rigident::answer::{Answer, Context, Links};
use rigident::fit::{Fit, FitError, FitOptions, Prediction, RowSource, Silent};
use rigident::laboratory::trees::{
    OFFSET, coverage, person_recording, seven_axes, seven_axis_recording, truth, two_link_recording,
    two_links, with_gain_errors, with_noise_of_rates, with_remembered_noise, worst,
};
use rigident::model::Model;
use rigident::model::base::BaseParameters;
use rigident::model::human::Person;
use rigident::model::inertial::impossibility;
use rigident::problem::{Problem, ProblemOptions, Subject};
use rigident::recording::Recording;
use rigident::rig::{JointTable, OffsetTable, OffsetWord};
use rigident::rows::tree::TreeSource;
use rigident::rows::tree::drive::Term;

use crate::fitting::{links, tree_states};

fn friction() -> ProblemOptions {
    ProblemOptions {
        friction: vec![Term::Viscous, Term::Coulomb(None), Term::Offset].into(),
        ..ProblemOptions::default()
    }
}

fn plain() -> ProblemOptions {
    ProblemOptions::default()
}

/// The rows of a recording with its fit.
struct Identified {
    problem: Problem,
    fit: Fit,
}

impl Identified {
    fn of(recording: &Recording, model: &Model, options: &ProblemOptions) -> Self {
        let problem = Problem::from_recording(recording, Some(model), options).unwrap();
        let fit = problem.fit(&FitOptions::default(), &Silent).unwrap();
        Self { problem, fit }
    }

    fn tree(&self) -> &TreeSource {
        self.problem.tree().unwrap()
    }

    fn base(&self) -> &BaseParameters {
        self.tree().base()
    }

    fn links(&self) -> Links<'_> {
        links(self.tree())
    }

    fn states(&self) -> Vec<ParameterState> {
        tree_states(&self.fit, self.tree())
    }

    fn value(&self, j: usize) -> f64 {
        value(&self.fit, j)
    }

    fn worst(&self, model: &Model) -> f64 {
        worst(&truth(model, self.base()), &self.fit)
    }

    /// The truth of the base parameters, then `others`, beside the fit.
    fn beside(self, model: &Model, others: &[f64]) -> (Vec<f64>, Fit) {
        let mut wanted = truth(model, self.base());
        wanted.extend(others);
        (wanted, self.fit)
    }
}

fn value(fit: &Fit, j: usize) -> f64 {
    fit.estimate.measured(j).unwrap().value
}

fn variance(fit: &Fit, j: usize) -> f64 {
    fit.estimate.covariance(j, j).unwrap()
}

#[test]
fn two_links_without_noise_come_out_to_a_millionth() {
    let model = two_links();
    let found = Identified::of(&two_link_recording(&model, 1000.0, 20.0, None), &model, &plain());
    let Subject::Tree { idle, .. } = &found.problem.subject else { panic!("no tree") };
    assert!(idle.is_empty(), "{idle:?}");
    assert_eq!((found.base().parameters.len(), found.fit.parameters.len()), (19, 25));
    assert!(found.worst(&model) < 1e-6, "{:e}", found.worst(&model));
    for (k, offset) in OFFSET.into_iter().enumerate() {
        assert!((found.value(19 + k) - offset).abs() < 1e-6);
    }
    let states = found.states();
    assert!(states.iter().all(|s| matches!(s, ParameterState::Identified(_))), "{states:?}");
}

#[test]
fn seven_axes_without_noise_come_out_to_a_millionth_by_rates_and_by_positions_alone() {
    let model = seven_axes();
    for rates in [true, false] {
        // Without friction: where a rate changes its sign between two samples, a smoothed Coulomb column is
        // off by part of one of them.
        let recording = seven_axis_recording(&model, 1000.0, 30.0, rates, None, 0.0);
        let found = Identified::of(&recording, &model, &plain());
        assert!(found.worst(&model) < 1e-6, "rates {rates}: {:e}", found.worst(&model));
        assert!(!found.tree().input().situation.floating && found.base().standard.len() == 70);
    }
}

/// A second and a half of motion leaves some of two links open, and the answer says what would help.
#[test]
fn parameters_left_open_by_a_short_motion_bring_advice() {
    let model = two_links();
    let found = Identified::of(&two_link_recording(&model, 200.0, 1.5, Some(3)), &model, &plain());
    let context = Context { links: Some(found.links()), ..Context::default() };
    let answer = Answer::new(&found.fit, context).unwrap();
    assert_ne!(answer.status, Status::Identified);
    let open = found.states().iter().filter(|s| !s.is_identified()).count();
    assert!(open > 0 && !answer.advice.is_empty());
    assert_eq!(answer.parameters.iter().filter(|p| !p.state.is_identified()).count(), open);
}

/// The engine against its own definition: the factor is that of the normal equations of the filtered,
/// whitened rows, and its residuals are what the estimate leaves of them.
#[test]
fn the_factor_of_a_tree_is_that_of_its_normal_equations() {
    let model = seven_axes();
    let mut recording = seven_axis_recording(&model, 200.0, 20.0, true, Some(2), 1.0);
    recording.rig.joint = (1..=7)
        .map(|k| JointTable {
            name: format!("l{k}_joint"),
            position: None,
            rate: None,
            effort: None,
            position_noise: None,
            rate_noise: None,
            effort_noise: Some(0.3),
            zero_std: None,
            effort_gain_std: None,
            effort_lowpass_hz: None,
        })
        .collect();
    // Of a jump no error of its law is estimated beside.
    let jump = vec![Term::Viscous, Term::Coulomb(Some(0.0)), Term::Offset];
    let options = ProblemOptions { friction: jump.into(), ..ProblemOptions::default() };
    let found = Identified::of(&recording, &model, &options);
    assert!(found.fit.noise.sigma_given && found.fit.inflation.is_empty());
    assert!(found.fit.channels.iter().all(|c| c.outliers == 0));
    let blocks = found.tree().condition(&Silent).unwrap();
    let (n, channels) = (found.fit.parameters.len(), found.fit.channels.len());
    let weight = f64::from(blocks.filter().every).sqrt() / 0.3;
    let (mut rows, mut measured) = (vec![0.0; channels * n], vec![0.0; channels]);
    let (mut gram, mut right, mut square) = (DMatrix::<f64>::zeros(n, n), DVector::zeros(n), 0.0);
    for block in 0..blocks.len() {
        blocks.write(block, &mut rows, &mut measured);
        let a = DMatrix::from_row_slice(channels, n, &rows) * weight;
        let y = DVector::from_column_slice(&measured) * weight;
        gram += a.tr_mul(&a);
        right += a.tr_mul(&y);
        square += y.norm_squared();
    }
    let scale = found.fit.noise.variance_scale;
    let covariance = gram.clone().try_inverse().unwrap();
    let estimate = &covariance * &right;
    // Rounding of the normal equations: ε times the square of the columns' condition, some 30, and as many
    // rows.
    for j in 0..n {
        let sd = (covariance[(j, j)] * scale).sqrt();
        assert!((found.value(j) - estimate[j]).abs() < 1e-7 * sd, "{j}: {} {}", found.value(j), estimate[j]);
        let white = variance(&found.fit, j).sqrt();
        assert!((white / sd - 1.0).abs() < 1e-7, "{j}: {white} {sd}");
    }
    let residual = square - right.dot(&estimate);
    let rows = (blocks.len() * channels) as f64;
    let ratio = residual / ((rows - n as f64) * blocks.filter().row_noise_gain());
    assert!((found.fit.noise.variance_ratio / ratio - 1.0).abs() < 0.02, "{ratio}");
    let predicted = found.fit.predict(found.tree()).unwrap();
    for (own, channel) in predicted.residual_rms.iter().zip(&found.fit.channels) {
        assert!((own / channel.residual_rms - 1.0).abs() < 1e-12);
    }
    let few = Prediction::of(found.tree(), &estimate.as_slice()[1..], &[]).unwrap_err();
    assert_eq!(few, FitError::Columns { given: n - 1, wanted: n });
}

/// Parameters of one run share its noise: counted as five independent ones a run, 0.95 ± 3 √(0.05 · 0.95 / (5
/// runs)).
fn allowed(runs: u64) -> f64 {
    3.0 * (0.05_f64 * 0.95 / (5.0 * runs as f64)).sqrt()
}

#[test]
fn two_links_with_noise_are_inside_their_intervals_as_often_as_stated() {
    let model = two_links();
    let runs = 40;
    let share = coverage(runs, |seed| {
        let recording = two_link_recording(&model, 200.0, 20.0, Some(seed));
        Identified::of(&recording, &model, &plain()).beside(&model, &OFFSET)
    });
    assert!((share.inside - 0.95).abs() < allowed(runs), "{share:?}");
}

#[test]
fn seven_axes_with_noise_are_inside_their_intervals_as_often_as_stated() {
    let model = seven_axes();
    let runs = 12;
    let share = coverage(runs, |seed| {
        let recording = seven_axis_recording(&model, 200.0, 20.0, true, Some(seed), 1.0);
        Identified::of(&recording, &model, &friction()).beside(&model, &[0.7, 1.5, 0.2].repeat(7))
    });
    assert!((share.inside - 0.95).abs() < allowed(runs), "{share:?}");
}

/// With noise that lasts some share of the motion's periods, intervals hold the truth about nine times in ten
/// or more, where they had held it not even seven times; of one body, too (`coloured-noise` in
/// docs/estimation.md).
#[test]
fn intervals_count_noise_that_is_autocorrelated() {
    let (two, seven) = (two_links(), seven_axes());
    let bodies = [
        (two_link_recording(&two, 200.0, 20.0, None), two, plain(), 40),
        (seven_axis_recording(&seven, 200.0, 20.0, true, None, 1.0), seven, friction(), 8),
    ];
    for (exact, model, options, runs) in bodies {
        let share = coverage(runs, |seed| {
            let recording = with_remembered_noise(&exact, 0.2, seed);
            Identified::of(&recording, &model, &options).beside(&model, &[])
        });
        assert!(share.inside > 0.9 - allowed(runs) && share.inside_as_white < 0.7, "{share:?}");
        assert!(share.warned == 1.0, "{share:?}");
    }
}

/// Gain errors of 1 % on top of noise that is small beside them: intervals that count them hold the truth as
/// often as stated, others hardly ever. Parameters of one run share six gains: counted as two independent
/// ones a run.
#[test]
fn intervals_count_gain_errors_of_the_load_cell() {
    let model = two_links();
    let exact = two_link_recording(&model, 200.0, 12.0, None);
    let share = |stated: bool| {
        coverage(40, |seed| {
            let mut recording = with_remembered_noise(&exact, 0.0, seed);
            recording = with_gain_errors(&recording, [0.01; 6], seed);
            if !stated {
                recording.rig.load_cell.gain_uncertainty = None;
            }
            Identified::of(&recording, &model, &plain()).beside(&model, &OFFSET)
        })
    };
    let (stated, unstated) = (share(true).inside, share(false).inside);
    let allowed = 3.0 * (0.05_f64 * 0.95 / (2.0 * 40.0)).sqrt();
    assert!((stated - 0.95).abs() < allowed, "{stated}");
    assert!(unstated < 0.8, "{unstated}");
}

/// Without noise gains that are exact are found and change nothing; without a σ they are not searched for.
#[test]
fn gains_that_are_certain_are_left_alone() {
    let model = two_links();
    let exact = two_link_recording(&model, 1000.0, 12.0, None);
    let found = Identified::of(&exact, &model, &plain()).fit;
    let mut same = exact.clone();
    same.rig.load_cell.gain_uncertainty = Some([1e-9; 6]);
    let gained = Identified::of(&same, &model, &plain()).fit;
    assert!(found.nuisances.is_empty());
    for (j, parameter) in found.parameters.iter().enumerate() {
        let (a, b) = (value(&found, j), value(&gained, j));
        assert!((a - b).abs() < 1e-6, "{}: {a} {b}", parameter.name);
    }
}

#[test]
fn a_sigma_that_is_given_is_taken_and_a_known_offset_too() {
    let model = two_links();
    let mut recording = two_link_recording(&model, 200.0, 20.0, Some(3));
    recording.rig.load_cell.noise_n_nm = Some([0.5, 0.5, 0.5, 0.03, 0.03, 0.03]);
    let found = Identified::of(&recording, &model, &plain()).fit;
    let ratio = found.noise.variance_ratio;
    assert!(found.noise.sigma_given && (0.8..1.25).contains(&ratio), "{ratio}");
    recording.rig.load_cell.offset_n_nm = OffsetTable::Known(OFFSET);
    let known = Identified::of(&recording, &model, &plain()).fit;
    assert_eq!(known.parameters.len(), 19);
    assert!(known.estimate.measured(0).unwrap().u95 < found.estimate.measured(0).unwrap().u95);
    recording.rig.load_cell.offset_n_nm = OffsetTable::Word(OffsetWord::Zero);
    let wrong = Identified::of(&recording, &model, &plain()).fit;
    assert!(wrong.noise.variance_ratio > 2.0);
}

#[test]
fn a_person_s_base_parameters_come_out_to_a_millionth_and_the_full_ones_are_bodies() {
    let model = Person::default().human34().unwrap();
    let found = Identified::of(&person_recording(&model, 200.0, 20.0), &model, &plain());
    assert_eq!(found.base().parameters.len(), 128);
    assert!(found.worst(&model) < 1e-6, "{:e}", found.worst(&model));
    // A nominal guess of another stature and mass: the truth's base parameters, symmetric, every link a body.
    let guess = Person { height_m: 1.65, mass_kg: 60.0, ..Person::default() };
    let mut nominal = model.clone();
    for (link, other) in nominal.links.iter_mut().zip(guess.human34().unwrap().links) {
        link.nominal = other.nominal;
    }
    let full = nearest(&nominal, &BaseEstimate::of(&found.fit, found.base()), 1.0, true).unwrap();
    assert!(full.converged && full.links.len() == 15);
    let mass: f64 = full.links.iter().map(|l| l.parameters[0]).sum();
    assert!((mass - 73.0).abs() < 1e-4, "{mass}");
    for link in &full.links {
        assert_eq!(impossibility(&link.parameters), None, "{}", link.name);
    }
}

/// Coarse rates draw the estimate by ten standard deviations and more, all parameters together, where that is
/// not taken off.
#[test]
fn noise_of_the_rates_moves_no_parameter() {
    let model = seven_axes();
    let runs = 8;
    let mut errors = vec![0.0; 43];
    let share = coverage(runs, |seed| {
        let exact = seven_axis_recording(&model, 200.0, 20.0, true, Some(seed + 1), 0.0);
        let recording = with_noise_of_rates(&exact, 0.05, seed + 1);
        let (truth, found) = Identified::of(&recording, &model, &plain()).beside(&model, &[]);
        for j in 0..43 {
            errors[j] += (value(&found, j) - truth[j]) / variance(&found, j).sqrt() / runs as f64;
        }
        (truth, found)
    });
    let norm = errors.iter().map(|x| x * x).sum::<f64>().sqrt();
    // Eight runs leave of a mean of 43 numbers √(43/8) = 2.3, and by chance 3.1 once in a thousand times,
    // where σ is as said.
    assert!(norm < 3.1, "{norm}");
    assert!(share.inside > 0.95 - allowed(runs), "{share:?}");
}
