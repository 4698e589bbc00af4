//! `rigident calibrate masses`: masses and centres of mass of a robot's links relative to its model.

use std::fmt::Write as _;
use std::process::ExitCode;

use serde::Serialize;

use super::calibrate_masses_rows::{Read, read};
use super::calibration_arguments::{CalibrateMasses, MassMethod};
use super::outcome::say;
use super::{ExitStatus, Failure, Stages};
use rigident::fit::figures::{counted, significant};
use rigident::mass_properties::comparison::{Comparison, Outcome, Study, Way};
use rigident::mass_properties::methods::Method;
use rigident::mass_properties::unknowns::ParameterSet;
use rigident::mass_properties::whole_mass::WholeMass;
use rigident::rows::tree::TreeSource;
use rigident_model::{Model, remarks, write};

/// The object of `--json`.
#[derive(Serialize)]
struct Object {
    schema: &'static str,
    model: String,
    recordings: Vec<String>,
    parts: usize,
    rows: u64,
    unknowns: usize,
    rank: usize,
    condition: f64,
    base_parameters: usize,
    nominal_cost: f64,
    ways: Vec<WayObject>,
    #[serde(skip_serializing_if = "Option::is_none")]
    chosen: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    whole_mass_kg: Option<f64>,
    /// As rows tell it by themselves.
    #[serde(skip_serializing_if = "Option::is_none")]
    identified_whole_mass_kg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    identified_whole_mass_u95_kg: Option<f64>,
    /// Constant force on the base that nothing measures, axes of the base, where one was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    external_force_n: Option<[f64; 3]>,
    nominal_whole_mass_kg: f64,
    links: Vec<LinkObject>,
    notes: Vec<String>,
    warnings: Vec<String>,
}

/// One way.
#[derive(Serialize)]
struct WayObject {
    way: &'static str,
    setting: String,
    is_setting_chosen: bool,
    cost: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    left_out_cost: Option<f64>,
    negative_masses: usize,
    impossible_links: usize,
}

/// A link as the chosen way has it: by itself it is not identified.
#[derive(Serialize)]
struct LinkObject {
    link: String,
    mass_kg: f64,
    nominal_mass_kg: f64,
    centre_of_mass_m: [f64; 3],
    nominal_centre_of_mass_m: [f64; 3],
}

/// `rigident calibrate masses`
pub(super) fn run(arguments: &CalibrateMasses) -> Result<ExitCode, Failure> {
    if let Some(path) = &arguments.write_model {
        write::check_target(path).map_err(Failure::input)?;
    }
    let ways = ways(arguments)?;
    let stages = Stages::new("reading the model");
    let read = read(arguments, &stages)?;
    let Some((source, (model, file))) =
        read.loaded.first().and_then(|first| Some((first.problem.tree()?, first.nominal()?)))
    else {
        return Err(Failure::input("no recording of a tree of links"));
    };
    stages.at("ways side by side", 0.0);
    let study = Study {
        model,
        base: source.base(),
        parts: &read.factors,
        set: if arguments.all_parameters { ParameterSet::All } else { ParameterSet::MassAndMoment },
        symmetric: arguments.symmetric_sides,
        least: arguments.least_mass,
    };
    let compared = study
        .compare(&ways.0, &ways.1, &|share| stages.at("ways side by side", share))
        .map_err(Failure::input)?;
    drop(stages);
    let mut chosen = chosen(arguments, &compared);
    let mut warnings = read.warnings.clone();
    let is_worse = chosen.is_some_and(|outcome| compared.is_better_than_nominal(outcome) == Some(false));
    if is_worse {
        warnings.push(
            "what was left out is predicted no better than by the nominal model, whose masses the recordings do not improve: nothing is \
             written; record motions that excite more, or look for a column that is wrong"
                .to_owned(),
        );
        chosen = None;
    }
    if let (Some(path), Some(outcome)) = (&arguments.write_model, chosen) {
        write::write(&outcome.model, file, path).map_err(Failure::input)?;
        warnings.extend(remarks::remarks(&outcome.model, file, path, &arguments.changes.lock));
    }
    if chosen.is_none() && !is_worse {
        warnings.push(
            "no way gives bodies that can be: nothing is written; take motions that excite more, or fewer unknowns by --symmetric-sides"
                .to_owned(),
        );
    } else if chosen.is_some_and(|outcome| outcome.impossible > 0) {
        warnings.push(
            "some links of what was asked for are no bodies that can be: do not simulate or control with these numbers"
                .to_owned(),
        );
    }
    let object = object(arguments, &read, model, source, &compared, chosen, warnings);
    if arguments.json {
        say(serde_json::to_string_pretty(&object).map_err(Failure::input)?);
    } else {
        say(words(&object, &compared).trim_end());
        object.notes.iter().for_each(|note| tell!("rigident: {note}"));
        object.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
        if let (Some(path), true) = (&arguments.write_model, chosen.is_some()) {
            say(format_args!("\nModel in {}.", path.display()));
        }
    }
    let is_good = chosen.is_some_and(|outcome| outcome.impossible == 0);
    Ok(ExitStatus::of(is_good && !read.has_suspects).into())
}

/// Returns the ways whose settings are chosen, and those whose setting is given.
fn ways(arguments: &CalibrateMasses) -> Result<(Vec<Way>, Vec<Way>), Failure> {
    let positive = |option: &str, value: Option<f64>| match value {
        Some(value) if !(value.is_finite() && value > 0.0) => {
            Err(Failure::input(format!("{option} {value}: must be finite and greater than zero")))
        }
        value => Ok(value),
    };
    if !(0.0..1.0).contains(&arguments.least_mass) {
        return Err(Failure::input(format!(
            "--least-mass {}: a share of the nominal mass, from 0 to less than 1",
            arguments.least_mass
        )));
    }
    let given = [
        (
            MassMethod::Truncated,
            positive("--condition", arguments.condition)?
                .map(|condition| ("--condition", Way::Relative(Method::Truncated { condition }))),
        ),
        (
            MassMethod::Gradient,
            arguments
                .steps
                .map(|steps| ("--steps", Way::Relative(Method::Gradient { steps: steps as usize }))),
        ),
        (
            MassMethod::Ridge,
            positive("--weight", arguments.weight)?
                .map(|weight| ("--weight", Way::Relative(Method::Ridge { weight }))),
        ),
        (
            MassMethod::Consistent,
            positive("--nominal-sigma", arguments.nominal_sigma)?
                .map(|trust| ("--nominal-sigma", Way::Consistent { trust })),
        ),
    ];
    let (mut open, mut fixed) = (Vec::new(), Vec::new());
    for way in Way::all() {
        let own = given.iter().find(|(method, _)| name(*method) == way.name()).and_then(|(_, own)| *own);
        match own {
            Some((option, _))
                if arguments.method != MassMethod::Best && name(arguments.method) != way.name() =>
            {
                return Err(Failure::input(format!(
                    "{option} is of --method {}, and --method is {}",
                    way.name(),
                    name(arguments.method)
                )));
            }
            Some((_, way)) => fixed.push(way),
            None => open.push(way),
        }
    }
    Ok((open, fixed))
}

fn name(method: MassMethod) -> &'static str {
    match method {
        MassMethod::Best => "best",
        MassMethod::Truncated => "truncated",
        MassMethod::Gradient => "gradient",
        MassMethod::Bounded => "bounded",
        MassMethod::Ridge => "ridge",
        MassMethod::Consistent => "consistent",
    }
}

fn chosen<'a>(arguments: &CalibrateMasses, compared: &'a Comparison) -> Option<&'a Outcome> {
    match arguments.method {
        MassMethod::Best => compared.best(),
        method => compared.outcomes.iter().find(|outcome| outcome.way.name() == name(method)),
    }
}

fn object(
    arguments: &CalibrateMasses,
    read: &Read,
    model: &Model,
    source: &TreeSource,
    compared: &Comparison,
    chosen: Option<&Outcome>,
    warnings: Vec<String>,
) -> Object {
    let mass =
        |model: &Model| -> f64 { model.links.iter().filter_map(|l| l.nominal).map(|phi| phi[0]).sum() };
    let centre = |phi: [f64; 10]| -> [f64; 3] {
        std::array::from_fn(|k| if phi[0] == 0.0 { 0.0 } else { phi[1 + k] / phi[0] })
    };
    let whole = WholeMass::of(&read.factors, source.base());
    let links = chosen.map_or_else(Vec::new, |outcome| {
        let pairs = outcome.model.links.iter().zip(&model.links);
        let pairs = pairs.filter_map(|(own, nominal)| Some((&own.name, own.nominal?, nominal.nominal?)));
        let own = pairs.map(|(name, own, nominal)| LinkObject {
            link: name.clone(),
            mass_kg: own[0],
            nominal_mass_kg: nominal[0],
            centre_of_mass_m: centre(own),
            nominal_centre_of_mass_m: centre(nominal),
        });
        own.collect()
    });
    Object {
        schema: "rigident/mass-properties/1",
        model: model.name.clone(),
        recordings: arguments.recordings.iter().map(|path| path.display().to_string()).collect(),
        parts: read.factors.len(),
        rows: compared.rows,
        unknowns: compared.unknowns,
        rank: compared.rank,
        condition: compared.condition,
        base_parameters: source.base().parameters.len(),
        nominal_cost: compared.nominal,
        ways: compared
            .outcomes
            .iter()
            .map(|outcome| WayObject {
                way: outcome.way.name(),
                setting: outcome.way.setting(),
                is_setting_chosen: outcome.is_chosen,
                cost: outcome.direct,
                left_out_cost: outcome.left_out.map(|left| left.squares),
                negative_masses: outcome.negative,
                impossible_links: outcome.impossible,
            })
            .collect(),
        chosen: chosen.map(|outcome| outcome.way.name().to_owned()),
        whole_mass_kg: chosen.map(|outcome| mass(&outcome.model)),
        identified_whole_mass_kg: whole.map(|whole| whole.kg),
        identified_whole_mass_u95_kg: whole.map(|whole| whole.u95_kg),
        external_force_n: read.external.map(|external| external.force_n),
        nominal_whole_mass_kg: mass(model),
        links,
        notes: read.notes.clone(),
        warnings,
    }
}

fn words(object: &Object, compared: &Comparison) -> String {
    let mut out = format!(
        "{}, of whose directions {} rows in {} tell {}, condition number {:.1e}; {} base parameters\n\n",
        counted(object.unknowns, "unknown", "unknowns"),
        object.rows,
        counted(object.parts, "part", "parts"),
        object.rank,
        object.condition,
        object.base_parameters
    );
    let cost = |value: f64| format!("{:.4}", value / compared.nominal);
    let _ = writeln!(
        out,
        "  {:<11} {:<18} {:>9} {:>10} {:>9} {:>11}",
        "way", "setting", "cost", "left out", "mass ≤ 0", "impossible"
    );
    let _ = writeln!(
        out,
        "  {:<11} {:<18} {:>9} {:>10} {:>9} {:>11}",
        "nominal",
        "",
        cost(compared.nominal),
        cost(compared.nominal),
        "",
        ""
    );
    for own in &object.ways {
        let mark = if object.chosen.as_deref() == Some(own.way) { "*" } else { " " };
        let left = own.left_out_cost.map_or_else(|| "–".to_owned(), cost);
        let _ = writeln!(
            out,
            "{mark} {:<11} {:<18} {:>9} {left:>10} {:>9} {:>11}",
            own.way,
            own.setting,
            cost(own.cost),
            own.negative_masses,
            own.impossible_links
        );
    }
    let _ = writeln!(
        out,
        "\nCost: squares left, relative to what the nominal model leaves; left out: each part by what the others gave."
    );
    if let Some(way) = &object.chosen {
        let _ = writeln!(
            out,
            "\nLinks by the way {way}, beside the model: single ones are not identified and have no interval: as far as rows do not tell them they \
             are the model's:\n"
        );
        let width = object.links.iter().map(|link| link.link.chars().count()).max().unwrap_or(4);
        let _ = writeln!(
            out,
            "  {:<width$} {:>10} {:>10} {:>8}   centre of mass, mm (change)",
            "link", "kg", "nominal", "change"
        );
        for link in object.links.iter().filter(|link| link.nominal_mass_kg > 0.0) {
            let centre: Vec<String> = (0..3)
                .map(|k| {
                    let (own, nominal) = (link.centre_of_mass_m[k], link.nominal_centre_of_mass_m[k]);
                    format!("{:.1} ({:+.1})", 1e3 * own, 1e3 * (own - nominal))
                })
                .collect();
            let share = 100.0 * (link.mass_kg / link.nominal_mass_kg - 1.0);
            let _ = writeln!(
                out,
                "  {:<width$} {:>10} {:>10} {:>7} %   {}",
                link.link,
                significant(link.mass_kg, 4),
                significant(link.nominal_mass_kg, 4),
                format!("{share:+.1}"),
                centre.join(", ")
            );
        }
    }
    if let Some(mass) = object.whole_mass_kg {
        let _ = writeln!(out, "\n  All links: {mass:.3} kg, nominal {:.3} kg.", object.nominal_whole_mass_kg);
    }
    let identified = object.identified_whole_mass_kg.zip(object.identified_whole_mass_u95_kg);
    let _ = match identified {
        Some((mass, u95)) => {
            writeln!(out, "  The whole mass by the rows alone: {mass:.3} ± {u95:.3} kg (U95).")
        }
        None => writeln!(out, "  The whole mass is not identified: it is the model's."),
    };
    out
}
