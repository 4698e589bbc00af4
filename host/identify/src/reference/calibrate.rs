//! The errors of a rig from runs with a reference body.
//!
//! The prior knowledge of the body as it is mounted and of the errors is one normal distribution of
//! independent causes x. A run sees `y = H x`: the ten parameters in S, and those errors that it has columns
//! of. It is fitted with the distribution of y as its prior, its own errors and offsets eliminated, and what
//! that tells of y holds of x. Run after run this is the joint solution of all of them, each linearised about
//! its own estimate: errors and the body are shared, drift and bias are not.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::body::Mounted;
use super::compare::{Comparison, Mismatch, OTHER_BODY};
use crate::answer::{Answer, Context, contradictions};
use rigident_fit::{FitError, FitOptions, Gaussian, Nuisance, Progress, RowSource, Scope, Silent, fit};
use rigident_rows::body::BodySource;

/// Solutions about anew corrected signals, at most, and the share of its standard deviation that an error may
/// move at the last.
const ROUNDS: usize = 4;
const STAYS: f64 = 0.1;
/// Parameters of the body.
const TEN: usize = 10;

/// A run with the reference body.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    /// Name of the recording.
    pub name: String,
    /// Its rows.
    pub source: &'a BodySource,
    /// The body as it was mounted.
    pub mounted: Mounted,
}

/// The information of the runs.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// The errors that all runs share, as they were known beforehand.
    pub before: Vec<Nuisance>,
    /// The knowledge of them now.
    pub known: Gaussian,
    /// The knowledge of the causes of the reference's parameters now, each about zero and in standard
    /// deviations beforehand.
    pub causes: Gaussian,
}

/// Why runs calibrate no rig.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrateError {
    /// There is no error to calibrate.
    #[error("the rig file states every error of the rig as exact: there is nothing to calibrate")]
    Exact,
    /// A run has no fit.
    #[error("{run}: {error}")]
    Fit {
        /// The recording.
        run: String,
        /// Why.
        error: FitError,
    },
    /// The body is another one.
    #[error("{run}: {mismatch}")]
    OtherBody {
        /// The recording.
        run: String,
        /// The distance that it is off.
        mismatch: Box<Mismatch>,
    },
    /// The run contradicts what is stated of the rig's errors, or is not that of a rigid body.
    #[error("{run}: {said}")]
    Contradicted {
        /// The recording.
        run: String,
        /// The part that does, in words.
        said: String,
    },
    /// Numbers that determine nothing.
    #[error("{run}: its rows do not go together with what is known of the body and of the rig's errors")]
    Singular {
        /// The recording.
        run: String,
    },
}

/// Finds the errors of a rig from runs with a reference body.
///
/// # Errors
/// [`CalibrateError`] names the run that does not fit the reference or the rig file.
pub fn calibrate(runs: &[Run<'_>], progress: &dyn Progress) -> Result<Calibrated, CalibrateError> {
    let beforehand = beforehand(runs)?;
    for (k, run) in runs.iter().enumerate() {
        progress.stage(&format!("run {}", run.name), 0.5 * k as f64 / runs.len() as f64);
        check(run)?;
    }
    let known = joint(runs, &beforehand, &|share| progress.stage("joint solution", 0.5 + 0.5 * share))?;
    let is_cause = |name: &str| name.strip_prefix("reference ").is_some();
    Ok(Calibrated {
        before: beforehand.errors,
        causes: known.only(is_cause),
        known: known.only(|name| !is_cause(name)),
    })
}

/// Returns what is known after all runs: solved again with the signals corrected for what was found, until
/// that stays (Gauss and Newton), since of errors of a per cent each the products count.
fn joint(
    runs: &[Run<'_>],
    beforehand: &Beforehand,
    progress: &dyn Fn(f64),
) -> Result<Gaussian, CalibrateError> {
    let solve = |about: &Gaussian, judged: bool, round: usize| {
        let mut known = beforehand.known.clone();
        for (k, run) in runs.iter().enumerate() {
            progress((round as f64 + k as f64 / runs.len() as f64) / ROUNDS as f64);
            known = known_after(run, &known, &beforehand.causes, about, judged)?;
        }
        Ok(known)
    };
    let mut about = solve(&beforehand.known, false, 0)?;
    for round in 1..ROUNDS {
        let next = solve(&about, false, round)?;
        let moved = next.mean() - about.mean();
        let stays =
            next.covariance().diagonal().iter().zip(moved.iter()).all(|(v, by)| by.abs() <= STAYS * v.sqrt());
        about = next;
        if stays {
            break;
        }
    }
    solve(&about, true, ROUNDS)
}

/// Says what contradicts the errors that are stated of a rig, if a run is of the reference: what makes
/// [`calibrate`] refuse a run that agrees with the reference by its own answer. `None` where nothing does.
pub fn contradiction(run: &Run<'_>) -> Option<CalibrateError> {
    let beforehand = beforehand(std::slice::from_ref(run)).ok()?;
    joint(std::slice::from_ref(run), &beforehand, &|_| ()).err()
}

/// The knowledge before any run.
struct Beforehand {
    /// The errors that the runs share.
    errors: Vec<Nuisance>,
    /// Names of the causes of the reference's parameters.
    causes: Vec<String>,
    /// Causes and errors.
    known: Gaussian,
}

fn beforehand(runs: &[Run<'_>]) -> Result<Beforehand, CalibrateError> {
    let errors = shared(runs);
    if errors.is_empty() {
        return Err(CalibrateError::Exact);
    }
    let mut causes: Vec<String> = Vec::new();
    for cause in runs.iter().flat_map(|run| &run.mounted.causes).filter(|cause| cause.sd > 0.0) {
        if !causes.contains(&cause.name) {
            causes.push(cause.name.clone());
        }
    }
    let of_causes = causes.iter().map(|name| (format!("reference {name}"), 0.0, 1.0));
    let all: Vec<(String, f64, f64)> =
        of_causes.chain(errors.iter().map(|k| (k.name.clone(), 0.0, k.sigma))).collect();
    let first = runs.first().ok_or(CalibrateError::Exact)?;
    let known =
        Gaussian::independent(&all).ok_or_else(|| CalibrateError::Singular { run: first.name.clone() })?;
    Ok(Beforehand { errors, causes, known })
}

/// Returns the errors that the runs share; of one that is known differently well from run to run the larger.
fn shared(runs: &[Run]) -> Vec<Nuisance> {
    let mut all: Vec<Nuisance> = Vec::new();
    let own = runs.iter().flat_map(|run| run.source.nuisances());
    for nuisance in own.filter(|k| k.scope == Scope::Rig && k.sigma > 0.0) {
        match all.iter_mut().find(|other| other.name == nuisance.name) {
            Some(other) => other.sigma = other.sigma.max(nuisance.sigma),
            None => all.push(nuisance),
        }
    }
    all
}

/// Asks a run by itself whether it is one of the reference, and of a rigid body.
fn check(run: &Run) -> Result<(), CalibrateError> {
    let alone = fit(run.source, &FitOptions::default(), &Silent)
        .map_err(|error| CalibrateError::Fit { run: run.name.clone(), error })?;
    let context = Context { rate_sigma: run.source.rate_sigma(), ..Context::default() };
    let answer = Answer::new(&alone, context)
        .map_err(|error| CalibrateError::Contradicted { run: run.name.clone(), said: error.to_string() })?;
    if let Some(mismatch) = Comparison::new(&alone, &answer, &run.mounted).mismatch() {
        return Err(CalibrateError::OtherBody { run: run.name.clone(), mismatch: Box::new(mismatch) });
    }
    let said = contradictions(&alone);
    if !said.is_empty() {
        return Err(CalibrateError::Contradicted { run: run.name.clone(), said: said.join("; ") });
    }
    if alone.lack_of_fit.contradicts() {
        let said = "its residuals are not those of one rigid body that stays as it is: `identify()` tells \
                    what changed; nothing is calibrated by that"
            .to_owned();
        return Err(CalibrateError::Contradicted { run: run.name.clone(), said });
    }
    if answer.is_contradicted() {
        let said = answer.warnings.join("; ");
        return Err(CalibrateError::Contradicted { run: run.name.clone(), said });
    }
    Ok(())
}

fn improbable(chi2: f64, degrees_of_freedom: f64) -> bool {
    degrees_of_freedom > 0.0 && ChiSquared::new(degrees_of_freedom).is_ok_and(|d| d.sf(chi2) < OTHER_BODY)
}

/// Returns what is known after a run, its signals corrected for the means of `about`; what contradicts is
/// refused if the run is `judged`.
fn known_after(
    run: &Run,
    known: &Gaussian,
    causes: &[String],
    about: &Gaussian,
    judged: bool,
) -> Result<Gaussian, CalibrateError> {
    let singular = || CalibrateError::Singular { run: run.name.clone() };
    let errors: Vec<String> = run
        .source
        .nuisances()
        .into_iter()
        .filter(|k| k.scope == Scope::Rig && k.sigma > 0.0)
        .map(|k| k.name)
        .collect();
    let parameters = run.source.parameters().iter().take(TEN).map(|p| p.name.clone());
    let names: Vec<String> = parameters.chain(errors.iter().cloned()).collect();
    let mut map = DMatrix::zeros(names.len(), known.names().len());
    for (own, cause) in run.mounted.causes.iter().enumerate() {
        if let Some(k) = causes.iter().position(|name| *name == cause.name) {
            map.view_mut((0, k), (TEN, 1)).copy_from(&run.mounted.moved.column(own));
        }
    }
    for (i, error) in errors.iter().enumerate() {
        map[(TEN + i, known.place(error).ok_or_else(singular)?)] = 1.0;
    }
    let mut shift = DVector::zeros(names.len());
    shift.rows_mut(0, TEN).copy_from_slice(&run.mounted.parameters);
    let before = known.mapped(names.clone(), &map, &shift).ok_or_else(singular)?;
    let informed = run.source.informed(before.clone()).linearised(about);
    let found = fit(&informed, &FitOptions::default(), &Silent)
        .map_err(|error| CalibrateError::Fit { run: run.name.clone(), error })?;
    let said = if judged { contradictions(&found) } else { Vec::new() };
    if !said.is_empty() {
        return Err(CalibrateError::Contradicted { run: run.name.clone(), said: said.join("; ") });
    }
    let after = found.joint.as_ref().map(|joint| joint.only(|name| names.iter().any(|own| own == name)));
    let after = after.ok_or_else(singular)?;
    // What a run before this one has shown of the body counts, too.
    let of_body = |all: &Gaussian| all.only(|name| names.iter().take(TEN).any(|own| own == name));
    if judged
        && let Some(agreement) = of_body(&before).agreement(&of_body(&after))
        && improbable(agreement.chi2, agreement.degrees_of_freedom)
    {
        let mismatch =
            Mismatch::All { chi2: agreement.chi2, degrees_of_freedom: agreement.degrees_of_freedom };
        return Err(CalibrateError::OtherBody { run: run.name.clone(), mismatch: Box::new(mismatch) });
    }
    known.informed(&map, &before, &after).ok_or_else(singular)
}
