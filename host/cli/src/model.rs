use std::process::ExitCode;

use serde_json::json;

use super::options::trees::{
    BaseParams, ModelChanges, ModelCheck, ModelCommand, ModelVerb, RowsWord, SexWord,
};
use super::outcome::say;
use super::{ExitStatus, Failure, Stages};
use rigident_model::base::names::legend;
use rigident_model::base::{BaseParameters, Rows, Situation, base_parameters};
use rigident_model::human::{Person, Sex};
use rigident_model::{Finding, Model};

/// `rigident model`
pub(super) fn run(command: &ModelCommand) -> Result<ExitCode, Failure> {
    match &command.verb {
        ModelVerb::BaseParams(arguments) => base_params(arguments),
        ModelVerb::Check(arguments) => check(arguments),
    }
}

/// The model that the options describe, and whether it is one of the people.
pub(super) fn open(name: &str, options: &ModelChanges) -> Result<(Model, bool), Failure> {
    let (mut model, is_person) = read(name, options)?;
    change(&mut model, options)?;
    Ok((model, is_person))
}

/// The same, nothing changed yet.
pub(super) fn read(name: &str, options: &ModelChanges) -> Result<(Model, bool), Failure> {
    let lengths_m = options
        .segment
        .iter()
        .map(|words| {
            let (name, value) = words.split_once('=')?;
            Some((name.to_owned(), value.trim().parse().ok()?))
        })
        .collect::<Option<Vec<_>>>()
        .ok_or_else(|| Failure::input("--segment stands as NAME=METRES, for example thigh=0.44"))?;
    let sex = match options.sex {
        SexWord::Female => Sex::Female,
        SexWord::Male => Sex::Male,
    };
    let person = Person { height_m: options.height_m, mass_kg: options.mass_kg, sex, lengths_m };
    let (model, is_person) = rigident::named_model::open(name, &person).map_err(Failure::input)?;
    if !is_person {
        refuse_a_person(options)?;
    }
    Ok((model, is_person))
}

/// Refuses options that say whose body a person's is, where there is none.
pub(super) fn refuse_a_person(options: &ModelChanges) -> Result<(), Failure> {
    if options.describe_a_person() {
        return Err(Failure::input(
            "--height-m, --mass-kg, --sex and --segment describe human34 and human58; the model given is neither",
        ));
    }
    Ok(())
}

/// The joints of `--spherical J1,J2,J3`.
pub(super) fn three(words: &str) -> Result<[String; 3], Failure> {
    let joints: Vec<String> = words.split(',').map(|j| j.trim().to_owned()).collect();
    joints
        .try_into()
        .map_err(|_| Failure::input(format!("--spherical {words}: names three joints, J1,J2,J3")))
}

/// Applies the options that change a model.
pub(super) fn change(model: &mut Model, options: &ModelChanges) -> Result<(), Failure> {
    model.lock(&options.lock).map_err(Failure::input)?;
    for words in &options.spherical {
        model.declare_spherical(&three(words)?).map_err(Failure::input)?;
    }
    for words in &options.tool {
        model.hold_tool(words).map_err(Failure::input)?;
    }
    Ok(())
}

fn check(arguments: &ModelCheck) -> Result<ExitCode, Failure> {
    let name = &arguments.model;
    let (model, text) = rigident::named_model::read(name, &Person::default()).map_err(Failure::input)?;
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

fn base_params(arguments: &BaseParams) -> Result<ExitCode, Failure> {
    let (model, is_person) = open(&arguments.model.model, &arguments.model.changes)?;
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
        "{}: {} bodies, {} degrees of freedom in joints ({}){}; {}\n{} base parameters of {} standard ones\nsingular values, \
         of random motions over the largest column: smallest kept {:.1e}, dropped ones below {:.1e}; rules and random \
         motions agree to {:.0e}\n",
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
