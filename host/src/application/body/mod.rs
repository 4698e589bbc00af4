//! From trials to a person's segments.

mod fewer_freedoms;
mod on_device;
mod pages;
mod plates;

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::{BodyError, BodyOption, Caller, Covariance, Error, Notice};
use fewer_freedoms::beside_human34;
pub use on_device::compared;
pub use pages::measured;
use pages::pages;
use plates::doubtful_plates;
use rigident_fit::{Fit, FitOptions, Measured, Progress};
use rigident_identify::answer::person::{DeviceResult, PersonResult};
use rigident_identify::answer::standard_parameters::Full;
use rigident_identify::answer::{Answer, Context, Finding, Links, Source, StandardRequest};
use rigident_io::motion_capture::opensim::model::OsimModel;
use rigident_io::motion_capture::trial::Trial;
use rigident_io::recording::extension;
use rigident_io::recording::new_file::write_new_text;
use rigident_model::human::Sex;
use rigident_model::write;
use rigident_people::body_segments::choice::{Way, choices};
use rigident_people::body_segments::left_out::left_out;
use rigident_people::body_segments::opensim::in_opensim;
use rigident_people::body_segments::report::{person_result, worse_than_table};
use rigident_people::body_segments::tool::{Compared, holding};
use rigident_people::body_segments::{Parts, PlateScale, Study, StudyError, StudyOptions};
use rigident_people::inverse_kinematics::marker_file::MarkerFile;
use rigident_people::inverse_kinematics::subject::HumanModel;
use rigident_people::person::anthropometry::GivenMass;
use rigident_people::person::track::{SHOWN_S, TrackOptions};
use rigident_people::person::{PeopleOptions, Person};
use rigident_present::{self, Series};

/// The uncertainty of a mass that is given, relative (1 σ): scales, clothes and markers.
const SCALES: f64 = 0.005;
/// The mass that is given and that of the plates may differ by this share.
const LARGEST_DIFFERENCE: f64 = 0.05;

/// The way a person is identified.
#[derive(Clone, Debug)]
pub struct BodyOptions {
    /// A trial in a known standing pose.
    pub standing: Option<PathBuf>,
    /// Forces of the ground of TRC trials, in their order. Default: the file beside each.
    pub ground: Vec<PathBuf>,
    /// The meaning of markers whose names say nothing.
    pub markers: Option<PathBuf>,
    /// The person's scaled OpenSim model.
    pub osim: Option<PathBuf>,
    /// The model.
    pub model: HumanModel,
    /// Mass, kg; `None`: from the plates.
    pub mass_kg: Option<f64>,
    /// Stature, m; `None`: from the markers.
    pub height_m: Option<f64>,
    /// The sex whose means the table has.
    pub table: Sex,
    /// Segments whose masses are known otherwise.
    pub given: Vec<GivenMass>,
    /// Standard deviation (1 σ) of the plates' common scale, and of each one's own, relative.
    pub plate_scale: f64,
    /// Cut-off of the markers' low-pass, Hz; `None`: by their noise.
    pub cut_off_hz: Option<f64>,
    /// Delay of the forces behind the markers, s; `None`: as found.
    pub delay_s: Option<f64>,
    /// Plates were reset right before each trial.
    pub plates_zeroed: bool,
    /// The way trials are cut into motions.
    pub parts: Parts,
    /// The number of motions used, and the way they are chosen; `None`: all.
    pub motions: Option<(usize, Way)>,
    /// The uncertainty of the table: 1 σ, relative.
    pub nominal_sigma: f64,
    /// Right segments mirror left ones.
    pub symmetric: bool,
    /// The tool that the person holds.
    pub tool: Option<HeldTool>,
    /// The file that the model is to be written to: [`IdentifiedPerson::write_model`] does.
    pub write_model: Option<PathBuf>,
}

impl Default for BodyOptions {
    fn default() -> Self {
        Self {
            standing: None,
            ground: Vec::new(),
            markers: None,
            osim: None,
            model: HumanModel::Human34,
            mass_kg: None,
            height_m: None,
            table: Sex::Unknown,
            given: Vec::new(),
            plate_scale: 0.01,
            cut_off_hz: None,
            delay_s: None,
            plates_zeroed: false,
            parts: Parts::Equal(4),
            motions: None,
            nominal_sigma: 0.3,
            symmetric: false,
            tool: None,
            write_model: None,
        }
    }
}

/// A tool that a person holds in the trials, and not in others.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldTool {
    /// The name of the tool.
    pub name: String,
    /// The link that holds it.
    pub link: String,
    /// Trials without it.
    pub without: Vec<PathBuf>,
}

/// The values that a caller computes beside the answer, such as the firmware's.
pub trait Beside {
    /// Refuses a person before anything is computed.
    ///
    /// # Errors
    /// [`BodyError::Beside`] says why.
    fn check(&self, person: &Person) -> Result<(), Error>;

    /// Returns what was computed of the chosen motions, beside their fit, and what to warn of.
    ///
    /// # Errors
    /// [`BodyError::Beside`] says why there is nothing.
    fn compute(
        &self,
        whose: (&Person, &Study),
        chosen: &[usize],
        fit: &Fit,
    ) -> Result<(DeviceResult, Vec<String>), Error>;
}

/// An identified person.
pub struct IdentifiedPerson {
    /// The answer.
    pub answer: Answer,
    /// The person with her trials.
    pub person: Person,
    /// The motions with a factor each.
    pub study: Study,
    /// Pages that play the trials, HTML, with their files' names.
    pub pages: Vec<(String, String)>,
    fit: Fit,
    full: Full,
    osim: Option<Osim>,
}

/// Why no model is written of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoModel {
    /// The recording cannot be true.
    Contradicted,
    /// The motion identifies no segments.
    NoSegments,
}

impl fmt::Display for NoModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Contradicted => "the recording cannot be true",
            Self::NoSegments => "the motion identifies no segments",
        })
    }
}

impl IdentifiedPerson {
    /// Returns the page of the answer, HTML.
    pub fn page(&self) -> String {
        rigident_present::report(&self.answer, &Series::new(&self.fit, &self.answer, false, 0.0))
    }

    /// Returns the covariance of the numbers of the answer.
    pub fn covariance(&self) -> Covariance {
        Covariance::of(&self.answer, &self.fit)
    }

    /// Returns the factors of the motions, with their files' names.
    pub fn factors(&self) -> impl Iterator<Item = (String, Vec<u8>)> {
        self.study.motions.iter().map(|motion| {
            let name = format!("{}.factor", motion.name.replace(['/', '\\', ',', ' '], "_"));
            (name, motion.pooled.to_bytes())
        })
    }

    /// Returns why there is no model to write, if there is none.
    pub fn no_model(&self) -> Option<NoModel> {
        match (self.answer.is_contradicted(), self.study.tells_segments()) {
            (true, _) => Some(NoModel::Contradicted),
            (_, false) => Some(NoModel::NoSegments),
            _ => None,
        }
    }

    /// Writes the person's model with her segments, or OpenSim's by the file's ending.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_model(&self, path: &Path) -> Result<(), Error> {
        let found = self.full.links.iter().map(|link| (link.name.as_str(), link.parameters));
        let model = &self.person.subject.model;
        match self.osim.as_ref().filter(|_| is_osim(path)) {
            None => Ok(write::write(&write::with_parameters(model, found), None, path)?),
            Some(osim) => {
                let bodies = in_opensim(&osim.model, model, &found.collect::<Vec<_>>())?;
                Ok(write_new_text(path, &osim.model.written(&osim.text, &bodies)?)?)
            }
        }
    }
}

/// An OpenSim model, with the text it was read from.
struct Osim {
    text: String,
    model: OsimModel,
}

impl Osim {
    fn read(path: &Path) -> Result<Self, Error> {
        let failed = |why: String| BodyError::Osim { path: path.to_owned(), why };
        let text =
            rigident_files::read_text(path).map_err(|error| failed(format!("it cannot be read: {error}")))?;
        let model = OsimModel::parse(&text).map_err(|error| failed(error.to_string()))?;
        Ok(Self { text, model })
    }
}

/// Identifies a person's segments from trials, each a C3D file with force plates, or a TRC file with the
/// ground's forces.
///
/// `beside` computes something beside the answer.
///
/// # Errors
/// [`Error::Body`] if trials make no person, or options do not fit them; the caller stops the job.
pub fn body(
    trials: &[PathBuf],
    options: &BodyOptions,
    beside: Option<&dyn Beside>,
    caller: &Caller<'_>,
) -> Result<IdentifiedPerson, Error> {
    caller.stoppable(|| identified(trials, options, beside, caller))
}

fn identified(
    paths: &[PathBuf],
    options: &BodyOptions,
    beside: Option<&dyn Beside>,
    caller: &Caller<'_>,
) -> Result<IdentifiedPerson, Error> {
    let started = Instant::now();
    check(options)?;
    caller.stage("reading the trials", 0.0);
    let mut trials = read_trials(paths, options)?;
    let standing = options.standing.as_deref().map(|path| Trial::read(path, None)).transpose()?;
    let osim = options.osim.as_deref().map(Osim::read).transpose()?;
    let holding_first = if options.tool.is_some() { paths.len() } else { 0 };
    let people = PeopleOptions { holding_first, ..people(options, osim.as_ref())? };
    let progress = |stage: &str, share: f64| caller.stage(stage, share);
    let person = Person::new(&mut trials, standing.as_ref(), &people, &progress).map_err(StudyError::from)?;
    beside.map_or(Ok(()), |beside| beside.check(&person))?;
    if let Some(osim) = osim.as_ref().filter(|_| options.write_model.as_deref().is_some_and(is_osim)) {
        // What cannot be written is said before anything is computed.
        let model = &person.subject.model;
        let table: Vec<_> = model.links.iter().filter_map(|l| Some((l.name.as_str(), l.nominal?))).collect();
        in_opensim(&osim.model, model, &table)?;
    }
    let study_options = study_options(options);
    let own: Vec<usize> = (0..paths.len()).collect();
    let bare: Vec<usize> = (own.len()..trials.len()).collect();
    let fit_options = FitOptions::default();
    // The person is that of the trials in which she holds nothing.
    let hers = if options.tool.is_some() { &bare } else { &own };
    let mut study = Study::new(&person, hers, &study_options, &fit_options, &progress)?;
    study.draw(&person, &trials, &progress)?;
    let tool = match &options.tool {
        Some(held) if person.fixed.contains(&held.link) => {
            return Err(BodyError::ToolLink(held.link.clone()).into());
        }
        Some(held) => {
            let link = Some(holding(&person, &held.link)?);
            let with = Study::holding(&person, &own, &study_options, &fit_options, &progress, link)?;
            let both = Compared { person: &person, trials: &trials, with: &with, without: &study };
            let shown = |share: f64| caller.stage("the tool's uncertainty", share);
            Some(both.tool(&held.link, &held.name, &shown)?)
        }
        None => None,
    };
    caller.stage("segments", 0.0);
    let (chosen, choices) = match options.motions {
        None => ((0..study.motions.len()).collect(), Vec::new()),
        Some((count, way)) => choices(&study, way, count)?,
    };
    let fit = study.together(&chosen)?;
    let found = study.segments(&person, &fit, &chosen)?;
    let fit = study.with_calibration(fit, &chosen);
    let device = beside.map(|beside| beside.compute((&person, &study), &chosen, &fit)).transpose()?;
    let (device, warnings) = device.unzip();
    let mut findings: Vec<Finding> = warnings.into_iter().flatten().map(Finding::warning).collect();
    findings.extend(contradictions(options.mass_kg, (&person, &study), caller)?);
    findings.extend(doubtful_plates(&person, &study)?);
    let answer = answer(options, (&person, &study), &fit, findings)?;
    caller.stage("left-out motions", 0.0);
    let left_out = left_out(&study, &person, SHOWN_S)?;
    let result = person_result(&study, &person, &fit, &found, &answer, &left_out.channels)?;
    let withheld = worse_than_table(&left_out.channels).filter(|_| !result.segments.is_empty());
    let mut answer = answer.with_person(PersonResult { choices, device, tool, ..result });
    answer.notes.extend(withheld);
    answer.notes.extend(beside_human34(paths, options, &left_out.channels, caller));
    answer.elapsed_s = started.elapsed().as_secs_f64();
    let pages = pages(&person, &study, &trials, &left_out);
    Ok(IdentifiedPerson { answer, person, study, pages, fit, full: found.full, osim })
}

fn study_options(options: &BodyOptions) -> StudyOptions {
    StudyOptions {
        symmetric: options.symmetric,
        parts: options.parts,
        mass_kg: options.mass_kg.map(|kg| [kg, SCALES * kg]),
        plates: PlateScale { common: options.plate_scale, own: options.plate_scale },
        ..StudyOptions::default()
    }
}

fn people(options: &BodyOptions, osim: Option<&Osim>) -> Result<PeopleOptions, Error> {
    Ok(PeopleOptions {
        lengths_m: osim.map_or_else(Vec::new, |osim| osim.model.lengths()),
        kind: options.model,
        height_m: options.height_m,
        mass_kg: options.mass_kg,
        sex: options.table,
        symmetric: options.symmetric,
        own_markers: own_markers(options.markers.as_deref())?,
        given: options.given.clone(),
        plates_zeroed: options.plates_zeroed,
        track: TrackOptions { cut_off_hz: options.cut_off_hz, delay_s: options.delay_s, holds: false },
        holding_first: 0,
    })
}

/// Refuses options that cannot be.
fn check(options: &BodyOptions) -> Result<(), Error> {
    let refuse = |option: BodyOption, value: f64, wanted: &'static str| {
        Err(Error::from(BodyError::Number { option, value: value.to_string(), wanted }))
    };
    for (option, value) in [
        (BodyOption::Mass, options.mass_kg),
        (BodyOption::Height, options.height_m),
        (BodyOption::CutOff, options.cut_off_hz),
        (BodyOption::NominalSigma, Some(options.nominal_sigma)),
    ] {
        if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
            return refuse(option, value, "must be finite and greater than zero");
        }
    }
    if !(0.0..=0.2).contains(&options.plate_scale) {
        return refuse(BodyOption::PlateScale, 1e2 * options.plate_scale, "give 0 to 20");
    }
    if let Some(delay) = options.delay_s.filter(|d| !d.is_finite() || d.abs() > 1.0) {
        return refuse(BodyOption::Delay, delay, "give seconds, at most one");
    }
    if options.motions.is_some_and(|(count, _)| count == 0) {
        return refuse(BodyOption::Motions, 0.0, "give a number of at least one");
    }
    match &options.write_model {
        None => Ok(()),
        Some(path) if !is_osim(path) => Ok(write::check_target(path).map(|_| ())?),
        Some(path) if options.osim.is_none() => Err(BodyError::WithoutOsim(path.clone()).into()),
        Some(path) => Ok(write::check_new(path)?),
    }
}

fn is_osim(path: &Path) -> bool {
    extension(path) == "osim"
}

/// Reads the file of markers whose names say nothing.
fn own_markers(path: Option<&Path>) -> Result<MarkerFile, Error> {
    let Some(path) = path else { return Ok(MarkerFile::default()) };
    let text = rigident_files::read_text(path)
        .map_err(|error| Error::Unreadable { path: path.to_owned(), why: error.to_string() })?;
    MarkerFile::parse(&text).map_err(|why| Error::Unusable { path: path.to_owned(), why })
}

/// Reads the trials, those without a tool last, each TRC file with the ground's forces that were named for
/// it.
fn read_trials(paths: &[PathBuf], options: &BodyOptions) -> Result<Vec<Trial>, Error> {
    let mut ground = options.ground.iter();
    let mut trials: Vec<Trial> = Vec::new();
    let without = options.tool.iter().flat_map(|tool| &tool.without);
    for path in paths.iter().chain(without) {
        let own = if extension(path) == "trc" { ground.next() } else { None };
        let mut trial = Trial::read(path, own.map(PathBuf::as_path))?;
        let same = trials
            .iter()
            .filter(|t| t.name == trial.name || t.name.starts_with(&format!("{} (", trial.name)));
        match same.count() {
            0 => {}
            n => trial.name = format!("{} ({})", trial.name, n + 1),
        }
        trials.push(trial);
    }
    match ground.next() {
        None => Ok(trials),
        Some(left) => Err(BodyError::GroundWithoutTrial(left.clone()).into()),
    }
}

fn answer(
    options: &BodyOptions,
    (person, study): (&Person, &Study),
    fit: &Fit,
    findings: Vec<Finding>,
) -> Result<Answer, Error> {
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
            trust: options.nominal_sigma,
            symmetric: options.symmetric,
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
    Ok(Answer::new(fit, context)?)
}

/// Says which markers have names that say nothing.
fn unknown_markers(person: &Person) -> Option<String> {
    let unknown = &person.subject.unknown;
    (!unknown.is_empty()).then(|| {
        format!("markers of unknown names were not used: {}", rigident_fit::figures::shortened(unknown, 8))
    })
}

/// Returns a mass that the plates contradict, and motions that differ in their mass.
fn contradictions(
    mass_kg: Option<f64>,
    (person, study): (&Person, &Study),
    caller: &Caller<'_>,
) -> Result<Vec<Finding>, Error> {
    let mut findings = Vec::new();
    let others = study.other_masses()?;
    for pair in study.contradicting_trials()? {
        let of = |(trial, mass): &(usize, Measured)| {
            let name = person.trials.get(*trial).map_or("", |tracked| &tracked.name);
            format!("{name} says {}", rigident_fit::figures::with_u95(mass.value, mass.u95, "kg"))
        };
        findings.push(Finding::contradiction(format!(
            "the whole masses of two trials contradict each other: {}, {}: is a plate's zero or scale wrong \
             in one of them, or was something carried?",
            of(&pair[0]),
            of(&pair[1])
        )));
    }
    for (k, own) in others {
        let name = study.motions.get(k).map_or("", |motion| &motion.name);
        findings.push(Finding::contradiction(format!(
            "{name}: the whole mass is {}, other than in all motions together: something was carried, put \
             down or leaned on; identify such trials by themselves",
            rigident_fit::figures::with_u95(own.value, own.u95, "kg")
        )));
    }
    let Some(given) = mass_kg else { return Ok(findings) };
    if let Some(found) = study.mass_by_plates()? {
        let off = (given - found.value).abs();
        if off > found.u95 && off > LARGEST_DIFFERENCE * found.value {
            let plates = rigident_fit::figures::with_u95(found.value, found.u95, "kg");
            let words = caller.words(&Notice::MassContradicted { given_kg: given.to_string(), plates });
            findings.push(Finding::contradiction(words));
        }
    }
    Ok(findings)
}
