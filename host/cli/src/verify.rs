use std::process::ExitCode;

use serde::Serialize;

use super::calibration_arguments::Verify;
use super::outcome::say;
use super::reference_runs::{Read, RigErrors, read};
use super::{ExitStatus, Failure, Stages};
use rigident::answer::{Answer, Context, contradictions};
use rigident::fit::figures::{fixed, with_u95};
use rigident::reference::{Comparison, Quantity, contradiction};
use rigident_fit::FitOptions;

/// The object of `--json`.
#[derive(Serialize)]
struct Object<'a> {
    passed: bool,
    reference: &'a str,
    recordings: Vec<Verified>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    notes: Vec<String>,
}

/// One recording against the reference.
#[derive(Serialize)]
struct Verified {
    recording: String,
    #[serde(skip_serializing_if = "String::is_empty")]
    mounting: String,
    passed: bool,
    #[serde(flatten)]
    comparison: Comparison,
    warnings: Vec<String>,
}

/// `rigident verify`
pub(super) fn run(arguments: &Verify) -> Result<ExitCode, Failure> {
    let errors = RigErrors::Calibrated(arguments.calibration.calibration.as_deref());
    let (body, all) = read(&arguments.runs, errors, "verify")?;
    let recordings = all.iter().map(|read| verified(read, &body.name)).collect::<Result<Vec<_>, _>>()?;
    let notes: Vec<String> = body.place.assumed().into_iter().collect();
    let passed = recordings.iter().all(|recording| recording.passed);
    if arguments.runs.json {
        let object = Object { passed, reference: &body.name, recordings, notes };
        say(serde_json::to_string_pretty(&object).map_err(Failure::input)?);
    } else {
        notes.iter().for_each(|note| tell!("rigident: {note}"));
        for recording in &recordings {
            recording
                .warnings
                .iter()
                .for_each(|warning| tell!("rigident: {}: {warning}", recording.recording));
            say(format_args!("{} against {}", recording.recording, body.name));
            let Comparison { quantities, e_n_limit, .. } = &recording.comparison;
            say(text(quantities, *e_n_limit));
            let above = |limit: f64| -> Vec<&str> {
                quantities.iter().filter(|q| q.is_beyond(limit)).map(|q| q.name.as_str()).collect()
            };
            let (one, failed) = (above(1.0), above(*e_n_limit));
            say(match (recording.passed, failed.is_empty(), one.is_empty()) {
                (true, _, true) => "pass\n".to_owned(),
                (true, _, false) => format!(
                    "pass: |E_n| of {} is above 1, and none above {}, as in 99 % of the recordings of a reference\n",
                    one.join(", "),
                    fixed(*e_n_limit, 2)
                ),
                (false, true, _) => {
                    "fail: the errors of the rig, or the body, are not as stated\n".to_owned()
                }
                (false, false, _) => format!("fail: {}\n", failed.join(", ")),
            });
        }
    }
    Ok(ExitStatus::of(passed).into())
}

/// Identifies the body of a recording and compares it with the reference.
fn verified(read: &Read, reference: &str) -> Result<Verified, Failure> {
    let stages = Stages::new(&format!("estimate of {}", read.name));
    let progress = |stage: &str, share: f64| stages.at(stage, share);
    let fit = read.problem.fit(&FitOptions::default(), &progress).map_err(Failure::input)?;
    drop(stages);
    let context = Context { rate_sigma: read.problem.source().rate_sigma(), ..Context::default() };
    let answer = Answer::new(&fit, context).map_err(Failure::input)?;
    let comparison = Comparison::new(&fit, &answer, &read.mounted);
    let mut warnings = read.warnings.clone();
    warnings.extend(comparison.mismatch().map(|mismatch| mismatch.to_string()));
    let contradicted = contradictions(&fit);
    let mut consistent = !answer.is_contradicted();
    if !consistent && contradicted.is_empty() && !fit.lack_of_fit.contradicts() {
        warnings.extend(answer.warnings.iter().cloned());
    }
    warnings.extend(contradicted);
    // A calibration is asked for by its own prior; without one, what `calibrate rig` would refuse is no reference either.
    if comparison.passed() && consistent && read.problem.rig.calibrated().is_none() {
        let found = contradiction(&read.run()?);
        consistent = found.is_none();
        warnings.extend(found.map(|error| error.to_string()));
    }
    if fit.lack_of_fit.contradicts() {
        warnings.push(
            "the residuals are not those of one rigid body that stays as it is: `rigident identify` tells what changed".to_owned(),
        );
    }
    let same = read.problem.rig.calibrated().filter(|calibration| calibration.reference == reference);
    warnings.extend(same.map(|calibration| {
        format!(
            "the calibration {} was made with this reference: E_n tells whether the rig is still as it was, not whether the reference \
             is right",
            calibration.name
        )
    }));
    Ok(Verified {
        recording: read.name.clone(),
        mounting: read.mounting.clone(),
        passed: comparison.passed() && consistent,
        comparison,
        warnings,
    })
}

/// Returns the table of E_n numbers with the bound on the largest.
fn text(quantities: &[Quantity], limit: f64) -> String {
    let row = |q: &Quantity| {
        let measured = q.value.zip(q.u95).map(|(value, u95)| with_u95(value, u95, &q.unit));
        [
            q.name.clone(),
            measured.unwrap_or_else(|| rigident::fit::figures::NOT_IDENTIFIED.to_owned()),
            with_u95(q.reference, q.reference_u95, &q.unit),
            q.e_n.map_or_else(String::new, |e_n| fixed(e_n, 2)),
            match (q.passed, q.is_beyond(limit)) {
                (true, _) => "pass",
                (false, false) => "above 1",
                (false, true) => "fail",
            }
            .to_owned(),
        ]
    };
    let head = ["", "measured, ± U95", "reference, ± U95", "E_n", ""].map(str::to_owned);
    let rows: Vec<[String; 5]> = std::iter::once(head).chain(quantities.iter().map(row)).collect();
    let width = |k: usize| {
        rows.iter().filter_map(|row| row.get(k)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: [usize; 4] = std::array::from_fn(width);
    let line = |[name, measured, reference, e_n, verdict]: &[String; 5]| {
        let [a, b, c, d] = widths;
        format!(" {name:<a$}  {measured:<b$}  {reference:<c$}  {e_n:>d$}  {verdict}").trim_end().to_owned()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}
