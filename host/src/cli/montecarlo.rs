use std::process::ExitCode;
use std::time::Instant;

use rigident_shared::inertia::{PARAMETER_NAMES, PARAMETER_UNITS};
use rigident_sim::rig::RigConfig;
use serde::Serialize;

use super::arguments::{DemoBody, Estimating, Montecarlo, NoiseReading};
use super::experiment::check_duration;
use super::outcome::say;
use super::{ExitStatus, Failure, Progress};
use crate::device::session::INTERRUPTED;
use crate::montecarlo::{
    Campaign, CampaignError, DERIVED, Judgement, Limits95, Solver, Verdict, gain_error_sensors,
    noise_and_gain_error_sensors,
};

/// The object of `--json`.
#[derive(Serialize)]
struct Summary<'a> {
    runs: u64,
    parameters: Vec<Parameter<'a>>,
    derived: Vec<Parameter<'a>>,
}

#[derive(Serialize)]
struct Parameter<'a> {
    name: &'a str,
    unit: &'a str,
    bias: f64,
    std: f64,
    crb_std: f64,
    predicted_std: f64,
    efficiency: f64,
    coverage95: f64,
}

/// `rigident montecarlo`
pub(super) fn run(arguments: &Montecarlo) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    check_duration(arguments.duration_s)?;
    let config = match arguments.body {
        DemoBody::Horizontal => RigConfig::thesis_horizontal(),
        DemoBody::Vertical => RigConfig::thesis_vertical(),
    };
    let config = match arguments.noise {
        NoiseReading::White => config,
        NoiseReading::Gain => config.with_sensors(gain_error_sensors()),
        NoiseReading::Both => config.with_sensors(noise_and_gain_error_sensors()),
    };
    let solver = match arguments.mcu {
        Estimating::Host => Solver::Host,
        Estimating::Inproc => Solver::Firmware,
    };
    let campaign = Campaign {
        program: None,
        duration_s: arguments.duration_s,
        rate_hz: arguments.rate_hz,
        solver,
        ..Campaign::new(config)
    };
    let mut progress = Progress::new();
    let verdict = campaign
        .prepare()
        .and_then(|prepared| {
            prepared.run(arguments.runs, arguments.seed, &INTERRUPTED, |done| {
                progress.show(|| {
                    let rate = done as f64 / started.elapsed().as_secs_f64();
                    format!("{done} of {} experiments, {rate:.0}/s", arguments.runs)
                });
            })
        })
        .map_err(|error| match error {
            CampaignError::TooFew(_) => Failure::input(format!("stopped: {error}")),
            error => Failure::input(error),
        })?;
    progress.finish();
    let limits = Limits95::of(verdict.runs);
    let good = quantities(&verdict).all(|q| limits.kept_by(&q.judgement));
    if arguments.json {
        let text = serde_json::to_string(&summary(&verdict)).map_err(Failure::input)?;
        say(text);
    } else {
        say(table(&verdict, &limits));
        say(line(&verdict, &limits, started.elapsed().as_secs_f64()));
    }
    if verdict.runs < arguments.runs {
        tell!("rigident: stopped after {} of {} experiments", verdict.runs, arguments.runs);
        return Ok(ExitStatus::NotIdentified.into());
    }
    Ok(ExitStatus::of(good).into())
}

/// A judgement with what it is of.
struct Quantity {
    name: &'static str,
    unit: &'static str,
    judgement: Judgement,
}

impl Quantity {
    fn in_json(self) -> Parameter<'static> {
        let Self { name, unit, judgement: p } = self;
        Parameter {
            name,
            unit,
            bias: p.bias,
            std: p.std,
            crb_std: p.crb_std,
            predicted_std: p.predicted_std,
            efficiency: p.efficiency(),
            coverage95: p.coverage95,
        }
    }
}

/// What is derived: in S, about the centre of mass.
const DERIVED_NAMES: [&str; DERIVED] =
    ["com_x", "com_y", "com_z", "Ixx_com", "Iyy_com", "Izz_com", "Iyz_com", "Izx_com", "Ixy_com"];

/// The parameters, and what is derived from them.
fn quantities(verdict: &Verdict) -> impl Iterator<Item = Quantity> {
    let derived_units = ["m"; 3].into_iter().chain(["kg m²"; 6]);
    let names =
        PARAMETER_NAMES.into_iter().zip(PARAMETER_UNITS).chain(DERIVED_NAMES.into_iter().zip(derived_units));
    let judgements = verdict.parameters.into_iter().chain(verdict.derived);
    names.zip(judgements).map(|((name, unit), judgement)| Quantity { name, unit, judgement })
}

fn summary(verdict: &Verdict) -> Summary<'static> {
    let mut parameters: Vec<_> = quantities(verdict).map(Quantity::in_json).collect();
    let derived = parameters.split_off(PARAMETER_NAMES.len());
    Summary { runs: verdict.runs, parameters, derived }
}

fn table(verdict: &Verdict, limits: &Limits95) -> String {
    let mut text = format!(
        "  {:<10} {:<6} {:>9} {:>10} {:>9} {:>10} {:>10} {:>10} {:>8}",
        "", "", "truth", "bias", "its se", "std", "bound", "efficiency", "coverage"
    );
    for (j, Quantity { name, unit, judgement }) in quantities(verdict).enumerate() {
        let Judgement { truth, bias, std, crb_std, coverage95, .. } = judgement;
        let errors = bias / (std / (verdict.runs as f64).sqrt());
        let truth = if !(10..16).contains(&j) { format!("{truth:.4}") } else { "drawn".to_owned() };
        text.push_str(&format!(
            "\n  {:<10} {:<6} {truth:>9} {bias:>10.2e} {errors:>+9.2} {std:>10.3e} {crb_std:>10.3e} {:>10.3} {:>6.1} %{}",
            name,
            unit,
            judgement.efficiency(),
            100.0 * coverage95,
            if limits.kept_by(&judgement) { "" } else { "  <-" },
        ));
    }
    text
}

fn line(verdict: &Verdict, limits: &Limits95, elapsed_s: f64) -> String {
    let missed: Vec<&str> =
        quantities(verdict).filter(|q| !limits.kept_by(&q.judgement)).map(|q| q.name).collect();
    let (least, largest) = limits.coverage;
    let asked = format!(
        "efficiency of {:.2} or more and coverage within {:.1}-{:.1} % in {} experiments ({elapsed_s:.1} s)",
        limits.efficiency,
        100.0 * least,
        100.0 * largest,
        verdict.runs
    );
    if missed.is_empty() {
        format!("\nEvery parameter keeps to {asked}.")
    } else {
        format!("\nNOT kept to by {}: {asked}.", missed.join(", "))
    }
}
