//! `rigident body`: a person's segments from markers and force plates.

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use super::body_arguments::{Body, BodyCommand, IdentifyBody};
use super::body_device::compared;
use super::body_page::pages;
use super::body_plates::doubtful_plates;
use super::outcome::{CANNOT_BE_TRUE, say, say_not_written};
use super::{ExitStatus, Failure, Folder, Stages};
use rigident::answer::person::PersonResult;
use rigident::answer::standard_parameters::Full;
use rigident::answer::{Answer, Context, Finding, Links, Source, StandardRequest, Status};
use rigident::body_segments::choice::choices;
use rigident::body_segments::left_out::left_out;
use rigident::body_segments::opensim::in_opensim;
use rigident::body_segments::report::person_result;
use rigident::body_segments::tool::tool;
use rigident::body_segments::{PlateScale, Study, StudyOptions};
use rigident::device::session::tree::{DeviceTreeError, device_tree};
use rigident::inverse_kinematics::marker_file::MarkerFile;
use rigident::present::{self, Series};
use rigident::problem::person::track::{SHOWN_S, TrackOptions};
use rigident::problem::person::{PeopleOptions, Person};
use rigident_fit::{Fit, FitOptions, Measured};
use rigident_io::motion_capture::opensim::model::OsimModel;
use rigident_io::motion_capture::trial::Trial;
use rigident_io::recording::new_file::write_new_text;
use rigident_model::write;

/// How well a mass that is given is known, relative (1 σ): scales, clothes and markers.
const SCALES: f64 = 0.005;
/// The mass that is given and that of the plates may differ by this share.
const LARGEST_DIFFERENCE: f64 = 0.05;

/// `rigident body`
pub(super) fn run(body: &Body) -> Result<ExitCode, Failure> {
    match &body.command {
        BodyCommand::Identify(arguments) => identify(arguments),
    }
}

fn identify(arguments: &IdentifyBody) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    check(arguments)?;
    let stages = Stages::new("reading the trials");
    let mut trials = trials(arguments)?;
    let standing = arguments.standing.as_deref().map(|path| Trial::read(path, None)).transpose();
    let standing = standing.map_err(Failure::input)?;
    let osim = arguments.osim.as_deref().map(Osim::read).transpose()?;
    let options = PeopleOptions {
        lengths_m: osim.as_ref().map_or_else(Vec::new, |osim| osim.model.lengths()),
        kind: arguments.model.into(),
        height_m: arguments.height_m,
        mass_kg: arguments.mass_kg,
        sex: arguments.table.into(),
        symmetric: arguments.symmetric_sides,
        own_markers: own_markers(arguments)?,
        given: arguments.segment_mass.clone(),
        plates_zeroed: arguments.plates_zeroed,
        track: TrackOptions { cut_off_hz: arguments.cut_off_hz, delay_s: arguments.delay_s },
    };
    let person =
        Person::new(&mut trials, standing.as_ref(), &options, &|stage, share| stages.at(stage, share));
    let person = person.map_err(Failure::input)?;
    if arguments.mcu.is_some() {
        // What does not fit onto the device is told before anything is computed.
        let failed = |why: DeviceTreeError| {
            Failure::input(format!("--mcu: {why}; leave --mcu out, or take --model human34"))
        };
        device_tree(&person.subject.model).map_err(failed)?;
    }
    if let Some(osim) = osim.as_ref().filter(|_| arguments.write_model.as_deref().is_some_and(is_osim)) {
        // What cannot be written is told before anything is computed.
        let model = &person.subject.model;
        let table: Vec<_> = model.links.iter().filter_map(|l| Some((l.name.as_str(), l.nominal?))).collect();
        in_opensim(&osim.model, model, &table).map_err(Failure::input)?;
    }
    let scale = 1e-2 * arguments.plate_scale_percent;
    let study_options = StudyOptions {
        symmetric: arguments.symmetric_sides,
        parts: arguments.parts,
        mass_kg: arguments.mass_kg.map(|kg| [kg, SCALES * kg]),
        plates: PlateScale { common: scale, own: scale },
        ..StudyOptions::default()
    };
    let progress = |stage: &str, share: f64| stages.at(stage, share);
    let own: Vec<usize> = (0..arguments.trials.len()).collect();
    let bare: Vec<usize> = (own.len()..trials.len()).collect();
    let study_of = |which: &[usize]| {
        Study::new(&person, which, &study_options, &FitOptions::default(), &progress).map_err(Failure::input)
    };
    let mut study = study_of(&own)?;
    study.draw(&person, &trials, &progress).map_err(Failure::input)?;
    let tool = match &arguments.tool {
        Some(_) if person.fixed.contains(&arguments.tool_link) => {
            return Err(Failure::input(format!(
                "--tool-link {0}: no marker follows {0} in all trials, so that what it holds cannot be found: put markers on it, or name the \
                 link that has some",
                arguments.tool_link
            )));
        }
        Some(name) => {
            Some(tool(&study, &study_of(&bare)?, &arguments.tool_link, name).map_err(Failure::input)?)
        }
        None => None,
    };
    stages.at("segments", 0.0);
    let (chosen, choices) = match arguments.motions {
        None => ((0..study.motions.len()).collect(), Vec::new()),
        Some(count) => choices(&study, arguments.select.into(), count).map_err(Failure::input)?,
    };
    let fit = study.together(&chosen).map_err(Failure::input)?;
    let (full, covariance) = study.segments(&person, &fit, &chosen).map_err(Failure::input)?;
    let fit = study.with_calibration(fit, &chosen);
    let device =
        arguments.mcu.map(|mcu| compared(mcu, (&person, &study), &chosen, &fit, &stages)).transpose()?;
    let (device, warnings) = device.unzip();
    let mut findings: Vec<Finding> = warnings.into_iter().flatten().map(Finding::warning).collect();
    findings.extend(contradictions(arguments, (&person, &study))?);
    findings.extend(doubtful_plates(&person, &study)?);
    let answer = answer(arguments, &person, &study, &fit, findings)?;
    stages.at("left-out motions", 0.0);
    let left_out = left_out(&study, &person, SHOWN_S).map_err(Failure::input)?;
    let result = person_result(&study, &person, &fit, (&full, &covariance), &answer, &left_out.channels);
    let result = PersonResult { choices, device, tool, ..result.map_err(Failure::input)? };
    let mut answer = answer.with_person(result);
    answer.elapsed_s = started.elapsed().as_secs_f64();
    let pages = pages(&person, &study, &trials, &left_out);
    drop(stages);
    finish((arguments, osim.as_ref()), &person, &study, (&fit, &full), &answer, &pages)
}

/// An OpenSim model, with the text it was read from.
struct Osim {
    text: String,
    model: OsimModel,
}

impl Osim {
    fn read(path: &Path) -> Result<Self, Failure> {
        let failed = |why: String| Failure::input(format!("--osim {}: {why}", path.display()));
        let text =
            rigident_files::read_text(path).map_err(|error| failed(format!("it cannot be read: {error}")))?;
        let model = OsimModel::parse(&text).map_err(|error| failed(error.to_string()))?;
        Ok(Self { text, model })
    }
}

/// Refuses options that cannot be.
fn check(arguments: &IdentifyBody) -> Result<(), Failure> {
    let positive = |name: &str, value: Option<f64>| match value {
        Some(v) if !(v.is_finite() && v > 0.0) => {
            Err(Failure::input(format!("{name} {v}: must be finite and greater than zero")))
        }
        _ => Ok(()),
    };
    positive("--mass-kg", arguments.mass_kg)?;
    positive("--height-m", arguments.height_m)?;
    positive("--cut-off-hz", arguments.cut_off_hz)?;
    positive("--nominal-sigma", Some(arguments.nominal_sigma))?;
    if !(0.0..=20.0).contains(&arguments.plate_scale_percent) {
        return Err(Failure::input("--plate-scale-percent: give 0 to 20"));
    }
    if arguments.delay_s.is_some_and(|d| !d.is_finite() || d.abs() > 1.0) {
        return Err(Failure::input("--delay-s: give seconds, at most one"));
    }
    if arguments.motions == Some(0) {
        return Err(Failure::input("--motions 0: give a number of at least one"));
    }
    if let Some(path) = &arguments.write_model {
        match (is_osim(path), &arguments.osim) {
            (true, None) => {
                let why = "an OpenSim model is written into another one: name that with --osim FILE";
                return Err(Failure::input(format!("--write-model {}: {why}", path.display())));
            }
            (true, Some(_)) => write::check_new(path),
            (false, _) => write::check_target(path).map(|_| ()),
        }
        .map_err(Failure::input)?;
    }
    arguments.out.as_deref().map_or(Ok(()), Folder::check)
}

fn is_osim(path: &Path) -> bool {
    rigident_io::recording::extension(path) == "osim"
}

/// Reads the file of markers whose names say nothing.
fn own_markers(arguments: &IdentifyBody) -> Result<MarkerFile, Failure> {
    let Some(path) = &arguments.markers else { return Ok(MarkerFile::default()) };
    let text = rigident_files::read_text(path)
        .map_err(|error| Failure::input(format!("{} cannot be read: {error}", path.display())))?;
    MarkerFile::parse(&text).map_err(|error| Failure::input(format!("{}: {error}", path.display())))
}

/// Reads the trials, each TRC file with the ground's forces that were named for it.
fn trials(arguments: &IdentifyBody) -> Result<Vec<Trial>, Failure> {
    let mut ground = arguments.ground.iter();
    let mut trials: Vec<Trial> = Vec::new();
    for path in arguments.trials.iter().chain(&arguments.tare) {
        let is_trc = rigident_io::recording::extension(path) == "trc";
        let own = if is_trc { ground.next() } else { None };
        let mut trial = Trial::read(path, own.map(std::path::PathBuf::as_path)).map_err(Failure::input)?;
        let same = trials
            .iter()
            .filter(|t| t.name == trial.name || t.name.starts_with(&format!("{} (", trial.name)));
        match same.count() {
            0 => {}
            n => trial.name = format!("{} ({})", trial.name, n + 1),
        }
        trials.push(trial);
    }
    if let Some(left) = ground.next() {
        return Err(Failure::input(format!(
            "--ground {}: there is no TRC trial for it; C3D files have their plates inside",
            left.display()
        )));
    }
    Ok(trials)
}

fn answer(
    arguments: &IdentifyBody,
    person: &Person,
    study: &Study,
    fit: &Fit,
    findings: Vec<Finding>,
) -> Result<Answer, Failure> {
    let links = Links {
        model: &study.model,
        base: study.base(),
        situation: study.situation,
        drives: Vec::new(),
        as_stated: &[],
        idle: Vec::new(),
        beyond: Vec::new(),
        standard: Some(StandardRequest {
            nominal: &person.subject.model,
            trust: arguments.nominal_sigma,
            symmetric: arguments.symmetric_sides,
            required: true,
        }),
    };
    let names: Vec<&str> = person.trials.iter().map(|t| t.name.as_str()).collect();
    let mut notes = person.notes.clone();
    notes.extend(unknown_markers(person));
    let whole = study.table.names().first().cloned();
    let asked: Vec<String> = whole.into_iter().collect();
    let context = Context {
        links: Some(links),
        asked: &asked,
        source: Source {
            recording: names.join(" + "),
            rows: person.trials.iter().map(|t| t.frames.len() as u64).sum(),
            rate_hz: person.trials.first().map(|t| t.report.rate_hz),
            duration_s: Some(person.trials.iter().map(|t| t.frames.len() as f64 / t.report.rate_hz).sum()),
            mcu: "host".to_owned(),
            ..Source::default()
        },
        notes,
        warnings: study.left.iter().chain(&person.warnings).cloned().chain(study.misfit()).collect(),
        findings,
        ..Context::default()
    };
    Answer::new(fit, context).map_err(Failure::input)
}

/// Tells of markers whose names say nothing.
fn unknown_markers(person: &Person) -> Option<String> {
    let unknown = &person.subject.unknown;
    (!unknown.is_empty())
        .then(|| format!("markers of unknown names were not used: {}", present::text::shortened(unknown, 8)))
}

/// Returns a mass that the plates contradict, and motions that differ in their mass.
fn contradictions(
    arguments: &IdentifyBody,
    (person, study): (&Person, &Study),
) -> Result<Vec<Finding>, Failure> {
    let mut findings = Vec::new();
    let others = study.other_masses().map_err(Failure::input)?;
    for pair in study.contradicting_trials().map_err(Failure::input)? {
        let of = |(trial, mass): &(usize, Measured)| {
            let name = person.trials.get(*trial).map_or("", |tracked| &tracked.name);
            format!("{name} says {}", present::text::with_u95(mass.value, mass.u95, "kg"))
        };
        findings.push(Finding::contradiction(format!(
            "the whole masses of two trials contradict each other: {}, {}: is a plate's zero or scale wrong in one of them, or was \
             something carried?",
            of(&pair[0]),
            of(&pair[1])
        )));
    }
    for (k, own) in others {
        let name = study.motions.get(k).map_or("", |motion| &motion.name);
        findings.push(Finding::contradiction(format!(
            "{name}: the whole mass is {}, other than in all motions together: something was carried, put \
             down or leaned on; identify such trials by themselves",
            present::text::with_u95(own.value, own.u95, "kg")
        )));
    }
    let Some(given) = arguments.mass_kg else { return Ok(findings) };
    if let Some(found) = study.mass_by_plates().map_err(Failure::input)? {
        let off = (given - found.value).abs();
        if off > found.u95 && off > LARGEST_DIFFERENCE * found.value {
            findings.push(Finding::contradiction(format!(
                "--mass-kg {given} contradicts the plates, which say {}: weigh again, or leave it out",
                present::text::with_u95(found.value, found.u95, "kg")
            )));
        }
    }
    Ok(findings)
}

fn finish(
    (arguments, osim): (&IdentifyBody, Option<&Osim>),
    person: &Person,
    study: &Study,
    (fit, full): (&Fit, &Full),
    answer: &Answer,
    pages: &[(String, String)],
) -> Result<ExitCode, Failure> {
    let folder = Folder::new(arguments.out.as_deref(), "body")?;
    let json = serde_json::to_string_pretty(answer)
        .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
    if arguments.json {
        say(json.as_str());
    } else {
        say(present::person::whole_text(answer).trim_end());
    }
    folder.write("result.json", json.as_bytes())?;
    let series = Series::new(fit, answer, false, 0.0);
    let page = folder.write("report.html", present::report(answer, &series).as_bytes())?;
    for motion in &study.motions {
        let name = format!("{}.factor", motion.name.replace(['/', '\\', ',', ' '], "_"));
        folder.write(&name, &motion.pooled.to_bytes())?;
    }
    for (name, page) in pages {
        folder.write(name, page.as_bytes())?;
    }
    let asked = arguments.write_model.as_deref();
    let why_not = match (answer.is_contradicted(), study.tells_segments()) {
        (true, _) => Some(CANNOT_BE_TRUE),
        (_, false) => Some("the motion identifies no segments"),
        _ => None,
    };
    if let (Some(path), Some(why)) = (asked, why_not) {
        say_not_written(path, why);
    }
    let usable = asked.filter(|_| why_not.is_none());
    let written = usable.map(|path| write_model(person, full, osim, path)).transpose()?;
    if !arguments.json {
        let model = written.map_or_else(String::new, |path| format!("; the model is {path}"));
        say(format_args!(
            "\nFiles in {}; open {}, and {} to see the motion{model}.",
            folder.path().display(),
            page.display(),
            pages.first().map_or("motion.html", |(name, _)| name)
        ));
    }
    Ok(ExitStatus::of(answer.status == Status::Identified).into())
}

/// Writes the person's model with her segments, or OpenSim's.
fn write_model(person: &Person, full: &Full, osim: Option<&Osim>, path: &Path) -> Result<String, Failure> {
    let found = full.links.iter().map(|link| (link.name.as_str(), link.parameters));
    let model = &person.subject.model;
    match osim.filter(|_| is_osim(path)) {
        None => write::write(&write::with_parameters(model, found), None, path).map_err(Failure::input)?,
        Some(osim) => {
            let bodies =
                in_opensim(&osim.model, model, &found.collect::<Vec<_>>()).map_err(Failure::input)?;
            let text = osim.model.written(&osim.text, &bodies).map_err(Failure::input)?;
            write_new_text(path, &text).map_err(Failure::input)?;
        }
    }
    Ok(path.display().to_string())
}
