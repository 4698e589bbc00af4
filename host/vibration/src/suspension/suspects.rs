//! Contradictions of the springs by modes and rests, in words: a rest that is elsewhere, an error that would
//! explain the residuals.

use std::fmt;

use nalgebra::{DMatrix, DVector};

use super::free_decay::Vibration;
use super::modal::{Problem, Swing};
use super::springs::COORDINATES;
use super::support::Support;
use rigident_fit::{COVERAGE_95, Nuisance};

/// Parameters of a body.
const TEN: usize = 10;
/// A rest that is off by more standard deviations is no chance.
const CHANCE: f64 = 3.5;
/// An error is a suspect if without a bound it leaves no more than this share of the squares.
const EXPLAINED: f64 = 0.3;
/// 1 σ of an error without a bound, by its own.
const UNBOUNDED: f64 = 1e3;
/// No more suspects than this are named.
const MOST: usize = 3;

/// A rest of a platform with another load, and its place by modes and springs.
#[derive(Clone, Debug, PartialEq)]
pub struct JudgedRest {
    /// The name of the rest.
    pub name: String,
    /// The coordinate that is off most by its standard deviation.
    pub coordinate: &'static str,
    /// The displacement from the rest of the recording, m or rad.
    pub measured: f64,
    /// The displacement by modes and springs, m or rad.
    pub expected: f64,
    /// U95 of the difference.
    pub u95: f64,
}

impl JudgedRest {
    /// Returns whether it is elsewhere.
    pub fn is_off(&self) -> bool {
        (self.measured - self.expected).abs() > CHANCE / COVERAGE_95 * self.u95
    }
}

impl fmt::Display for JudgedRest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (by, unit) = match COORDINATES.iter().position(|name| *name == self.coordinate) {
            Some(k) if k < 3 => (1e3, " mm"),
            _ => (1f64.to_degrees(), "°"),
        };
        write!(
            f,
            "{}: {} is {:.2}{unit} from its rest in the recording, modes and springs say {:.2} ± {:.2}{unit}",
            self.name,
            self.coordinate,
            by * self.measured,
            by * self.expected,
            by * self.u95
        )
    }
}

/// Returns the rests that a rig file states beside where the modes alone let them be.
pub fn judged_rests(support: &Support, found: &Vibration) -> Vec<JudgedRest> {
    let rests = found.rests(support);
    if rests.is_empty() {
        return Vec::new();
    }
    let swings = [Swing::of_body(&found.modes.shapes, Vec::new())];
    let nuisances: Vec<Nuisance> = support.modal_nuisances();
    let problem = Problem::new(&swings, support, TEN, &nuisances, None);
    let Some((rows, values)) = problem.solve() else { return Vec::new() };
    let factor = problem.factor(&rows, &values);
    let solution = factor.solve(factor.rounding());
    if !solution.determined.iter().all(|determined| *determined) {
        return Vec::new();
    }
    let estimate = DVector::from_vec(solution.estimate);
    let judged = |rest: &super::rests::Rest| {
        let (off, covariance) = problem.off_rest(rest, &estimate, &solution.covariance)?;
        let ratio = |k: &&usize| off[**k].abs() / covariance[(**k, **k)].sqrt().max(f64::MIN_POSITIVE);
        let most = *support.free.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b)))?;
        Some(JudgedRest {
            name: rest.name.clone(),
            coordinate: COORDINATES[most],
            measured: rest.change[most],
            expected: rest.change[most] - off[most],
            u95: COVERAGE_95 * covariance[(most, most)].sqrt(),
        })
    };
    rests.iter().filter_map(judged).collect()
}

/// Returns the errors of which one alone would explain what modes leave, with its size; `None` if none would.
pub(super) fn suspects(support: &Support, swing: &Swing) -> Option<String> {
    let nuisances: Vec<Nuisance> = support.modal_nuisances();
    let swings = std::slice::from_ref(swing);
    let problem = Problem::new(swings, support, TEN, &nuisances, None);
    let (rows, values) = problem.solve()?;
    let before = problem.factor(&rows, &values).residual_sum_of_squares();
    let mut found: Vec<(f64, String)> = Vec::new();
    for (k, own) in nuisances.iter().enumerate() {
        let mut free = nuisances.clone();
        free[k].sigma = own.sigma * UNBOUNDED;
        let (left, size) = with(&problem, &free, (&rows, &values), k)?;
        if left < EXPLAINED * before {
            let unit = if own.unit.is_empty() { String::new() } else { format!(" {}", own.unit) };
            found.push((left, format!("{} by {size:.2e}{unit}", own.name)));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let words: Vec<String> = found.into_iter().take(MOST).map(|(_, words)| words).collect();
    (!words.is_empty()).then(|| format!("; an error of {} alone would explain it", words.join(", or of ")))
}

/// Returns the squares that are left under other bounds of the errors, and the size of one.
fn with(
    problem: &Problem<'_>,
    bounds: &[Nuisance],
    (rows, values): (&DMatrix<f64>, &DVector<f64>),
    error: usize,
) -> Option<(f64, f64)> {
    let factor = problem.bounded(rows, values, bounds);
    let solution = factor.solve(factor.rounding());
    Some((factor.residual_sum_of_squares(), *solution.estimate.get(TEN + error)?))
}
