use std::process::ExitCode;

use serde_json::json;

use crate::options::trees::{BaseParams, ModelCheck, ModelCommand, ModelRepair, ModelVerb, RowsWord};
use crate::screen::outcome::say;
use crate::{ExitStatus, Failure, Stages};
use rigident::application::tree::open;
use rigident_model::base::names::legend;
use rigident_model::base::{BaseParameters, Rows, Situation, base_parameters};
use rigident_model::human::Person;
use rigident_model::{Finding, Model, write};

/// Runs `rigident model`.
pub(crate) fn run(command: &ModelCommand) -> Result<ExitCode, Failure> {
    match &command.verb {
        ModelVerb::BaseParams(arguments) => base_params(arguments),
        ModelVerb::Check(arguments) => check(arguments),
        ModelVerb::Repair(arguments) => repair(arguments),
    }
}

fn check(arguments: &ModelCheck) -> Result<ExitCode, Failure> {
    let name = &arguments.model;
    let (model, text) =
        rigident::rows::named_model::read(name, &Person::default()).map_err(Failure::input)?;
    let checked = rigident_model::check::check(&model, text.as_deref(), std::path::Path::new(name));
    if arguments.json {
        let listed = |findings: &[Finding]| -> Vec<_> {
            findings.iter().map(|f| json!({"place": f.place, "text": f.text})).collect()
        };
        say(json!({
            "model": checked.name,
            "links": checked.links,
            "mass_kg": checked.mass_kg,
            "findings": listed(&checked.findings),
            "not_used": listed(&checked.not_used),
        }));
    } else {
        for finding in checked.findings.iter().chain(&checked.not_used) {
            say(finding);
        }
        say(format_args!(
            "{}: {} links, {:.4} kg; {}",
            checked.name,
            checked.links,
            checked.mass_kg,
            match checked.findings.len() {
                0 => "nothing strange found".to_owned(),
                1 => "1 finding".to_owned(),
                n => format!("{n} findings"),
            }
        ));
    }
    Ok(ExitStatus::of(checked.findings.is_empty()).into())
}

fn repair(arguments: &ModelRepair) -> Result<ExitCode, Failure> {
    write::check_target(&arguments.write).map_err(Failure::input)?;
    let name = arguments.model.display().to_string();
    let (model, _) = rigident::rows::named_model::read(&name, &Person::default()).map_err(Failure::input)?;
    let (new, repairs) = model.repaired();
    let is_changed = repairs.iter().any(|repair| repair.taken.is_some());
    if is_changed {
        write::write(&new, Some(arguments.model.as_path()), &arguments.write).map_err(Failure::input)?;
    }
    if arguments.json {
        let listed = repairs.iter().map(|repair| {
            json!({"link": repair.link, "why": repair.why, "taken": repair.taken, "change": repair.change})
        });
        say(json!({
            "model": model.name,
            "written": is_changed.then(|| arguments.write.display().to_string()),
            "repairs": listed.collect::<Vec<_>>(),
        }));
    } else {
        for repair in &repairs {
            match &repair.taken {
                Some(taken) => say(format_args!(
                    "{}: {}; taken as {taken}, a change by {:.1} % of the tensor",
                    repair.link,
                    repair.why,
                    100.0 * repair.change
                )),
                None => say(format_args!("{}: {}; give it the mass that it has", repair.link, repair.why)),
            }
        }
        say(match (repairs.len(), is_changed) {
            (0, _) => format!("{}: every inertia is possible; nothing is written", model.name),
            (_, true) => format!("{}: written", arguments.write.display()),
            (_, false) => format!("{}: nothing is written", model.name),
        });
    }
    Ok(ExitStatus::of(repairs.iter().all(|repair| repair.taken.is_some())).into())
}

fn base_params(arguments: &BaseParams) -> Result<ExitCode, Failure> {
    let (model, is_person) = open(&arguments.model.model, &arguments.model.changes.typed()?)?;
    for finding in &model.findings {
        tell!("rigident: {finding}");
    }
    let floating = arguments.floating || is_person;
    let rows = match arguments.rows {
        Some(RowsWord::Base) => Rows::Base,
        Some(RowsWord::Joint) => Rows::Joint,
        Some(RowsWord::Both) => Rows::Both,
        None if floating => Rows::Base,
        None => Rows::Joint,
    };
    let situation = Situation { floating, rows, mimic: arguments.mimic };
    let stages = Stages::new(&format!("base parameters of {} links", model.links.len()));
    let found = base_parameters(&model, &situation);
    drop(stages);
    let found = found.map_err(Failure::input)?;
    if arguments.json {
        say(object(&model, &situation, &found));
    } else {
        say(text(&model, &situation, &found));
    }
    Ok(ExitCode::SUCCESS)
}

fn object(model: &Model, situation: &Situation, found: &BaseParameters) -> serde_json::Value {
    let parameters: Vec<_> = found
        .parameters
        .iter()
        .map(|p| {
            let terms: Vec<_> = p.terms.iter().map(|(c, w)| json!([found.standard[*c], w])).collect();
            json!({"name": p.name, "terms": terms})
        })
        .collect();
    json!({
        "model": model.name,
        "situation": situation.sentence(),
        "standard": found.standard_count(),
        "count": found.parameters.len(),
        "parameters": parameters,
        "singular_values": {"smallest_kept": found.gap.kept, "largest_dropped": found.gap.dropped},
        "disagreement": found.disagreement,
        "findings": model.findings.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

fn text(model: &Model, situation: &Situation, found: &BaseParameters) -> String {
    let bodies = model.welded();
    let kinds: Vec<String> = bodies.kinds().iter().map(|(kind, n)| format!("{n} {kind}")).collect();
    let followers = bodies.links.iter().filter(|l| l.mimic.is_some()).count();
    let mut out = format!(
        "{}: {} bodies, {} degrees of freedom in joints ({}){}; {}\n{} base parameters of {} standard \
         ones\nsingular values, of random motions over the largest column: smallest kept {:.1e}, dropped \
         ones below {:.1e}; rules and random motions agree to {:.0e}\n",
        model.name,
        bodies.links.iter().filter(|link| link.is_body()).count(),
        bodies.freedoms(),
        if kinds.is_empty() { "none".to_owned() } else { kinds.join(", ") },
        match (followers, situation.mimic) {
            (0, _) => String::new(),
            (n, true) => format!(", {n} of which follow another"),
            (n, false) =>
                format!(", {n} of which mimic another and are counted as their own (--mimic ties them)"),
        },
        situation.sentence(),
        found.parameters.len(),
        found.standard_count(),
        found.gap.kept,
        found.gap.dropped,
        found.disagreement
    );
    for link in bodies.links.iter().filter(|l| !l.welded.is_empty()) {
        out += &format!("{} is one body with {}\n", link.name, link.welded.join(", "));
    }
    if let Some(legend) = legend(found.parameters.iter().map(|p| p.name.as_str())) {
        out += &format!("{legend}\n");
    }
    for parameter in &found.parameters {
        out += &format!("\n{} =", parameter.name);
        for (k, (column, weight)) in parameter.terms.iter().enumerate() {
            let sign = if *weight < 0.0 {
                "- "
            } else if k > 0 {
                "+ "
            } else {
                ""
            };
            let size = weight.abs();
            let factor = if (size - 1.0).abs() < 1e-12 { String::new() } else { format!("{size:.6} ") };
            out += &format!(" {sign}{factor}{}", found.standard[*column]);
        }
    }
    out
}
