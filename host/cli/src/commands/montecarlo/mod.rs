#[cfg(feature = "simulator")]
pub(crate) mod motions;
#[cfg(feature = "simulator")]
pub(crate) mod poses;

use std::process::ExitCode;
use std::time::Instant;

use rigident_shared::inertia::{PARAMETER_NAMES, PARAMETER_UNITS};
use rigident_sim::rig::RigConfig;
use serde::Serialize;

use crate::commands::montecarlo_arguments::{Estimating, Montecarlo, NoiseReading};
use crate::options::test_body::DemoBody;
use crate::screen::outcome::say;
use crate::{ExitStatus, Failure, Progress};
use rigident::application::Changes;
use rigident::application::driving::check_duration;
use rigident::application::tree::read;
use rigident::device::session::INTERRUPTED;
use rigident::laboratory::trees;
use rigident::plan::plan_file::PlanFile;
use rigident::study::{
    Campaign, CampaignError, DERIVED, Judgement, Limits95, Solver, TreeCampaign, TreeExperiment, Verdict,
    gain_error_sensors, noise_and_gain_error_sensors,
};

/// The object of `--json`.
#[derive(Serialize)]
struct Summary<'a> {
    runs: u64,
    parameters: Vec<Parameter<'a>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    derived: Vec<Parameter<'a>>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    not_identified: &'a [String],
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

/// Runs `rigident montecarlo`.
pub(crate) fn run(arguments: &Montecarlo) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    check_duration(arguments.duration_s)?;
    if let Some(model) = &arguments.model {
        return run_tree(arguments, model, started);
    }
    let config = match arguments.body {
        DemoBody::Horizontal => RigConfig::thesis_horizontal(),
        DemoBody::Vertical => RigConfig::thesis_vertical(),
    };
    let config = match arguments.noise {
        NoiseReading::White => config,
        NoiseReading::Gain => config.with_sensors(gain_error_sensors()),
        NoiseReading::Both => config.with_sensors(noise_and_gain_error_sensors()),
    };
    let mut config = config;
    let imu = &mut config.sensors.imu;
    for (axes, sigma) in [
        (&mut imu.accel_noise_mps2, arguments.accel_noise),
        (&mut imu.gyro_noise_radps, arguments.gyro_noise),
    ] {
        axes.iter_mut().zip(sigma.iter().cycle()).for_each(|(own, sigma)| *own = *sigma);
    }
    let plan = arguments.plan.as_deref().map(|path| PlanFile::read(path, &config.geometry)).transpose();
    let program = plan.map_err(Failure::input)?.map(|plan| plan.program);
    let solver = match arguments.mcu {
        Estimating::Host => Solver::Host,
        Estimating::Inproc => Solver::Firmware,
    };
    let campaign = Campaign {
        program,
        duration_s: arguments.duration_s,
        rate_hz: arguments.rate_hz,
        solver,
        state_noise: !arguments.not_stated,
        ..Campaign::new(config)
    };
    let prepared = campaign.prepare().map_err(failure)?;
    let verdict =
        counted(arguments, started, |done| prepared.run(arguments.runs, arguments.seed, &INTERRUPTED, done))?;
    let quantities: Vec<Quantity<'_>> = quantities(&verdict).collect();
    report(arguments, started, verdict.runs, &quantities, &[])
}

/// Runs `rigident montecarlo --model`.
fn run_tree(arguments: &Montecarlo, name: &str, started: Instant) -> Result<ExitCode, Failure> {
    let rate_hz = arguments.rate_hz;
    if !(rate_hz.is_finite() && rate_hz > 0.0) {
        return Err(Failure::input(format!("--rate-hz {rate_hz}: must be finite and greater than zero")));
    }
    let model = match name {
        "two-links" => trees::two_links(),
        "seven-axes" => trees::seven_axes(),
        name => read(name, &Changes::default())?.0,
    };
    let mut experiment = TreeExperiment {
        rate_hz,
        duration_s: arguments.duration_s,
        has_torques: arguments.torques,
        has_rates: !arguments.no_rates,
        state_noise: !arguments.not_stated,
        ..TreeExperiment::default()
    };
    let noise = &mut experiment.noise;
    for (own, sigma) in [
        (&mut noise.accel, arguments.accel_noise),
        (&mut noise.gyro, arguments.gyro_noise),
        (&mut noise.attitude, arguments.attitude_noise),
        (&mut noise.position, arguments.position_noise),
        (&mut noise.rate, arguments.rate_noise),
    ] {
        *own = sigma.unwrap_or(*own);
    }
    let campaign = TreeCampaign::new(&model, experiment).map_err(failure)?;
    let verdict =
        counted(arguments, started, |done| campaign.run(arguments.runs, arguments.seed, &INTERRUPTED, done))?;
    let quantities = verdict.parameters.iter().map(|p| Quantity {
        name: &p.name,
        unit: &p.unit,
        is_drawn: p.name.starts_with("offset_"),
        judgement: p.judgement,
    });
    let quantities: Vec<Quantity<'_>> = quantities.collect();
    report(arguments, started, verdict.runs, &quantities, &verdict.not_identified)
}

fn failure(error: CampaignError) -> Failure {
    match error {
        CampaignError::TooFew(_) => Failure::interrupted(format!("stopped: {error}")),
        error => Failure::input(error),
    }
}

/// Runs experiments, saying how many are done.
fn counted<V>(
    arguments: &Montecarlo,
    started: Instant,
    run: impl FnOnce(&mut dyn FnMut(u64)) -> Result<V, CampaignError>,
) -> Result<V, Failure> {
    let mut progress = Progress::new();
    let verdict = run(&mut |done| {
        progress.show(|| {
            let rate = done as f64 / started.elapsed().as_secs_f64();
            format!("{done} of {} experiments, {rate:.0}/s", arguments.runs)
        });
    })
    .map_err(failure)?;
    progress.finish();
    Ok(verdict)
}

/// Prints what was found, and returns whether every promise was met.
fn report(
    arguments: &Montecarlo,
    started: Instant,
    runs: u64,
    quantities: &[Quantity<'_>],
    not_identified: &[String],
) -> Result<ExitCode, Failure> {
    let limits = Limits95::of(runs);
    let good = quantities.iter().all(|q| limits.kept_by(&q.judgement));
    if arguments.json {
        let mut parameters: Vec<_> = quantities.iter().map(Quantity::in_json).collect();
        let own = if arguments.model.is_some() { parameters.len() } else { PARAMETER_NAMES.len() };
        let derived = parameters.split_off(own);
        let summary = Summary { runs, parameters, derived, not_identified };
        say(serde_json::to_string(&summary).map_err(Failure::input)?);
    } else {
        say(table(runs, quantities, &limits));
        if !not_identified.is_empty() {
            say(format!("\nNot identified in every experiment: {}.", not_identified.join(", ")));
        }
        say(line(runs, quantities, &limits, started.elapsed().as_secs_f64()));
    }
    if runs < arguments.runs {
        tell!("rigident: stopped after {runs} of {} experiments", arguments.runs);
        return Ok(ExitStatus::NotIdentified.into());
    }
    Ok(ExitStatus::of(good && not_identified.is_empty()).into())
}

/// A judgement with what it is of.
struct Quantity<'a> {
    name: &'a str,
    unit: &'a str,
    /// Each experiment draws its own.
    is_drawn: bool,
    judgement: Judgement,
}

impl<'a> Quantity<'a> {
    fn in_json(&self) -> Parameter<'a> {
        let Self { name, unit, judgement: p, .. } = self;
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

/// The derived quantities: in S, about the centre of mass.
const DERIVED_NAMES: [&str; DERIVED] =
    ["com_x", "com_y", "com_z", "Ixx_com", "Iyy_com", "Izz_com", "Iyz_com", "Izx_com", "Ixy_com"];

/// Returns the parameters, and the quantities derived from them.
fn quantities(verdict: &Verdict) -> impl Iterator<Item = Quantity<'static>> {
    let derived_units = ["m"; 3].into_iter().chain(["kg m²"; 6]);
    let names =
        PARAMETER_NAMES.into_iter().zip(PARAMETER_UNITS).chain(DERIVED_NAMES.into_iter().zip(derived_units));
    let judgements = verdict.parameters.into_iter().chain(verdict.derived);
    names.zip(judgements).enumerate().map(|(j, ((name, unit), judgement))| Quantity {
        name,
        unit,
        is_drawn: (10..16).contains(&j),
        judgement,
    })
}

fn table(runs: u64, quantities: &[Quantity<'_>], limits: &Limits95) -> String {
    let width = quantities.iter().map(|q| q.name.chars().count()).fold(10, usize::max);
    let mut text = format!(
        "  {:<width$} {:<6} {:>9} {:>10} {:>9} {:>10} {:>10} {:>10} {:>8}",
        "", "", "truth", "bias", "its se", "std", "bound", "efficiency", "coverage"
    );
    for Quantity { name, unit, is_drawn, judgement } in quantities {
        let Judgement { truth, bias, std, crb_std, coverage95, .. } = judgement;
        let errors = bias / (std / (runs as f64).sqrt());
        let truth = if *is_drawn { "drawn".to_owned() } else { format!("{truth:.4}") };
        text.push_str(&format!(
            "\n  {:<width$} {:<6} {truth:>9} {bias:>10.2e} {errors:>+9.2} {std:>10.3e} {crb_std:>10.3e} \
             {:>10.3} {:>6.1} %{}",
            name,
            unit,
            judgement.efficiency(),
            100.0 * coverage95,
            if limits.kept_by(judgement) { "" } else { "  <-" },
        ));
    }
    text
}

fn line(runs: u64, quantities: &[Quantity<'_>], limits: &Limits95, elapsed_s: f64) -> String {
    let missed: Vec<&str> =
        quantities.iter().filter(|q| !limits.kept_by(&q.judgement)).map(|q| q.name).collect();
    let (least, largest) = limits.coverage;
    let asked = format!(
        "efficiency of {:.2} or more and coverage within {:.1}-{:.1} % in {} experiments ({elapsed_s:.1} s)",
        limits.efficiency,
        100.0 * least,
        100.0 * largest,
        runs
    );
    if missed.is_empty() {
        let few = if runs < Limits95::ASKED { ", which are wider for so few experiments" } else { "" };
        format!("\nWithin the limits{few}: {asked}.")
    } else {
        format!("\nOUTSIDE the limits {}: {asked}.", missed.join(", "))
    }
}
