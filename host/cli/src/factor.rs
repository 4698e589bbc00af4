use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use super::arguments::{MakeFactor, Solve, TareFiles};
use super::loaded::Loaded;
use super::options::trees::TreeModel;
use super::outcome::say;
use super::recorded::{is_recording, is_rig_file};
use super::run_report::RunReport;
use super::{Failure, Folder, Stages};
use rigident::answer::Source;
use rigident::present;
use rigident::problem::ProblemOptions;
use rigident::problem::suspension::bare::is_stated;
use rigident_fit::pool::{PoolError, PooledFactor, disagreement_in_words};
use rigident_fit::tare::{Tare, TareError};
use rigident_fit::{CheckedRun, Fit, Kind, Parameter};
use rigident_io::factor_table::{is_table, to_bytes};
use rigident_io::recording::error::RecordingError;
use rigident_io::recording::new_file::write_new_bytes;
use rigident_io::recording::{Recording, extension, rig_path};
use rigident_io::rig::RigFile;

/// Runs that disagree by more than this many times their noise are of different bodies or rigs. What drifts from run to run
/// of one body, offsets apart, stays below.
const FOREIGN: f64 = 10.0;

/// `rigident factor`
pub(super) fn make(arguments: &MakeFactor) -> Result<ExitCode, Failure> {
    absent(&arguments.output)?;
    let labels: BTreeMap<String, String> = arguments.label.iter().cloned().collect();
    let mut factors = Vec::new();
    for path in &arguments.recordings {
        // A rig file that lists a recording's files needs no other.
        let rig = arguments.rig.as_deref().filter(|_| !is_rig_file(path));
        let stages = Stages::new(&format!("factor of {}", path.display()));
        let calibration = arguments.calibration.calibration.as_deref();
        let (factor, notes, _) =
            of_recording(path, rig, calibration, &arguments.tree, &ProblemOptions::default(), &labels)?;
        drop(stages);
        tell_of(path, &factor, &notes);
        factors.push(factor);
    }
    if is_table(&arguments.output) {
        return write_table(&factors, &arguments.output);
    }
    write(factors, arguments.shared_offset, arguments.force, &arguments.output)
}

/// The same of a recording in memory.
pub(super) fn make_of(arguments: &MakeFactor, recording: Recording) -> Result<ExitCode, Failure> {
    absent(&arguments.output)?;
    let name = recording.name.clone();
    let stages = Stages::new(&format!("factor of {name}"));
    let calibration = arguments.calibration.calibration.as_deref();
    let options = ProblemOptions::default();
    let mut loaded = Loaded::of_recording(recording, calibration, &arguments.tree, &options, &stages)?;
    loaded.problem.rig.recording.labels.extend(arguments.label.iter().cloned());
    let (factor, notes, _) = fitted(loaded, Path::new(&name), &stages)?;
    drop(stages);
    tell_of(Path::new(&name), &factor, &notes);
    write(vec![factor], arguments.shared_offset, arguments.force, &arguments.output)
}

/// Tells what the checks of a recording found, and notes on the way.
fn tell_of(path: &Path, factor: &PooledFactor, notes: &[String]) {
    let checks = factor.sources.iter().filter_map(|source| source.checks.as_ref());
    let warnings = checks.clone().flat_map(|checks| &checks.warnings);
    for said in warnings.chain(notes) {
        tell!("rigident: {}: {said}", path.display());
    }
    if checks.clone().any(|checks| checks.contradicted) {
        tell!("rigident: {}: not to be used; the factor says so to whoever solves it", path.display());
    }
}

/// `rigident solve`
pub(super) fn solve(arguments: &Solve) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    let known = arguments.known.parse()?;
    let rig = arguments.rig.as_deref().map(RigFile::load).transpose().map_err(Failure::input)?;
    let rig = rig.unwrap_or_default();
    let pooled = read(&arguments.factor)?;
    let mut found = pooled.fit();
    check_rig(&found, &rig).map_err(|why| Failure::input(format!("--rig: {why}")))?;
    let source = Source {
        recording: pooled.recordings(),
        rows: found.counts.samples,
        mcu: "host".to_owned(),
        ..Source::default()
    };
    let mut report = RunReport::of_factor(started, &arguments.output, &rig, source);
    let disagreement = pooled.unexplained_disagreement();
    report.warnings.extend(disagreement.map(|ratio| disagreement_in_words("the merged runs", ratio)));
    report.notes.extend(present::merged::assumptions(&pooled));
    if arguments.output.estimate.iter().any(|word| word.trim().starts_with("offset"))
        && let Some(why) = pooled.without_offset_in_words()
    {
        return Err(Failure::input(format!("--estimate offset: {why}")));
    }
    let rig_path = arguments.rig.as_deref();
    let tree = TreeModel::default();
    if let Some(tare) = tare(&arguments.tare, rig_path, None, &tree, &mut report.notes, &mut report.warnings)?
    {
        take_off(&tare, &mut found, &mut report.notes).map_err(Failure::input)?;
    }
    if arguments.without_platform {
        let table = rig.suspension.as_ref().filter(|table| is_stated(table));
        let Some(table) = table else {
            return Err(Failure::input(
                "--without-platform: the rig file states neither [suspension.platform] nor the mass of a spring",
            ));
        };
        super::bare_platform::take_platform_off(table, &mut found)?;
    } else if rig.suspension.as_ref().is_some_and(is_stated) {
        report.notes.push(
            "the rig file states the platform: of factors that have it on, --without-platform takes it off"
                .to_owned(),
        );
    }
    known.apply(&mut found).map_err(Failure::input)?;
    let out = arguments.output.out.as_deref();
    report.finish(&found, || out.map(|out| Folder::new(Some(out), "solve")).transpose())
}

/// Refuses a rig file whose links are not those that the parameters are of.
///
/// # Errors
/// Says what each of the two is of.
fn check_rig(found: &Fit, rig: &RigFile) -> Result<(), String> {
    let named = found.parameters.iter().filter_map(Parameter::link);
    let of_factor: BTreeSet<&str> = named.filter(|link| !link.is_empty()).collect();
    let of_rig: BTreeSet<&str> = rig.link.iter().map(|link| link.name.as_str()).collect();
    let of_a_body = rig.body.is_some() || rig.truth.is_some();
    let fits = match (of_factor.is_empty(), of_rig.len()) {
        (true, links) => links < 2,
        (false, 0) => !of_a_body,
        (false, _) => of_factor.is_subset(&of_rig),
    };
    if fits {
        return Ok(());
    }
    let words = |links: &BTreeSet<&str>| match links.len() {
        0 => "one body".to_owned(),
        _ => format!("the links {}", links.iter().copied().collect::<Vec<_>>().join(", ")),
    };
    Err(format!(
        "the factor is of {}, and the rig file of {}; give the rig file that the recordings were taken with, or none",
        words(&of_factor),
        words(&of_rig)
    ))
}

/// Returns the fixture of `--tare`, if there is one; what is to be known of it goes to the notes and warnings.
///
/// # Errors
/// Bad input: a run that cannot be read, or runs that do not fit together.
pub(super) fn tare(
    files: &TareFiles,
    rig: Option<&Path>,
    calibration: Option<&Path>,
    tree: &TreeModel,
    notes: &mut Vec<String>,
    warnings: &mut Vec<String>,
) -> Result<Option<Tare>, Failure> {
    let Some(tare) = bare(files, rig, calibration, tree, &ProblemOptions::default(), notes)? else {
        return Ok(None);
    };
    say_taken_off(&tare, notes);
    warnings.extend(tare.warning());
    Ok(Some(tare))
}

/// Takes a fixture off a fit; what that assumes of the rigs of both goes to the notes.
///
/// # Errors
/// As [`Tare::take_off`].
pub(super) fn take_off(tare: &Tare, found: &mut Fit, notes: &mut Vec<String>) -> Result<(), TareError> {
    notes.extend(present::merged::rigs_of_tare(&found.rows(), &tare.fit().rows()));
    tare.take_off(found)
}

/// Tells that a fixture is taken off.
pub(super) fn say_taken_off(tare: &Tare, notes: &mut Vec<String>) {
    let contradicted = tare.fit().runs.iter().any(CheckedRun::is_contradicted);
    if contradicted {
        notes.push(format!(
            "tare: {} cannot be true, and nothing is left of the difference",
            tare.recordings()
        ));
        return;
    }
    let mass = match tare.fit().parameters.iter().position(|p| p.kind == Kind::Mass) {
        Some(j) => tare.fit().estimate.measured(j),
        None => None,
    };
    let mass = mass.map_or("unknown mass".to_owned(), |m| present::text::with_u95(m.value, m.u95, "kg"));
    notes.push(format!(
        "tare: a fixture of {mass} was subtracted with its uncertainty ({})",
        tare.recordings()
    ));
}

/// Returns the merged runs of `--tare`, if there are any; the errors of a single recording are kept.
///
/// # Errors
/// Bad input: a run that cannot be read, or runs that do not fit together.
pub(super) fn bare(
    files: &TareFiles,
    rig: Option<&Path>,
    calibration: Option<&Path>,
    tree: &TreeModel,
    options: &ProblemOptions,
    notes: &mut Vec<String>,
) -> Result<Option<Tare>, Failure> {
    let (mut factors, mut runs) = (Vec::new(), Vec::new());
    for path in &files.tare {
        let factor = if is_recording(path) {
            // Its own rig file if it has one: the fixture's run may have been taken with another IMU.
            let own = is_rig_file(path) || rig_path(path).exists();
            let none = BTreeMap::new();
            let rig = rig.filter(|_| !own);
            let (factor, said, run) = of_recording(path, rig, calibration, tree, options, &none)?;
            runs.push(run);
            notes.extend(said.into_iter().map(|said| format!("tare {}: {said}", path.display())));
            factor
        } else {
            read(path)?
        };
        factors.push(factor);
    }
    if factors.is_empty() {
        return Ok(None);
    }
    let pooled = PooledFactor::merged(factors, false).map_err(Failure::input)?;
    let tare = match runs.as_slice() {
        [run] if pooled.runs() == 1 => Tare::of_run(run, pooled),
        _ => Tare::new(pooled),
    };
    tare.map(Some).map_err(Failure::input)
}

/// Reads a factor file.
pub(super) fn read(path: &Path) -> Result<PooledFactor, Failure> {
    PooledFactor::read(path).map_err(refused)
}

/// Says why factors are not read or merged, and what to do with a file that is a recording by its name.
pub(super) fn refused(error: PoolError) -> Failure {
    let name = match &error {
        PoolError::File { name, .. } | PoolError::Access { name, .. } => name.as_str(),
        _ => "",
    };
    match extension(Path::new(name)).as_str() {
        "csv" | "mcap" | "db3" | "mat" => Failure::input(format!(
            "{error}; it is a recording by its name: `rigident factor {name} -o NEW.factor` makes one of it"
        )),
        "parquet" => Failure::input(format!("{error}; of a table of factors `rigident merge` makes one")),
        _ => Failure::input(error),
    }
}

/// Writes factors as a table, a row each.
pub(super) fn write_table(factors: &[PooledFactor], output: &Path) -> Result<ExitCode, Failure> {
    let bytes = to_bytes(factors, &output.display().to_string()).map_err(Failure::input)?;
    write_new_bytes(output, &bytes).map_err(Failure::input)?;
    say(format_args!("{} factors in {}", factors.len(), output.display()));
    Ok(ExitCode::SUCCESS)
}

/// Returns the factor of a recording, which keeps what its checks found, notes on the way, and the fit;
/// `labels` count beside those of its rig file, and before them.
fn of_recording(
    path: &Path,
    rig: Option<&Path>,
    calibration: Option<&Path>,
    tree: &TreeModel,
    options: &ProblemOptions,
    labels: &BTreeMap<String, String>,
) -> Result<(PooledFactor, Vec<String>, Fit), Failure> {
    let stages = Stages::new(&format!("reading {}", path.display()));
    let mut loaded = Loaded::read(path, rig, calibration, tree, options, &stages)?;
    let own = &mut loaded.problem.rig.recording.labels;
    own.extend(labels.iter().map(|(key, value)| (key.clone(), value.clone())));
    fitted(loaded, path, &stages)
}

/// Returns the same of what has been read.
fn fitted(loaded: Loaded, path: &Path, stages: &Stages) -> Result<(PooledFactor, Vec<String>, Fit), Failure> {
    let found = loaded.fit(None, 0, stages).map_err(|e| e.context(path.display()))?;
    let factor = loaded.factor(&found);
    Ok((PooledFactor { name: path.display().to_string(), ..factor }, loaded.notes, found))
}

/// Found out now rather than after a long job.
pub(super) fn absent(path: &Path) -> Result<(), Failure> {
    if path.symlink_metadata().is_ok() {
        return Err(Failure::input(RecordingError::Exists(path.display().to_string())));
    }
    Ok(())
}

fn write(
    factors: Vec<PooledFactor>,
    shared_offset: bool,
    force: bool,
    output: &Path,
) -> Result<ExitCode, Failure> {
    let runs = if present::merged::is_shown(factors.len()) { factors.clone() } else { Vec::new() };
    let pooled = PooledFactor::merged(factors, shared_offset).map_err(Failure::input)?;
    write_pooled(&pooled, &runs, shared_offset, force, output)
}

/// Writes a merged factor, and shows what merging gained over its runs, if they are given.
pub(super) fn write_pooled(
    pooled: &PooledFactor,
    runs: &[PooledFactor],
    shared_offset: bool,
    force: bool,
    output: &Path,
) -> Result<ExitCode, Failure> {
    check_agreement(pooled, shared_offset, force)?;
    if is_table(output) {
        return write_table(std::slice::from_ref(pooled), output);
    }
    pooled.write(output).map_err(Failure::input)?;
    if let Some(table) = present::merged::table(runs, pooled) {
        say(table.trim_end());
    }
    say(format_args!(
        "{} rows of {}, {} parameters, in {}",
        pooled.rows(),
        pooled.recordings(),
        pooled.parameters.len(),
        output.display()
    ));
    Ok(ExitCode::SUCCESS)
}

/// Tells what merged runs say of each other.
///
/// # Errors
/// Bad input: they disagree too much to be of one body, and are not to be merged all the same.
pub(super) fn check_agreement(
    pooled: &PooledFactor,
    shared_offset: bool,
    force: bool,
) -> Result<(), Failure> {
    if let Some(ratio) = pooled.unexplained_disagreement() {
        if ratio.sqrt() > FOREIGN && !force {
            return Err(Failure::input(format!(
                "{} disagree {:.1} times as much as their noise explains: they are not runs of one body, mounted alike, with \
                 one sensor{}; `rigident solve` of each tells which does not belong. --force merges them all the same, the \
                 intervals widened as much",
                pooled.recordings(),
                ratio.sqrt(),
                if shared_offset { ", or its offset is not one between them" } else { "" }
            )));
        }
        tell!("rigident: {}", disagreement_in_words("the runs", ratio));
    }
    for said in present::merged::assumptions(pooled) {
        tell!("rigident: {said}");
    }
    Ok(())
}
