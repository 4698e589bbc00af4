use std::process::ExitCode;
use std::sync::atomic::Ordering;

use rigident_shared::inertia::{PARAMETER_NAMES, PARAMETER_UNITS};
use serde::Serialize;

use crate::commands::montecarlo_arguments::MontecarloMotions;
use crate::screen::outcome::say;
use crate::{ExitStatus, Failure, Progress};
use rigident::device::session::INTERRUPTED;
use rigident::plan::equipment::Equipment;
use rigident::plan::motion::{Task, compare};
use rigident::study::motions::{RepeatedMotion, motions, table};
use rigident::study::two_step::{self, Judged, two_steps};
use rigident::study::{CampaignError, K95, Limits95};

/// The object of `--json`.
#[derive(Serialize)]
struct Object {
    runs: u64,
    motions: Vec<Motion>,
}

#[derive(Serialize)]
struct Motion {
    mounting: &'static str,
    motion: &'static str,
    parameters: Vec<Parameter>,
}

#[derive(Serialize)]
struct Parameter {
    name: &'static str,
    unit: &'static str,
    bias: f64,
    std: f64,
    crb_std: f64,
    planned_std: f64,
    coverage95: f64,
}

/// Runs `rigident montecarlo two-steps`.
pub(crate) fn in_two_steps(arguments: &MontecarloMotions) -> Result<ExitCode, Failure> {
    let MontecarloMotions { runs, seed, duration_s, rate_hz, json } = *arguments;
    let mut progress = Progress::new();
    let rows = planned(arguments, &mut progress)?;
    let all = two_steps(&rows, rate_hz, [runs, seed], &INTERRUPTED, |body, motion, done| {
        progress.show(|| format!("{body}, {motion}: {done} of {runs} experiments"));
    });
    progress.finish();
    let all = all.map_err(failure)?;
    let fewest = all.iter().map(|row| row.runs).min().unwrap_or(0);
    if json {
        let motions: Vec<_> = all
            .iter()
            .map(|row| {
                let judged =
                    |j: &Judged| serde_json::json!({ "rms_kgm2": j.rms, "coverage95": j.coverage95 });
                serde_json::json!({
                    "mounting": row.body,
                    "motion": row.motion,
                    "joint": judged(&row.joint),
                    "believed": judged(&row.believed),
                    "carried": judged(&row.carried),
                })
            })
            .collect();
        say(serde_json::json!({ "runs": fewest, "motions": motions }));
    } else {
        say(format!(
            "The tensor about S's origin, in one step and in two, {fewest} experiments of {duration_s} s at \
             {rate_hz} Hz each:\n\n{}",
            two_step::table(&all).trim_end()
        ));
    }
    Ok(if interrupted(fewest, runs) { ExitStatus::NotIdentified.into() } else { ExitCode::SUCCESS })
}

/// Returns the motions of `plan compare`.
fn planned(arguments: &MontecarloMotions, progress: &mut Progress) -> Result<Vec<compare::Row>, Failure> {
    let MontecarloMotions { duration_s, rate_hz, .. } = *arguments;
    let task = Task { duration_s, rate_hz, ..Task::new(Equipment::thesis_horizontal()) };
    compare::compare(&task, &INTERRUPTED, |text| progress.show(|| text)).map_err(Failure::input)
}

fn failure(error: CampaignError) -> Failure {
    match error {
        CampaignError::TooFew(_) => Failure::interrupted(format!("stopped: {error}")),
        error => Failure::input(error),
    }
}

/// Says so.
fn interrupted(fewest: u64, runs: u64) -> bool {
    let stopped = INTERRUPTED.load(Ordering::Relaxed);
    if stopped {
        tell!("rigident: stopped after {fewest} of {runs} experiments of the last motion");
    }
    stopped
}

/// Runs `rigident montecarlo motions`.
pub(crate) fn run(arguments: &MontecarloMotions) -> Result<ExitCode, Failure> {
    let MontecarloMotions { runs, seed, duration_s, rate_hz, json } = *arguments;
    let mut progress = Progress::new();
    let rows = planned(arguments, &mut progress)?;
    let repeated = motions(&rows, rate_hz, [runs, seed], &INTERRUPTED, |body, motion, done| {
        progress.show(|| format!("{body}, {motion}: {done} of {runs} experiments"));
    });
    progress.finish();
    let repeated = repeated.map_err(failure)?;
    let fewest = repeated.iter().map(|motion| motion.verdict.runs).min().unwrap_or(0);
    let limits = Limits95::of(fewest);
    let missed: Vec<String> = repeated.iter().flat_map(|motion| missed(motion, &limits)).collect();
    if json {
        let object = Object { runs: fewest, motions: repeated.iter().map(in_json).collect() };
        say(serde_json::to_string(&object).map_err(Failure::input)?);
    } else {
        say(format!(
            "Found over planned standard deviations, {fewest} experiments of {duration_s} s at {rate_hz} Hz \
             each:\n\n{}",
            table(&repeated).trim_end()
        ));
        say(
            "\nThe thesis gives such figures in its Tables 24 to 37, which are not in the printed part that \
             is at hand: there is nothing to set beside them.",
        );
        match missed.as_slice() {
            [] => say("Every parameter keeps efficiency and coverage."),
            missed => say(format!("Out of bounds: {}.", missed.join("; "))),
        }
    }
    if interrupted(fewest, runs) {
        return Ok(ExitStatus::NotIdentified.into());
    }
    Ok(ExitStatus::of(missed.is_empty()).into())
}

fn missed(motion: &RepeatedMotion, limits: &Limits95) -> Vec<String> {
    let names = PARAMETER_NAMES.iter().zip(&motion.verdict.parameters).take(10);
    let off = names.filter(|(_, judgement)| !limits.kept_by(judgement));
    off.map(|(name, judgement)| {
        let coverage = 100.0 * judgement.coverage95;
        let efficiency = judgement.efficiency();
        format!(
            "{}, {}: {name} efficiency {efficiency:.3}, coverage {coverage:.1} %",
            motion.body, motion.motion
        )
    })
    .collect()
}

fn in_json(motion: &RepeatedMotion) -> Motion {
    let judged = motion.verdict.parameters.iter().zip(motion.predicted_u95);
    let named = PARAMETER_NAMES.into_iter().zip(PARAMETER_UNITS).zip(judged);
    let parameters = named.map(|((name, unit), (judgement, u95))| Parameter {
        name,
        unit,
        bias: judgement.bias,
        std: judgement.std,
        crb_std: judgement.crb_std,
        planned_std: u95 / K95,
        coverage95: judgement.coverage95,
    });
    Motion { mounting: motion.body, motion: motion.motion, parameters: parameters.collect() }
}
