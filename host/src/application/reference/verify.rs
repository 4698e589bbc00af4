//! The answer of a recording against the reference body that it is of.

use serde::Serialize;

use super::super::{Caller, Error};
use super::runs::{ReferenceRun, ReferenceRuns};
use rigident_fit::figures::fixed;
use rigident_fit::{FitOptions, Progress};
use rigident_identify::answer::{Answer, Context, contradictions};
use rigident_identify::reference::{Comparison, contradiction};
use rigident_present::reference::table;

/// Recordings against the reference body that they are of.
#[derive(Clone, Debug, Serialize)]
pub struct Verification {
    /// True if every quantity of every recording passes.
    pub passed: bool,
    /// Name of the reference body.
    pub reference: String,
    /// The recordings.
    pub recordings: Vec<Verified>,
    /// The assumptions made.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// A recording against the reference.
#[derive(Clone, Debug, Serialize)]
pub struct Verified {
    /// The path of the recording.
    pub recording: String,
    /// Name of the mounting; empty: its place.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub mounting: String,
    /// True if every quantity passes, and nothing contradicts the recording.
    pub passed: bool,
    /// Each quantity against the reference.
    #[serde(flatten)]
    pub comparison: Comparison,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
}

impl ReferenceRuns {
    /// Identifies the body of every recording and compares it with the reference.
    ///
    /// # Errors
    /// A recording has no fit or no answer, or is of several links; the caller stops the job.
    pub fn verify(&self, caller: &Caller<'_>) -> Result<Verification, Error> {
        caller.stoppable(|| {
            let verified = |run| verified(run, &self.body.name, caller);
            let recordings = self.runs.iter().map(verified).collect::<Result<Vec<_>, _>>()?;
            Ok(Verification {
                passed: recordings.iter().all(|recording| recording.passed),
                reference: self.body.name.clone(),
                recordings,
                notes: self.body.place.assumed().into_iter().collect(),
            })
        })
    }
}

fn verified(run: &ReferenceRun, reference: &str, caller: &Caller<'_>) -> Result<Verified, Error> {
    caller.stage(&format!("estimate of {}", run.name), 0.0);
    let fit = run.problem.fit(&FitOptions::default(), caller)?;
    let context = Context { rate_sigma: run.problem.source().rate_sigma(), ..Context::default() };
    let answer = Answer::new(&fit, context)?;
    let comparison = Comparison::new(&fit, &answer, &run.mounted);
    let mut warnings = run.warnings.clone();
    warnings.extend(comparison.mismatch().map(|mismatch| mismatch.to_string()));
    let contradicted = contradictions(&fit);
    let mut consistent = !answer.is_contradicted();
    if !consistent && contradicted.is_empty() && !fit.lack_of_fit.contradicts() {
        warnings.extend(answer.warnings.iter().cloned());
    }
    warnings.extend(contradicted);
    // A calibration is asked for by its own prior; without one, what no rig is calibrated by is no reference
    // either.
    if comparison.passed() && consistent && run.problem.rig.calibrated().is_none() {
        let found = contradiction(&run.run()?);
        consistent = found.is_none();
        warnings.extend(found.map(|error| error.to_string()));
    }
    if fit.lack_of_fit.contradicts() {
        warnings.push(
            "the residuals are not those of one rigid body that stays as it is: `identify()` tells what \
             changed"
                .to_owned(),
        );
    }
    let same = run.problem.rig.calibrated().filter(|calibration| calibration.reference == reference);
    warnings.extend(same.map(|calibration| {
        format!(
            "the calibration {} was made with this reference: E_n tells whether the rig is still as it was, \
             not whether the reference \
             is right",
            calibration.name
        )
    }));
    Ok(Verified {
        recording: run.name.clone(),
        mounting: run.mounting.clone(),
        passed: comparison.passed() && consistent,
        comparison,
        warnings,
    })
}

impl Verified {
    /// Returns the table of E_n numbers with the verdict.
    pub fn text(&self, reference: &str) -> String {
        let Comparison { quantities, e_n_limit, .. } = &self.comparison;
        let above = |limit: f64| -> Vec<&str> {
            quantities.iter().filter(|q| q.is_beyond(limit)).map(|q| q.name.as_str()).collect()
        };
        let (one, failed) = (above(1.0), above(*e_n_limit));
        let verdict = match (self.passed, failed.is_empty(), one.is_empty()) {
            (true, _, true) => "pass".to_owned(),
            (true, _, false) => format!(
                "pass: |E_n| of {} is above 1, and none above {}, as in 99 % of the recordings of a \
                 reference",
                one.join(", "),
                fixed(*e_n_limit, 2)
            ),
            (false, true, _) => "fail: the errors of the rig, or the body, are not as stated".to_owned(),
            (false, false, _) => format!("fail: {}", failed.join(", ")),
        };
        format!("{} against {reference}\n{}\n{verdict}\n", self.recording, table(quantities, *e_n_limit))
    }
}
