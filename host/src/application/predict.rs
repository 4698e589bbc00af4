//! The predictions of models for a recording, beside what was measured.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::{Caller, Error, Loaded, Tree, recorded};
use rigident_files::csv::field;
use rigident_fit::{Prediction, Progress, RowSource, plain_least_squares};
use rigident_identify::answer::Answer;
use rigident_identify::answer::predictor::Predictor;
use rigident_identify::answer::result::CompleteDrive;
use rigident_model::human::Person;
use rigident_model::{Model, ModelLink};
use rigident_present::prediction::{self, ChannelError, PredictedChannel, Predictions};
use rigident_rows::named_model;
use rigident_rows::tree::ProblemOptions;
use rigident_rows::tree::drive::{Friction, stated};

/// The way a recording is predicted.
#[derive(Clone, Debug, Default)]
pub struct PredictOptions {
    /// Rig file. Default: `NAME.rig.toml` beside the recording.
    pub rig: Option<PathBuf>,
    /// The tree that the recording is of. Default: the description among the models.
    pub tree: Tree,
    /// A recording that plain least squares are trained on, to be compared with.
    pub train: Option<PathBuf>,
    /// The recording has what is predicted, to be compared with; otherwise efforts that it lacks are
    /// predicted.
    pub needs_measured: bool,
}

/// The predictions of models for a recording.
#[derive(Clone, Debug)]
pub struct Predicted {
    /// Channels with what each model leaves of them.
    pub found: Predictions,
    /// Models' names and what they predict over time.
    pub columns: Vec<(String, Prediction)>,
}

impl Predicted {
    /// Returns the page, HTML.
    pub fn page(&self) -> String {
        prediction::page(&self.found, &self.columns)
    }

    /// Returns what is predicted over time as CSV: one row a filtered sample, cells empty where dry friction
    /// is unknown at rest.
    pub fn csv(&self) -> String {
        csv(&self.found, &self.columns)
    }
}

/// A model that was given.
enum Given {
    /// result.json
    Answer(Box<Answer>),
    /// A robot description.
    Model(Box<Model>),
}

impl Given {
    /// Returns the drives that it has parameters of.
    fn drives(&self) -> &[CompleteDrive] {
        match self {
            Self::Answer(answer) => answer.complete.as_ref().map_or(&[], |found| &found.drives),
            Self::Model(_) => &[],
        }
    }

    /// Returns the columns that a description has parameters of, by joints; locked ones have none.
    fn joints(&self, locked: &[String]) -> Vec<(String, Vec<&'static str>)> {
        let Self::Model(model) = self else { return Vec::new() };
        let is_locked = |name: &str| {
            locked
                .iter()
                .any(|words| words.split_once('=').map_or(words.as_str(), |(joint, _)| joint) == name)
        };
        let links = model.links.iter().skip(1).filter(|link| link.link.joint.freedoms() == 1);
        let of = |link: &ModelLink| {
            let terms = stated(&link.passive[0]).into_iter().filter(|(_, value)| *value != 0.0);
            let terms = terms.map(|(term, _)| term.name());
            (link.joint_name.clone(), terms.collect::<Vec<_>>())
        };
        let found = links.map(of).filter(|(_, terms)| !terms.is_empty());
        found.filter(|(joint, _)| !is_locked(joint)).collect()
    }
}

/// Predicts a recording by models, each the path of a result.json or of a robot description.
///
/// # Errors
/// Something cannot be read, or does not fit; the caller stops the job.
pub fn predict(
    models: &[PathBuf],
    recording: &Path,
    options: &PredictOptions,
    caller: &Caller<'_>,
) -> Result<Predicted, Error> {
    caller.stoppable(|| predicted(models, recording, options, caller))
}

fn predicted(
    models: &[PathBuf],
    recording: &Path,
    how: &PredictOptions,
    caller: &Caller<'_>,
) -> Result<Predicted, Error> {
    let recording = recorded::named(recording.to_owned());
    caller.stage(&format!("reading {}", recording.display()), 0.0);
    let given = models.iter().map(|path| read(path)).collect::<Result<Vec<_>, _>>()?;
    let mut tree = how.tree.clone();
    let description = given.iter().zip(models).find(|(given, _)| matches!(given, Given::Model(_)));
    if let (None, Some((_, path))) = (&tree.model, description) {
        tree.model = Some(path.display().to_string());
    }
    let columns_of = options(&given, &tree.changes.lock)?;
    let problem = ProblemOptions { without_efforts: !how.needs_measured, ..columns_of };
    let load = |path: &Path| Loaded::read(path, how.rig.as_deref(), None, &tree, &problem, caller);
    let loaded = load(&recording)?;
    let source = loaded.source();
    let nominal = loaded.nominal().map(|(model, _)| model);
    check_result_of_tree(&given, models, nominal)?;
    let mut predictors = Vec::new();
    if let Some(nominal) = nominal.filter(|model| how.needs_measured && has_bodies(model)) {
        predictors.push(("nominal".to_owned(), Predictor::of_model(nominal)));
    }
    for (given, name) in given.iter().zip(names(models)) {
        predictors.push(match given {
            Given::Answer(answer) => (name, Predictor::of_answer(answer)),
            Given::Model(model) => (name, Predictor::of_model(model)),
        });
    }
    caller.stage("prediction", 0.0);
    let mut columns = Vec::new();
    let mut notes = loaded.warnings.clone();
    notes.extend(loaded.notes.iter().cloned());
    for (name, predictor) in predictors {
        let (values, without) = predictor.values(source.parameters());
        if !without.is_empty() && name != "nominal" {
            notes.push(format!(
                "{name} says nothing of {}: they count as zero",
                rigident_fit::figures::shortened(&without, 6)
            ));
        }
        columns.push((name, Prediction::of(source, &values, predictor.errors())?));
    }
    if let Some(train) = &how.train {
        let train = load(&recorded::named(train.clone()))?;
        columns.push(("least squares".to_owned(), trained(&train, source, caller)?));
    }
    let has_measured =
        how.needs_measured || columns.iter().any(|(_, p)| p.measured_sd.iter().any(|sd| *sd > 0.0));
    let found = predictions(&loaded, source, &columns, has_measured, notes);
    Ok(Predicted { found, columns })
}

/// Returns what plain least squares on a recording predict of a source.
fn trained(train: &Loaded, source: &dyn RowSource, caller: &Caller<'_>) -> Result<Prediction, Error> {
    let values = plain_least_squares(train.source(), caller)?;
    let names = |source: &dyn RowSource| -> Vec<String> {
        source.parameters().iter().map(|p| p.name.clone()).collect()
    };
    if names(train.source()) != names(source) {
        return Err(Error::OtherParameters);
    }
    Ok(Prediction::of(source, &values, &[])?)
}

fn predictions(
    loaded: &Loaded,
    source: &dyn RowSource,
    columns: &[(String, Prediction)],
    has_measured: bool,
    notes: Vec<String>,
) -> Predictions {
    let channel = |(c, channel): (usize, &rigident_fit::Channel)| {
        let measured_sd = columns.first().and_then(|(_, p)| p.measured_sd.get(c)).copied();
        let error = |(name, prediction): &(String, Prediction)| {
            let rms = prediction.residual_rms.get(c).copied()?;
            let nrmse = measured_sd.map(|sd| rms / sd).filter(|share| share.is_finite());
            Some(ChannelError { model: name.clone(), rms, nrmse })
        };
        PredictedChannel {
            name: channel.name.clone(),
            unit: channel.unit.clone(),
            measured_sd: measured_sd.filter(|_| has_measured),
            models: if has_measured { columns.iter().filter_map(error).collect() } else { Vec::new() },
        }
    };
    Predictions {
        recording: loaded.origin("host").recording,
        normalised_by: "standard deviation of the measured channel behind the filter".to_owned(),
        models: columns.iter().map(|(name, _)| name.clone()).collect(),
        channels: source.channels().iter().enumerate().map(channel).collect(),
        notes,
    }
}

/// Returns what is predicted over time: one row a filtered sample, cells empty where dry friction is unknown
/// at rest.
fn csv(found: &Predictions, columns: &[(String, Prediction)]) -> String {
    let has_measured = found.channels.iter().any(|channel| channel.measured_sd.is_some());
    let unit = |channel: &PredictedChannel| channel.unit.replace(' ', "").to_lowercase();
    let mut out = "t_s".to_owned();
    for channel in &found.channels {
        if has_measured {
            let _ = write!(out, ",{}", field(&format!("{}_{}", channel.name, unit(channel))));
        }
        for model in &found.models {
            let column = format!("{}_{}_{}", channel.name, unit(channel), model.replace([' ', ','], "_"));
            let _ = write!(out, ",{}", field(&column));
        }
    }
    out.push('\n');
    let blocks = columns.first().map_or(0, |(_, p)| p.blocks.len());
    for k in 0..blocks {
        let of = |column: &(String, Prediction)| column.1.blocks.get(k).cloned();
        let all: Vec<_> = columns.iter().filter_map(of).collect();
        let Some(first) = all.first() else { continue };
        let _ = write!(out, "{:.6}", first.time_s);
        for c in 0..found.channels.len() {
            let determined = first.determined.get(c) != Some(&false);
            let cell = |value: Option<&f64>| match value {
                Some(value) if determined => format!(",{value:.9}"),
                _ => ",".to_owned(),
            };
            if has_measured {
                out.push_str(&cell(first.measured.get(c)));
            }
            all.iter().for_each(|block| out.push_str(&cell(block.predicted.get(c))));
        }
        out.push('\n');
    }
    out
}

/// Reads a result.json.
///
/// # Errors
/// [`Error::Unreadable`], or [`Error::Result`] if it is none.
pub fn answer_in(path: &Path) -> Result<Answer, Error> {
    let text = rigident_files::read_text(path)
        .map_err(|e| Error::Unreadable { path: path.to_owned(), why: e.to_string() })?;
    Answer::read(&text).map_err(|error| Error::Result { path: path.to_owned(), error })
}

/// Reads a model: result.json, or a robot description.
fn read(path: &Path) -> Result<Given, Error> {
    if path.extension().is_some_and(|extension| extension == "json") {
        let answer = answer_in(path)?;
        let refuse = |why: String| Err(Error::Unusable { path: path.to_owned(), why });
        return match &answer.error {
            Some(error) => refuse(format!("this run failed: {error}")),
            None if answer.is_contradicted() => refuse(
                "its recording cannot be true, so nothing of it is identified and nothing can be predicted: \
                 the warnings in it say why"
                    .to_owned(),
            ),
            None => Ok(Given::Answer(Box::new(answer))),
        };
    }
    let name = path.display().to_string();
    let (model, _) = named_model::open(&name, &Person::default())?;
    Ok(Given::Model(Box::new(model)))
}

/// Returns the columns of all drives that the models have.
fn options(given: &[Given], locked: &[String]) -> Result<ProblemOptions, Error> {
    let mut lists = Vec::new();
    let mut drives: Vec<String> = Vec::new();
    let all: Vec<&CompleteDrive> = given.iter().flat_map(Given::drives).collect();
    for drive in all {
        let terms: Vec<&str> = drive.terms.iter().map(|term| term.term.as_str()).collect();
        lists.push(format!("{}={}", drive.name, terms.join(",")));
        let words = format!("{}={}", drive.name, drive.turns_with);
        if drive.turns_with != drive.name && !drives.contains(&words) {
            drives.push(words);
        }
    }
    for (joint, terms) in given.iter().flat_map(|given| given.joints(locked)) {
        lists.push(format!("{joint}={}", terms.join(",")));
    }
    let friction = Friction::parse(&lists).map_err(Error::Friction)?;
    Ok(ProblemOptions { friction, drives, ..ProblemOptions::default() })
}

/// Refuses results of trees without the tree.
fn check_result_of_tree(given: &[Given], paths: &[PathBuf], nominal: Option<&Model>) -> Result<(), Error> {
    for (given, path) in given.iter().zip(paths) {
        let Given::Answer(answer) = given else { continue };
        match (answer.model.is_some(), nominal.is_some()) {
            (true, false) => return Err(Error::ResultOfTree(path.clone())),
            (false, true) => return Err(Error::ResultOfBody(path.clone())),
            _ => {}
        }
    }
    Ok(())
}

fn has_bodies(model: &Model) -> bool {
    model.links.iter().any(|link| link.nominal.is_some())
}

/// Returns the shortest names that tell files apart: of result.json that of its folder.
fn names(paths: &[PathBuf]) -> Vec<String> {
    let short = |path: &PathBuf| {
        let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let folder = path.parent().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
        match folder {
            Some(folder) if stem == "result" => folder,
            _ => stem,
        }
    };
    match paths {
        [one] if one.extension().is_some_and(|e| e == "json") => vec!["identified".to_owned()],
        all => all.iter().map(short).collect(),
    }
}
