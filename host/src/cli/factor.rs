use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use super::arguments::{MakeFactor, Merge, Solve, TareFiles};
use super::outcome::say;
use super::recorded::{Recorded, is_recording, is_rig_file};
use super::{Failure, Folder, Stages};
use crate::answer::assemble::{Asked, Assembled, Context, assemble};
use crate::answer::result::ResultSource;
use crate::identification::pooled::PooledFactor;
use crate::identification::tare::{Tare, disagreement_in_words};
use crate::present::{self, ReportData, Source, table};
use crate::recording::error::RecordingError;
use crate::recording::new_file::write_new;
use crate::recording::{extension, rig_path};
use crate::rig::RigFile;

/// Runs that disagree by more than this many times their noise are of different bodies or rigs. What drifts from run to run
/// of one body, offsets apart, stays below.
const FOREIGN: f64 = 10.0;

/// `rigident factor`
pub(super) fn make(arguments: &MakeFactor) -> Result<ExitCode, Failure> {
    absent(&arguments.output)?;
    let mut factors = Vec::new();
    for path in &arguments.recordings {
        // A rig file that lists a recording's files needs no other.
        let rig = arguments.rig.as_deref().filter(|_| !is_rig_file(path));
        let stages = Stages::new(&format!("factor of {}", path.display()));
        let (factor, notes) = of_recording(path, rig)?;
        drop(stages);
        for note in notes {
            tell!("rigident: {}: {note}", path.display());
        }
        factors.push(factor);
    }
    write(factors, arguments.shared_offset, arguments.force, &arguments.output)
}

/// `rigident merge`
pub(super) fn merge(arguments: &Merge) -> Result<ExitCode, Failure> {
    absent(&arguments.output)?;
    let factors = arguments.factors.iter().map(|path| read(path)).collect::<Result<Vec<_>, _>>()?;
    write(factors, arguments.shared_offset, arguments.force, &arguments.output)
}

/// `rigident solve`
pub(super) fn solve(arguments: &Solve) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    let asked = Asked::parse(&arguments.output.estimate).map_err(Failure::input)?;
    let known = arguments.known.parse()?;
    let rig = arguments.rig.as_deref().map(RigFile::load).transpose().map_err(Failure::input)?;
    let rig = rig.unwrap_or_default();
    let pooled = read(&arguments.factor)?;
    let mut warnings = Vec::new();
    let mut identification = pooled.identification();
    let disagreement = pooled.judgement(pooled.factor.determined()).disagreement;
    warnings.extend(disagreement.map(|ratio| disagreement_in_words("the merged runs", ratio)));
    warnings.extend(pooled.warning());
    if asked.offset() {
        warnings.extend(pooled.without_offset_in_words());
    }
    if let Some(tare) = tare(&arguments.tare, arguments.rig.as_deref(), &mut warnings)? {
        tare.take_off(&pooled, &mut identification, &mut []).map_err(Failure::input)?;
    }
    identification.estimate = identification.estimate.with_known(&known).map_err(Failure::input)?;
    let folder = arguments.output.out.as_deref().map(|out| Folder::new(Some(out), "solve")).transpose()?;
    let rows = identification.counters.readings as usize;
    let source = ResultSource {
        recording: pooled.recordings(),
        rows,
        rate_hz: None,
        mcu: "host".to_owned(),
        memory: None,
    };
    let page_source = Source {
        body_name: rig.body.as_ref().map_or_else(String::new, |b| b.name.clone()),
        recording: source.recording.clone(),
        mcu: source.mcu.clone(),
        rate_hz: None,
        rows: rows as u64,
        duration_s: None,
    };
    let context = Context { rig: &rig, asked: &asked, source, time_base: None, broken: None, warnings };
    let Assembled { results, mut object, success } = assemble(&identification, context);
    object.elapsed_s = started.elapsed().as_secs_f64();
    let text = serde_json::to_string_pretty(&object)
        .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
    if arguments.output.json {
        say(text.as_str());
    } else {
        say(table::plain(&results).trim_end());
    }
    if let Some(folder) = folder {
        folder.write("result.json", text.as_bytes())?;
        let page = present::html(&ReportData { source: page_source, results, ..ReportData::default() });
        let page = folder.write("report.html", page.as_bytes())?;
        if !arguments.output.json {
            say(format_args!(
                "\nFiles in {}; open {} in a browser.",
                folder.path().display(),
                page.display()
            ));
        }
    }
    Ok(if success { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// The fixture of `--tare`, if there is one. What is to be known of it goes to the warnings.
pub(super) fn tare(
    files: &TareFiles,
    rig: Option<&Path>,
    warnings: &mut Vec<String>,
) -> Result<Option<Tare>, Failure> {
    let mut factors = Vec::new();
    for path in &files.tare {
        let factor = if is_recording(path) {
            // Its own rig file if it has one: the fixture's run may have been taken with another IMU.
            let own = is_rig_file(path) || rig_path(path).exists();
            let (factor, notes) = of_recording(path, rig.filter(|_| !own))?;
            warnings.extend(notes.into_iter().map(|note| format!("tare {}: {note}", path.display())));
            factor
        } else {
            read(path)?
        };
        factors.push(factor);
    }
    if factors.is_empty() {
        return Ok(None);
    }
    let tare = Tare::new(PooledFactor::merged(factors, false).map_err(Failure::input)?);
    let mass = match tare.estimate().measured(0) {
        Some(mass) => present::text::with_u95(mass.value, mass.u95, "kg"),
        None => "unknown mass".to_owned(),
    };
    warnings.push(format!(
        "tare: a fixture of {mass} was subtracted with its uncertainty ({})",
        tare.recordings()
    ));
    warnings.extend(tare.warning());
    Ok(Some(tare))
}

/// Reads a factor file.
fn read(path: &Path) -> Result<PooledFactor, Failure> {
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|e| Failure::input(format!("{name} cannot be read: {e}")))?;
    PooledFactor::from_bytes(&bytes, &name).map_err(|error| match extension(path).as_str() {
        "csv" | "mcap" => Failure::input(format!(
            "{error}; it is a recording by its name: `rigident factor {name} -o NEW.factor` makes one of it"
        )),
        _ => Failure::input(error),
    })
}

/// The factor of a recording, and what was noticed on the way.
fn of_recording(path: &Path, rig: Option<&Path>) -> Result<(PooledFactor, Vec<String>), Failure> {
    let recorded = Recorded::load(path, rig)?;
    let identification = recorded.identify().map_err(|e| e.context(path.display()))?;
    let factor = recorded.factor(&identification);
    Ok((PooledFactor { name: path.display().to_string(), ..factor }, recorded.warnings()))
}

/// Found out now rather than after a long job.
fn absent(path: &Path) -> Result<(), Failure> {
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
    let pooled = PooledFactor::merged(factors, shared_offset).map_err(Failure::input)?;
    if let Some(ratio) = pooled.judgement(pooled.factor.determined()).disagreement {
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
    if let Some(warning) = pooled.warning() {
        tell!("rigident: {warning}");
    }
    let bytes = pooled.to_file().to_bytes();
    write_new(output, |mut file| {
        file.write_all(&bytes)?;
        Ok::<_, std::io::Error>(file)
    })
    .map_err(Failure::input)?;
    say(format_args!(
        "{} rows of {}, {} parameters, in {}",
        pooled.factor.rows(),
        pooled.recordings(),
        pooled.factor.parameters(),
        output.display()
    ));
    Ok(ExitCode::SUCCESS)
}
