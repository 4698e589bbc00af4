use nalgebra::{DMatrix, DVector};

use super::*;
use rigident_shared::screening::Rejection;

use crate::{Basis, Channel, Fit, FitOptions, Kind, Owner, Parameter, Scope, Timing, fit};

const PHI: [f64; 3] = [20.0, 0.3, -0.2];
const OFFSET: [f64; 2] = [3.0, -2.0];
const SIGMA: [f64; 2] = [0.05, 0.02];
const N: usize = 5;
const GAIN: f64 = 0.01;
const LEAK: f64 = -4e-3;
const DRIFT: [f64; 2] = [0.3, -0.1];
const DELAY: f64 = 0.004;

/// Two channels of three parameters with offsets, whose regressor is late by an error of its own.
struct Example {
    parameters: Vec<Parameter>,
    channels: Vec<Channel>,
    nuisances: Vec<Nuisance>,
    samples: usize,
    noise: f64,
    late: f64,
    beforehand: Option<Gaussian>,
    timing: Timing,
}

fn nuisance(name: &str, sigma: f64, effect: Effect) -> Nuisance {
    Nuisance {
        name: name.to_owned(),
        group: name.to_owned(),
        unit: "1".to_owned(),
        sigma,
        basis: Basis::Stated("test".to_owned()),
        scope: Scope::Rig,
        effect,
    }
}

impl Example {
    fn new(nuisances: Vec<Nuisance>) -> Self {
        let owner = || Owner::Other("thing".to_owned());
        let channel = |c: usize| Channel {
            name: format!("c{c}"),
            unit: "N".to_owned(),
            sigma: Some(SIGMA[c]),
            offset: Some(3 + c),
            group: 0,
        };
        Self {
            parameters: (0..N).map(|j| Parameter::new(format!("p{j}"), owner(), Kind::Other, "1")).collect(),
            channels: (0..2).map(channel).collect(),
            nuisances,
            samples: 600,
            noise: 1.0,
            late: 0.0,
            beforehand: None,
            timing: Timing::Static,
        }
    }

    fn all() -> Self {
        Self::new(vec![
            nuisance("gain", 0.02, Effect::Gain { channel: 0 }),
            nuisance("leak", 0.01, Effect::CrossTalk { from: 0, to: 1 }),
            nuisance("line", 1.0, Effect::Drift { channel: 0, degree: 1 }),
            nuisance("curve", 1.0, Effect::Drift { channel: 0, degree: 2 }),
            nuisance("delay", 0.01, Effect::Signal(0)),
        ])
    }

    /// Rows of the motion as it was some time before.
    fn rows_at(&self, sample: usize, late: f64) -> [[f64; N]; 2] {
        let t = sample as f64 * 0.02 - late;
        [
            [(1.3 * t).sin(), (0.7 * t).cos(), 1.1 * (2.9 * t).sin(), 1.0, 0.0],
            [(0.4 * t).cos(), (2.3 * t).sin(), (1.7 * t).cos(), 0.0, 1.0],
        ]
    }

    fn measured(&self, sample: usize) -> [f64; 2] {
        let rows = self.rows_at(sample, DELAY);
        let moved = rows.map(|row| row.iter().zip(PHI).map(|(a, phi)| a * phi).sum::<f64>());
        let t = 2.0 * sample as f64 / (self.samples - 1) as f64 - 1.0;
        let drift = DRIFT[0] * t + DRIFT[1] * (1.5 * t * t - 0.5);
        let mut seed = (sample as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mut random = || {
            seed ^= seed >> 29;
            seed = seed.wrapping_mul(0xbf58_476d_1ce4_e5b9);
            ((seed >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0) * 3.0_f64.sqrt() * self.noise
        };
        [
            (1.0 + GAIN) * moved[0] + OFFSET[0] + drift + SIGMA[0] * random(),
            moved[1] + LEAK * moved[0] + OFFSET[1] + SIGMA[1] * random(),
        ]
    }

    fn fitted(&self) -> Fit {
        fit(self, &FitOptions::default(), &Silent).unwrap()
    }
}

impl RowSource for Example {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn timing(&self) -> Timing {
        self.timing
    }

    fn samples(&self) -> usize {
        self.samples
    }

    fn time_ns(&self, sample: usize) -> u64 {
        sample as u64 * 20_000_000
    }

    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        rows.smoothed.copy_from_slice(self.rows_at(sample, self.late).as_flattened());
        rows.measured.copy_from_slice(&self.measured(sample));
        Ok(())
    }

    fn nuisances(&self) -> Vec<Nuisance> {
        self.nuisances.clone()
    }

    fn beforehand(&self) -> Option<&Gaussian> {
        self.beforehand.as_ref()
    }

    fn with_errors(&self, errors: &[f64]) -> Option<Box<dyn RowSource + '_>> {
        let late = self.late + errors.first()?;
        let parameters = self.parameters.clone();
        Some(Box::new(Self {
            late,
            parameters,
            channels: self.channels.clone(),
            nuisances: Vec::new(),
            beforehand: None,
            ..*self
        }))
    }
}

/// Oracle: normal equations of the same linear model about the estimate, written out column by column with
/// derivatives by hand. Nothing is known beforehand.
fn dense(example: &Example, phi: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let (mut normal, mut right) = (DMatrix::<f64>::zeros(10, 10), DVector::<f64>::zeros(10));
    for sample in 0..example.samples {
        let rows = example.rows_at(sample, 0.0);
        let moved = rows.map(|row| (0..3).map(|j| row[j] * phi[j]).sum::<f64>());
        let step = 1e-6;
        let (more, less) = (example.rows_at(sample, step), example.rows_at(sample, -step));
        let t = 2.0 * sample as f64 / 599.0 - 1.0;
        for c in 0..2 {
            let late = (0..3).map(|j| (more[c][j] - less[c][j]) / (2.0 * step) * phi[j]).sum::<f64>();
            let of = |here: bool, value: f64| if here { value } else { 0.0 };
            let mut row = DVector::<f64>::zeros(10);
            row.rows_mut(0, 5).copy_from_slice(&rows[c]);
            row[5] = of(c == 0, moved[0]);
            row[6] = of(c == 1, moved[0]);
            row[7] = of(c == 0, t);
            row[8] = of(c == 0, 0.5 * (3.0 * t * t - 1.0));
            row[9] = late;
            let information = SIGMA[c].powi(-2);
            right += &row * (information * example.measured(sample)[c]);
            normal += &row * row.transpose() * information;
        }
    }
    (normal, right)
}

#[test]
fn estimate_and_covariance_are_those_of_the_dense_problem() {
    let example = Example::all();
    let found = example.fitted();
    let phi = &found.estimate.values;
    let (mut normal, right) = dense(&example, phi);
    for (k, nuisance) in example.nuisances.iter().enumerate() {
        normal[(5 + k, 5 + k)] += nuisance.sigma.powi(-2);
    }
    let covariance = normal.try_inverse().unwrap() * found.noise.variance_scale;
    let estimate = &covariance * right / found.noise.variance_scale;
    for j in 0..N {
        let sd = covariance[(j, j)].sqrt();
        // The columns move by what is left of the steps, a tenth of sd; products with gain and delay make it
        // a thousandth.
        assert!((estimate[j] - phi[j]).abs() < 2e-3 * sd, "{j}: {} {} {sd}", estimate[j], phi[j]);
        assert!((found.estimate.covariance[(j, j)].sqrt() / sd - 1.0).abs() < 2e-3, "{j}");
    }
    for (k, fit) in found.nuisances.iter().enumerate() {
        let sd = covariance[(5 + k, 5 + k)].sqrt();
        assert!((fit.value - estimate[5 + k]).abs() < 2e-3 * sd, "{k}");
        assert!((fit.sd / sd - 1.0).abs() < 2e-3, "{k}");
        for j in 0..N {
            let expected = covariance[(j, 5 + k)] / fit.nuisance.sigma;
            assert!((fit.contributions[j] - expected).abs() < 2e-3 * covariance[(j, j)].sqrt(), "{k} {j}");
        }
    }
    assert_eq!(found.factor.rows(), 1200);
}

#[test]
fn the_errors_put_in_are_found_and_taken_off() {
    let found = Example::all().fitted();
    for (fit, truth) in found.nuisances.iter().zip([GAIN, LEAK, DRIFT[0], DRIFT[1], DELAY]) {
        assert!(
            (fit.value - truth).abs() < 4.0 * fit.sd,
            "{}: {} {truth} ± {}",
            fit.nuisance.name,
            fit.value,
            fit.sd
        );
    }
    for (j, truth) in PHI.iter().chain(&OFFSET).enumerate() {
        let sd = found.estimate.covariance[(j, j)].sqrt();
        assert!(
            (found.estimate.values[j] - truth).abs() < 4.0 * sd,
            "{j}: {} {truth}",
            found.estimate.values[j]
        );
    }
    // The same without them is wrong by several standard deviations.
    let without = Example::new(Vec::new()).fitted();
    let off = (without.estimate.values[0] - PHI[0]).abs() / without.estimate.covariance[(0, 0)].sqrt();
    assert!(off > 3.0, "{off}");
}

#[test]
fn errors_next_to_certain_change_nothing() {
    let with = Example::new(vec![nuisance("gain", 1e-12, Effect::Gain { channel: 0 })]).fitted();
    let without = Example::new(Vec::new()).fitted();
    assert!(with.nuisances[0].value.abs() < 1e-12 && with.nuisances[0].pull() == 0.0);
    for j in 0..N {
        let sd = without.estimate.covariance[(j, j)].sqrt();
        assert!((with.estimate.values[j] - without.estimate.values[j]).abs() < 1e-6 * sd, "{j}");
        assert!((with.estimate.covariance[(j, j)].sqrt() / sd - 1.0).abs() < 1e-6, "{j}");
    }
    let none = Example::new(vec![nuisance("gain", 0.0, Effect::Gain { channel: 0 })]).fitted();
    assert!(none.nuisances.is_empty());
}

/// A parameter and two errors that are known together, and correlated; the others by themselves.
fn together() -> Gaussian {
    let names = ["p0", "gain", "leak"].map(str::to_owned).to_vec();
    let l = DMatrix::from_row_slice(3, 3, &[0.1, 0.0, 0.0, -4e-3, 2e-3, 0.0, 1e-3, -1.5e-3, 8e-4]);
    Gaussian::new(names, DVector::from_vec(vec![20.05, 9e-3, -3.5e-3]), &l * l.transpose()).unwrap()
}

#[test]
fn joint_prior_knowledge_counts_with_mean_and_correlation() {
    let known = together();
    let example = Example { noise: 0.8, beforehand: Some(known.clone()), ..Example::all() };
    let found = example.fitted();
    assert_eq!(found.noise.variance_scale, 1.0);
    let (mut normal, mut right) = dense(&example, &found.estimate.values);
    let information = known.covariance().clone().try_inverse().unwrap();
    let at = [0, 5, 6];
    for (i, to) in at.iter().enumerate() {
        right[*to] += (&information * known.mean())[i];
        for (j, from) in at.iter().enumerate() {
            normal[(*to, *from)] += information[(i, j)];
        }
    }
    for (k, nuisance) in example.nuisances.iter().enumerate().skip(2) {
        normal[(5 + k, 5 + k)] += nuisance.sigma.powi(-2);
    }
    let covariance = normal.try_inverse().unwrap();
    let estimate = &covariance * right;
    let joint = found.joint.as_ref().unwrap();
    for (j, name) in joint.names().iter().enumerate() {
        let sd = covariance[(j, j)].sqrt();
        assert!((joint.mean()[j] - estimate[j]).abs() < 2e-3 * sd, "{name}");
        for k in 0..joint.names().len() {
            let both = sd * covariance[(k, k)].sqrt();
            assert!((joint.covariance()[(j, k)] - covariance[(j, k)]).abs() < 4e-3 * both, "{name} {k}");
        }
    }
    assert_eq!((found.nuisances[0].expected, found.nuisances[2].expected), (9e-3, 0.0));
    assert_eq!(found.nuisances[1].nuisance.sigma, known.sd("leak").unwrap());
    assert!(found.agreement.unwrap().probability() > 1e-3, "{:?}", found.agreement);
}

/// The contributions of correlated errors are those of all of them together, however they are shared out.
#[test]
fn contributions_of_correlated_errors_add_up() {
    let known = together().only(|name| name != "p0");
    let example = Example { noise: 0.8, beforehand: Some(known.clone()), ..Example::all() };
    let found = example.fitted();
    let (mut normal, _) = dense(&example, &found.estimate.values);
    let mut prior = DMatrix::<f64>::zeros(5, 5);
    prior.view_mut((0, 0), (2, 2)).copy_from(&known.covariance().clone().try_inverse().unwrap());
    for k in 2..5 {
        prior[(k, k)] = example.nuisances[k].sigma.powi(-2);
    }
    let mut errors = normal.view_mut((5, 5), (5, 5));
    errors += &prior;
    let inverse = normal.try_inverse().unwrap();
    let moved = inverse.view((0, 5), (5, 5)).into_owned();
    let expected = &moved * prior * moved.transpose();
    for j in 0..N {
        let sum: f64 = found.nuisances.iter().map(|k| k.contributions[j].powi(2)).sum();
        assert!((sum / expected[(j, j)] - 1.0).abs() < 1e-2, "{j}: {sum} {}", expected[(j, j)]);
    }
}

/// What cannot be estimated where rows are forgotten is taken off as far as it is known.
#[test]
fn with_forgetting_the_mean_is_taken_off() {
    use rigident_shared::forgetting::Span;
    let fitted = |beforehand: Option<Gaussian>| {
        let gain = |channel| nuisance(&format!("gain {channel}"), 0.02, Effect::Gain { channel });
        let timing = Timing::Uniform { rate_hz: 50.0 };
        let example = Example { beforehand, timing, ..Example::new(vec![gain(0), gain(1)]) };
        let options = FitOptions { forgetting: Some(Span::TimeConstant(5.0)), ..FitOptions::default() };
        fit(&example, &options, &Silent).unwrap().estimate.values
    };
    let known = ["gain 0", "gain 1"].map(|name| (name.to_owned(), GAIN, 1e-4));
    let (with, without) = (fitted(Gaussian::independent(&known)), fitted(None));
    // What reads a hundredth too much is read as this much less.
    for j in 0..3 {
        assert!((with[j] / without[j] - (1.0 - GAIN)).abs() < 1e-6, "{j}: {} {}", with[j], without[j]);
    }
}
