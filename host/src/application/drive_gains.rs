//! From recordings of motor currents to the gains of the drives.

use std::path::PathBuf;

use super::drive_gains_error::DriveGainsError;
use super::loaded::{Loaded, StandardOptions};
use super::{Caller, Error, Tree, payload, recorded, tree};
use rigident_fit::pool::PooledFactor;
use rigident_fit::prior::KnownValues;
use rigident_fit::tare::Tare;
use rigident_fit::{Fit, Progress};
use rigident_identify::answer::{Answer, Context, Status};
use rigident_identify::drive_gains::columns::{EffortColumn, columns, scale};
use rigident_identify::drive_gains::nominal::expected;
use rigident_identify::drive_gains::scales::Errors;
use rigident_identify::drive_gains::{COARSEST, MOST_ROUNDS, SETTLED, UNDETERMINED, WIDE, start};
use rigident_io::recording::Recording;
use rigident_io::rig::RigFile;
use rigident_model::Model;
use rigident_rows::tree::ProblemOptions;
use rigident_rows::tree::drive::Friction;

/// The label by which recordings are of one robot, where they have none of their own.
const ROBOT: (&str, &str) = ("rig", "robot");
/// A step changes a gain by no more than these factors.
const STEPS: (f64, f64) = (0.3, 3.0);

/// Options of the search for drive gains.
#[derive(Clone, Debug, Default)]
pub struct DriveGainOptions {
    /// Rig file of all recordings. Default: `NAME.rig.toml` beside each.
    pub rig: Option<PathBuf>,
    /// The robot.
    pub tree: Tree,
    /// Friction columns of the joints.
    pub friction: Friction,
    /// Drives that turn with several joints: `NAME=J1+J2`.
    pub drives: Vec<String>,
    /// A recording with a load, and the link that carries it, `LINK` or `LINK@x,y,z,roll,pitch,yaw` in m and
    /// degrees.
    pub loaded: Option<(PathBuf, String)>,
    /// The known values of the load, or of the links if there is no load.
    pub known: KnownValues,
    /// Relative standard deviation (1 σ) that the nominal model's links are trusted with; `None`: not at all.
    pub nominal_sigma: Option<f64>,
}

/// The gain of a drive.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveGain {
    /// The joint.
    pub joint: String,
    /// The column of its effort.
    pub column: String,
    /// Unit of the column, `A`; empty if that is not known.
    pub unit: &'static str,
    /// N m (N) per unit of the column.
    pub gain: f64,
    /// 95 % expanded uncertainty, N m (N) per unit of the column.
    pub u95: f64,
    /// True if that is at most a tenth of the gain; otherwise the gain says nothing.
    pub is_identified: bool,
    /// The ratio to the gain of the reference with its 95 % expanded uncertainty, where that is at most a
    /// tenth of it.
    pub ratio: Option<(f64, f64)>,
}

/// The gains of a robot's drives.
#[derive(Clone, Debug)]
pub struct DriveGains {
    /// Drives in the order of the model.
    pub drives: Vec<DriveGain>,
    /// The drive that ratios are to, where there are any.
    pub reference: Option<usize>,
    /// The rig file with the gains that are identified, and standard deviations that hold for all
    /// combinations of them.
    pub rig: RigFile,
    /// Rounds of scaling.
    pub rounds: usize,
    /// Notes on the steps taken.
    pub notes: Vec<String>,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
}

impl DriveGains {
    /// Returns true if every gain is identified.
    pub fn is_complete(&self) -> bool {
        self.drives.iter().all(|drive| drive.is_identified)
    }
}

/// Finds the gains of drives from recordings without a load, and of one with a load.
///
/// # Errors
/// Something cannot be read, does not fit, or cannot be true; the caller stops the job.
pub fn drive_gains(
    bare: &[PathBuf],
    options: &DriveGainOptions,
    caller: &Caller<'_>,
) -> Result<DriveGains, Error> {
    caller.stoppable(|| found(bare, options, caller))
}

/// Recordings with the efforts of the same joints.
struct Runs {
    model: Model,
    recordings: Vec<Recording>,
    efforts: Vec<EffortColumn>,
}

/// Recordings that are scaled and fitted.
struct Fitted {
    loaded: Vec<Loaded>,
    fits: Vec<Fit>,
}

/// The result of one round of scaling and fitting.
struct Round {
    errors: Errors,
    coverage: f64,
    is_settled: bool,
    warnings: Vec<String>,
}

fn found(bare: &[PathBuf], options: &DriveGainOptions, caller: &Caller<'_>) -> Result<DriveGains, Error> {
    if let Some(share) = options.nominal_sigma
        && !(share.is_finite() && share > 0.0 && options.loaded.is_none())
    {
        return Err(DriveGainsError::NominalSigma(share).into());
    }
    let runs = read(bare, options, caller)?;
    let joints: Vec<String> = runs.efforts.iter().map(|effort| effort.joint.clone()).collect();
    let mut gains = guess(&runs, options, caller)?;
    let mut rounds = 0;
    let (fitted, round) = loop {
        rounds += 1;
        let fitted = fit(&runs, (&gains, WIDE), options, caller)?;
        let round = errors(&fitted, &joints, options, false)?;
        let is_determined = round.errors.sd_in_common() <= UNDETERMINED;
        let off = if is_determined { round.errors.clone() } else { round.errors.apart() };
        let step = |k: usize| (1.0 / (1.0 + off.values[k]).max(1.0 / STEPS.1)).max(STEPS.0);
        let moves = |k: usize| off.values[k].abs() > SETTLED * off.sd(k);
        let is_settled = !(0..gains.len()).any(moves);
        if is_settled {
            let judged = errors(&fitted, &joints, options, true)?;
            break (fitted, Round { is_settled, ..judged });
        }
        if rounds == MOST_ROUNDS {
            break (fitted, round);
        }
        gains.iter_mut().enumerate().for_each(|(k, gain)| *gain *= step(k));
    };
    // As with the rig file that comes of it: gains of which nothing is known take the place of friction that
    // the model lacks.
    let judged = fit(&runs, (&gains, 0.5 * COARSEST), options, caller)?;
    for (loaded, own) in judged.loaded.iter().zip(&judged.fits) {
        refuse_impossible(loaded, own)?;
    }
    Ok(answer(&runs, &gains, &fitted, round, rounds))
}

fn read(bare: &[PathBuf], options: &DriveGainOptions, caller: &Caller<'_>) -> Result<Runs, Error> {
    let name = options.tree.model.clone().unwrap_or_default();
    let (model, _) = tree::open(&name, &options.tree.changes)?;
    let mut runs = Runs { model, recordings: Vec::new(), efforts: Vec::new() };
    let loaded = options.loaded.iter().map(|(path, _)| path);
    for path in bare.iter().chain(loaded) {
        caller.stage(&format!("reading {}", path.display()), 0.0);
        let mut recording = Recording::load(&recorded::named(path.clone()), options.rig.as_deref())?;
        let labels = &mut recording.rig.recording.labels;
        labels.entry(ROBOT.0.to_owned()).or_insert_with(|| ROBOT.1.to_owned());
        let efforts = columns(&recording, &runs.model);
        if efforts.is_empty() {
            return Err(DriveGainsError::NoEfforts(recording.name).into());
        }
        if runs.recordings.is_empty() {
            runs.efforts = efforts;
        } else if runs.efforts != efforts {
            return Err(DriveGainsError::OtherEfforts(recording.name).into());
        }
        runs.recordings.push(recording);
    }
    Ok(runs)
}

/// Returns recordings as problems, efforts times these gains, each known within this share.
fn scaled(
    runs: &Runs,
    recording: &Recording,
    (gains, sigma): (&[f64], f64),
    options: &DriveGainOptions,
    caller: &Caller<'_>,
) -> Result<Loaded, Error> {
    let mut own = recording.clone();
    scale(&mut own.rig, &runs.efforts, gains, &vec![sigma; gains.len()]);
    let problem = ProblemOptions {
        friction: options.friction.clone(),
        drives: options.drives.clone(),
        ..ProblemOptions::default()
    };
    Loaded::of_recording(own, None, &options.tree, &problem, caller)
}

fn guess(runs: &Runs, options: &DriveGainOptions, caller: &Caller<'_>) -> Result<Vec<f64>, Error> {
    let Some(first) = runs.recordings.first() else { return Ok(Vec::new()) };
    if runs.model.links.iter().all(|link| link.nominal.is_none_or(|phi| phi[0] == 0.0)) {
        return Err(DriveGainsError::NoMasses(runs.model.name.clone()).into());
    }
    let ones = vec![1.0; runs.efforts.len()];
    let loaded = scaled(runs, first, (&ones, WIDE), options, caller)?;
    let nothing = || DriveGainsError::NothingExplained(first.name.clone());
    let source = loaded.problem.tree().ok_or_else(nothing)?;
    Ok(start::gains(source, &runs.model)?.filter(|gains| gains.len() == ones.len()).ok_or_else(nothing)?)
}

/// Fits every recording with gains that are known to `sigma`, relative.
fn fit(
    runs: &Runs,
    (gains, sigma): (&[f64], f64),
    options: &DriveGainOptions,
    caller: &Caller<'_>,
) -> Result<Fitted, Error> {
    let mut all = Fitted { loaded: Vec::new(), fits: Vec::new() };
    for recording in &runs.recordings {
        caller.stage(&format!("gains by {}", recording.name), 0.0);
        let loaded = scaled(runs, recording, (gains, sigma), options, caller)?;
        all.fits.push(loaded.fit(None, 0, caller).map_err(|error| error.of(&recording.name))?);
        all.loaded.push(loaded);
    }
    Ok(all)
}

/// Returns the errors of the gains as all recordings tell them together.
///
/// Rows are linear about the gains that efforts are scaled by, and what they say of the size of a load far
/// from these is next to nothing: what is known of it is judged where gains have settled.
fn errors(
    fitted: &Fitted,
    joints: &[String],
    options: &DriveGainOptions,
    is_settled: bool,
) -> Result<Round, Error> {
    let none = || Error::from(DriveGainsError::NoRows(joints.join(", ")));
    let with = options.loaded.iter().len();
    let (bare, loaded) = fitted.fits.split_at(fitted.fits.len().saturating_sub(with));
    let names = fitted.loaded.iter().map(|loaded| loaded.problem.name.as_str());
    let pooled =
        || PooledFactor::merged(bare.iter().zip(names).map(|(f, n)| PooledFactor::of(f, n)).collect(), false);
    let mut warnings = Vec::new();
    let fit = match (&options.loaded, loaded, bare) {
        (Some((_, place)), [own], _) => {
            let tare = match bare {
                [only] => Tare::of_run(only, pooled()?)?,
                _ => Tare::new(pooled()?)?,
            };
            let carrier = fitted.loaded.last().ok_or_else(none)?;
            let (carrier, result) = payload::carrier(carrier, place)?;
            let fit = tare.payload(own, &carrier)?;
            let apart = fit.noise.disagreement;
            warnings
                .extend(apart.map(|ratio| rigident_fit::payload::disagreement_in_words(&result.link, ratio)));
            fit
        }
        (_, _, [only]) => only.clone(),
        _ => pooled()?.fit(),
    };
    let rows = fit.rows();
    let mut all = rows.known();
    if let (Some(share), Some(loaded)) = (options.nominal_sigma, fitted.loaded.first()) {
        let of = loaded.problem.tree().zip(loaded.nominal());
        let known = of.and_then(|(source, (model, _))| expected(source.base(), model, share));
        let known = known.ok_or_else(none)?;
        let place = |name: &String| fit.parameters.iter().position(|p| p.name == *name);
        let at: Vec<usize> = known.names().iter().map(place).collect::<Option<_>>().ok_or_else(none)?;
        let rows = known.rows(all.parameters(), &at);
        all.absorb(rows.iter().map(|(row, value)| (row.as_slice(), *value)));
    }
    let noise = is_settled.then_some(fit.estimate.noise);
    options.known.absorbed_by(&mut all, &fit.parameters, noise, fit.rounding)?;
    let errors = Errors::of(&all, rows.parameters(), rows.errors(), joints).ok_or_else(none)?;
    Ok(Round { errors, coverage: fit.estimate.noise.coverage_factor(), is_settled: false, warnings })
}

/// Refuses a recording that contradicts itself with any gains.
fn refuse_impossible(loaded: &Loaded, fit: &Fit) -> Result<(), Error> {
    let context = Context {
        links: loaded.links(&StandardOptions::DEFAULT),
        findings: loaded.problem.findings.clone(),
        ..Context::default()
    };
    let answer = Answer::new(fit, context)?;
    if answer.status != Status::Implausible {
        return Ok(());
    }
    let why = answer.warnings.first().cloned().unwrap_or_default();
    Err(DriveGainsError::Implausible { name: loaded.problem.name.clone(), why }.into())
}

fn answer(runs: &Runs, gains: &[f64], fitted: &Fitted, round: Round, rounds: usize) -> DriveGains {
    let Round { errors, coverage, is_settled, mut warnings } = round;
    if !is_settled {
        warnings.push(format!(
            "the gains have not settled after {rounds} rounds, and none is identified: record more motion, \
             or state friction that the joints have"
        ));
    }
    let reference = errors.reference(coverage).filter(|_| is_settled);
    let drive = |(k, effort): (usize, &EffortColumn)| {
        let ratio = reference.filter(|to| *to != k).and_then(|to| {
            let u95 = coverage * errors.sd_of_ratio(k, to);
            let ratio = gains[k] / gains[to];
            (u95 <= COARSEST).then_some((ratio, u95 * ratio.abs()))
        });
        DriveGain {
            joint: effort.joint.clone(),
            column: effort.source.name.clone(),
            unit: effort.unit,
            gain: gains[k] * effort.source.scale,
            u95: coverage * errors.sd(k) * (gains[k] * effort.source.scale).abs(),
            is_identified: is_settled && coverage * errors.sd(k) <= COARSEST,
            ratio,
        }
    };
    let drives: Vec<DriveGain> = runs.efforts.iter().enumerate().map(drive).collect();
    let mut rig = runs.recordings.first().map(|first| first.rig.clone()).unwrap_or_default();
    if rig.recording.labels.get(ROBOT.0).is_some_and(|label| label == ROBOT.1) {
        rig.recording.labels.remove(ROBOT.0);
    }
    let std = errors.independent();
    for (k, _) in drives.iter().enumerate().filter(|(_, drive)| drive.is_identified) {
        scale(&mut rig, &runs.efforts[k..=k], &gains[k..=k], &std[k..=k]);
    }
    let mut notes = Vec::new();
    for loaded in &fitted.loaded {
        let of = |text: &String| format!("{}: {text}", loaded.problem.name);
        notes.extend(loaded.notes.iter().map(of));
        warnings.extend(loaded.warnings.iter().map(of));
    }
    DriveGains { drives, reference, rig, rounds, notes, warnings }
}

#[cfg(all(test, feature = "simulator"))]
#[path = "drive_gains_tests.rs"]
mod tests;
