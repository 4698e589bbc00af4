//! `rigident vibration postures`: what locked postures tell of a tree.

use std::process::ExitCode;

use serde::Serialize;

use super::factor::absent;
use super::outcome::say;
use super::vibration_arguments::Postures;
use super::{ExitStatus, Failure, Stages};
use rigident::application::bare_platform::take_platform_off;
use rigident::application::recorded::is_recording;
use rigident::fit::figures::{NOT_IDENTIFIED, significant, unit_symbol, with_u95};
use rigident::present::posture_sets::{Bar, figure};
use rigident::rows::named_model::rig_links;
use rigident::vibration::suspension::posture_checks::contradiction;
use rigident::vibration::suspension::posture_file::PosturesFile;
use rigident::vibration::suspension::posture_sets::{NextPosture, Subset, next, sets, shares, turn_deg};
use rigident::vibration::suspension::postures::PostureSource;
use rigident::vibration::suspension::recorded_postures::{self, RecordedPosture};
use rigident::vibration::suspension::settled::settled;
use rigident::vibration::suspension::support::Support;
use rigident_fit::Fit;
use rigident_fit::pool::PooledFactor;
use rigident_io::recording::Recording;
use rigident_io::recording::new_file::write_new_text;

/// The object of `--json`.
#[derive(Serialize)]
struct Object {
    schema: &'static str,
    parameters: usize,
    told: usize,
    sigma_stated: bool,
    /// The origin of the uncertainty, in words.
    #[serde(skip)]
    from: &'static str,
    subset: Vec<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    open: Option<Bounds>,
    sets: Vec<Set>,
    /// The share of the errors of each posture in the variance of what is determined, on average.
    shares: Vec<PostureShare>,
    #[serde(skip_serializing_if = "Option::is_none")]
    next: Option<Next>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Value {
    name: String,
    unit: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    u95: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reference: Option<f64>,
}

#[derive(Serialize)]
struct Bounds {
    name: String,
    least: f64,
    most: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    most_of_leaf: Option<f64>,
}

#[derive(Serialize)]
struct Set {
    postures: Vec<String>,
    rank: usize,
    condition: f64,
}

#[derive(Serialize)]
struct PostureShare {
    posture: String,
    share: f64,
}

#[derive(Serialize)]
struct Next {
    joints: Vec<Stand>,
    rank: usize,
    condition: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    gain: Option<f64>,
}

#[derive(Serialize)]
struct Stand {
    link: String,
    stands: Vec<f64>,
}

/// `rigident vibration postures`
pub(super) fn run(arguments: &Postures) -> Result<ExitCode, Failure> {
    for path in arguments.factor.iter().chain(&arguments.plot) {
        absent(path)?;
    }
    let recorded = arguments.files.len() > 1 || arguments.files.iter().any(|file| is_recording(file));
    let (object, pooled) = if recorded { recordings(arguments)? } else { of_file(arguments)? };
    if let Some(path) = &arguments.factor {
        pooled.write(path).map_err(Failure::input)?;
    }
    if let Some(path) = &arguments.plot {
        let bar = |set: &Set| Bar { name: set.postures.join(", "), rank: set.rank, condition: set.condition };
        let figure = figure(&object.sets.iter().map(bar).collect::<Vec<_>>());
        write_new_text(path, &figure).map_err(Failure::input)?;
    }
    if arguments.json {
        let json = serde_json::to_string_pretty(&object)
            .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
        say(json);
    } else {
        say(words(&object).trim_end());
        object.warnings.iter().for_each(|warning| tell!("rigident: {warning}"));
    }
    Ok(ExitStatus::of(object.subset.iter().all(|value| value.value.is_some())).into())
}

/// Returns what a file of postures tells, and its factor.
fn of_file(arguments: &Postures) -> Result<(Object, PooledFactor), Failure> {
    let Some(path) = arguments.files.first() else { return Err(Failure::input("no file is given")) };
    if arguments.rig.is_some() {
        return Err(Failure::input("--rig: a file of postures has the links itself"));
    }
    let what = path.display().to_string();
    let text = rigident_files::read_text(path)
        .map_err(|e| Failure::input(format!("{what}: cannot be read: {e}")))?;
    let file: PosturesFile = toml::from_str(&text).map_err(|e| Failure::input(format!("{what}: {e}")))?;
    let source = PostureSource::new(&file, &what).map_err(Failure::input)?;
    let pooled = source.pooled();
    let object = object(&file, &source, &pooled.fit());
    let from = if source.sigma_given() { "what the file states" } else { "the scatter of the postures" };
    Ok((Object { from, ..object }, pooled))
}

/// Returns what recordings of locked postures tell, and their factor, the platform on it.
fn recordings(arguments: &Postures) -> Result<(Object, PooledFactor), Failure> {
    let stages = Stages::new("reading the recordings");
    let Some(first) = arguments.files.first() else { return Err(Failure::input("no file is given")) };
    let mut all = Vec::new();
    for path in &arguments.files {
        let rig = arguments.rig.as_deref();
        all.push(Recording::load(path, rig).map_err(Failure::input)?);
    }
    let rig = all.first().map(|recording| recording.rig.clone()).unwrap_or_default();
    if let Some(other) =
        all.iter().find(|own| own.rig.suspension != rig.suspension || own.rig.link != rig.link)
    {
        return Err(Failure::input(format!(
            "{}: its [suspension] or its [[link]] tables are not those of {}: give one rig file for all by --rig",
            other.name,
            first.display()
        )));
    }
    let model =
        rig_links::from_tables(&rig.link, &first.display().to_string()).map_err(Failure::input)?.welded();
    let support = Support::of(&rig, &first.display().to_string()).map_err(Failure::input)?;
    let table = rig.suspension.clone().unwrap_or_default();
    let (mut postures, mut findings) = (Vec::new(), Vec::new());
    for (k, recording) in all.iter().enumerate() {
        stages.at(&format!("modes of {}", recording.name), k as f64 / all.len() as f64);
        let own = RecordedPosture::of(recording, &model, &support).map_err(Failure::input)?;
        findings.extend(own.findings.iter().map(|what| format!("{}: {what}", own.name)));
        postures.push(own);
    }
    let name = postures.iter().map(|own| own.name.as_str()).collect::<Vec<_>>().join(" + ");
    let (source, mut together) =
        recorded_postures::source(&model, &support, &postures, &name).map_err(Failure::input)?;
    let pooled = PooledFactor::of(&together, &name);
    take_platform_off(&table, &mut together).map_err(Failure::input)?;
    let mut object = object(&PosturesFile::default(), &source, &together);
    object.warnings.extend(findings);
    object.warnings.extend(settled(&table, &support, &postures));
    Ok((Object { from: "the modes and the springs", ..object }, pooled))
}

fn object(file: &PosturesFile, source: &PostureSource, fit: &Fit) -> Object {
    let subset = Subset::new(source.parameters(), source.model());
    let values = subset.values(fit);
    let leaf = source.model().links.get(1).and_then(|link| file.link_mass_kg.get(&link.name)).copied();
    let name = |k: &usize| source.names().get(*k).cloned().unwrap_or_default();
    let all = sets(source);
    let open: Vec<&str> = values.iter().filter(|v| v.measured.is_none()).map(|v| v.name.as_str()).collect();
    let mut warnings: Vec<String> = contradiction(source).into_iter().collect();
    if !open.is_empty() {
        warnings.push(format!(
            "not told by these postures: {}; take the next one that is proposed",
            open.join(", ")
        ));
    }
    // A posture without which the rank is the same adds none.
    let n = source.names().len();
    let whole = all.iter().find(|set| set.postures.len() == n).map_or(0, |set| set.rank);
    for k in (0..n).filter(|_| n > 1) {
        let without: Vec<usize> = (0..n).filter(|j| *j != k).collect();
        let fuller = all.iter().find(|set| set.postures == without);
        if whole < source.parameters().len()
            && fuller.is_some_and(|set| set.rank == whole)
            && !complete(&values)
        {
            warnings.push(format!("{} adds no rank: turn the joints elsewhere", name(&k)));
        }
    }
    let of_next = |posture: NextPosture| Next {
        joints: posture.stands.into_iter().map(|(link, stands)| Stand { link, stands }).collect(),
        rank: posture.rank,
        condition: posture.condition,
        gain: posture.gain,
    };
    Object {
        schema: "rigident/postures/1",
        parameters: source.parameters().len(),
        told: whole,
        sigma_stated: source.sigma_given(),
        from: "",
        open: subset.bounds(fit, leaf).map(|b| Bounds {
            name: b.name,
            least: b.least,
            most: b.most,
            most_of_leaf: b.most_of_leaf,
        }),
        subset: values
            .into_iter()
            .map(|v| Value {
                reference: file.reference.get(&v.name).copied(),
                value: v.measured.map(|m| m.value),
                u95: v.measured.map(|m| m.u95),
                name: v.name,
                unit: v.unit,
            })
            .collect(),
        sets: all
            .into_iter()
            .map(|set| Set {
                postures: set.postures.iter().map(name).collect(),
                rank: set.rank,
                condition: set.condition,
            })
            .collect(),
        shares: shares(source, &subset)
            .into_iter()
            .enumerate()
            .map(|(k, share)| PostureShare { posture: name(&k), share })
            .collect(),
        next: next(source).map(of_next),
        warnings,
    }
}

fn complete(values: &[rigident::vibration::suspension::posture_sets::SubsetValue]) -> bool {
    values.iter().all(|value| value.measured.is_some())
}

fn words(object: &Object) -> String {
    let with_reference = object.subset.iter().any(|v| v.reference.is_some());
    let mut out = format!(
        "{} of {} base parameters' directions are told; uncertainty from {}\n\n  {:<14} {:>24} {:>8}{}\n",
        object.told,
        object.parameters,
        object.from,
        "",
        "value ± U95",
        "",
        if with_reference { "   reference  difference" } else { "" }
    );
    for value in &object.subset {
        let cell = value.value.zip(value.u95);
        let cell = cell.map_or_else(|| NOT_IDENTIFIED.to_owned(), |(v, u)| with_u95(v, u, ""));
        out.push_str(&format!("  {:<14} {cell:>24} {:<8}", value.name, unit_symbol(&value.unit)));
        if let Some((reference, own)) = value.reference.zip(value.value) {
            out.push_str(&format!(" {reference:>11.4} {:>11.4}", own - reference));
        }
        out.push('\n');
    }
    if let Some(open) = &object.open {
        out.push_str(&format!(
            "\n{} is left open: {} < {} < {:.4} kg m²",
            open.name,
            significant(open.least, 4),
            open.name,
            open.most
        ));
        if let Some(most) = open.most_of_leaf {
            out.push_str(&format!("; < {most:.4} as the mass of the other link is known"));
        }
        out.push('\n');
    }
    out.push_str("\nSets of postures                                     rank   condition\n");
    for set in &object.sets {
        out.push_str(&format!(
            "  {:<50} {:>4} {:>11}\n",
            set.postures.join(", "),
            set.rank,
            significant(set.condition, 3)
        ));
    }
    let shares: Vec<String> =
        object.shares.iter().map(|s| format!("{} {:.0} %", s.posture, 100.0 * s.share)).collect();
    if shares.len() > 1 {
        out.push_str(&format!("\nOf the variance, on average, come from {}\n", shares.join(", ")));
    }
    if let Some(next) = &object.next {
        out.push_str("\nTake next: ");
        let stands: Vec<String> = next.joints.iter().map(stand_words).collect();
        out.push_str(&stands.join("; "));
        out.push_str(&format!(
            "\n  rank {}, condition {}{}\n",
            next.rank,
            significant(next.condition, 3),
            next.gain.map_or_else(String::new, |gain| format!(
                ", mean uncertainty {:.0} % of what it is",
                100.0 * gain
            ))
        ));
    }
    out
}

fn stand_words(stand: &Stand) -> String {
    match turn_deg(&stand.stands) {
        Some((axis, angle)) => format!(
            "{} turned by {angle:.0}° about ({:.2}, {:.2}, {:.2}), quaternion {:.3?}",
            stand.link, axis.x, axis.y, axis.z, stand.stands
        ),
        None => format!("{} at {:.3?}", stand.link, stand.stands),
    }
}
