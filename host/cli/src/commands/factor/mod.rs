pub(crate) mod arguments;

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use crate::commands::factor::arguments::{MakeFactor, Solve, TareFiles};
use crate::device::report::{Outlet, show};
use crate::screen::outcome::say;
use crate::{Failure, Folder, Stages};
use rigident::application::recorded::is_rig_file;
use rigident::application::{
    self, Error, FactorOptions, Fixture, Recorded, Reduced, SolveOptions, agreement,
};
use rigident::present;
use rigident_fit::pool::{PoolError, PooledFactor};
use rigident_io::factor_table::{is_table, to_bytes};
use rigident_io::recording::Recording;
use rigident_io::recording::error::RecordingError;
use rigident_io::recording::new_file::write_new_bytes;

/// Runs `rigident factor`.
pub(crate) fn make(arguments: &MakeFactor) -> Result<ExitCode, Failure> {
    absent(&arguments.output)?;
    let mut factors = Vec::new();
    for path in &arguments.recordings {
        // A rig file that lists a recording's files needs no other.
        let rig = arguments.rig.as_deref().filter(|_| !is_rig_file(path));
        factors.push(reduced(arguments, Recorded::File(path.clone()), rig)?);
    }
    if is_table(&arguments.output) {
        return write_table(&factors, &arguments.output);
    }
    write(factors, arguments.shared_offset, arguments.force, &arguments.output)
}

/// Makes the factor of a recording in memory.
pub(crate) fn make_of(arguments: &MakeFactor, recording: Recording) -> Result<ExitCode, Failure> {
    absent(&arguments.output)?;
    let factor = reduced(arguments, recording.into(), None)?;
    write(vec![factor], arguments.shared_offset, arguments.force, &arguments.output)
}

/// Reduces a recording, and tells what its checks found, and notes on the way.
fn reduced(arguments: &MakeFactor, recording: Recorded, rig: Option<&Path>) -> Result<PooledFactor, Failure> {
    let options = FactorOptions {
        rig: rig.map(Path::to_owned),
        calibration: arguments.calibration.calibration.clone(),
        tree: arguments.tree.typed()?,
        labels: arguments.label.iter().cloned().collect(),
    };
    let name = recording.name();
    let stages = Stages::new(&format!("factor of {name}"));
    let reduced = application::factor(recording, &options, &stages.caller())?;
    drop(stages);
    for said in reduced.warnings().chain(&reduced.notes) {
        tell!("rigident: {name}: {said}");
    }
    if reduced.is_contradicted() {
        tell!("rigident: {name}: not to be used; the factor says so to whoever solves it");
    }
    let Reduced { factor, .. } = reduced;
    Ok(factor)
}

/// Runs `rigident solve`.
pub(crate) fn solve(arguments: &Solve) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    let options = SolveOptions {
        rig: arguments.rig.clone(),
        without_platform: arguments.without_platform,
        tare: fixtures(&arguments.tare),
        known: arguments.known.parse()?,
        asked: arguments.output.estimate.clone(),
    };
    let stages = Stages::new("solving");
    let found = application::solve(&read(&arguments.factor)?, &options, &stages.caller())?;
    drop(stages);
    let out = arguments.output.out.as_deref();
    let outlet = Outlet { started, output: &arguments.output };
    show(found, outlet, |_| Ok(Vec::new()), || out.map(|out| Folder::new(Some(out), "solve")).transpose())
}

/// Returns the runs of `--tare` as the application takes them.
pub(crate) fn fixtures(files: &TareFiles) -> Vec<Fixture> {
    files.tare.iter().cloned().map(Fixture::File).collect()
}

/// Reads a factor file.
pub(crate) fn read(path: &Path) -> Result<PooledFactor, Failure> {
    PooledFactor::read(path).map_err(refused)
}

/// Says why factors are not read or merged, and what to do with a file that is a recording by its name.
pub(crate) fn refused(error: PoolError) -> Failure {
    Error::Factors(error).into()
}

/// Writes factors as a table, a row each.
pub(crate) fn write_table(factors: &[PooledFactor], output: &Path) -> Result<ExitCode, Failure> {
    let bytes = to_bytes(factors, &output.display().to_string()).map_err(Failure::input)?;
    write_new_bytes(output, &bytes).map_err(Failure::input)?;
    say(format_args!("{} factors in {}", factors.len(), output.display()));
    Ok(ExitCode::SUCCESS)
}

/// Refuses a path that exists, now rather than after a long job.
pub(crate) fn absent(path: &Path) -> Result<(), Failure> {
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
    check_agreement(&pooled, shared_offset, force)?;
    write_pooled(&pooled, &runs, output)
}

/// Writes a merged factor, and shows what merging gained over its runs, if they are given.
pub(crate) fn write_pooled(
    pooled: &PooledFactor,
    runs: &[PooledFactor],
    output: &Path,
) -> Result<ExitCode, Failure> {
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
pub(crate) fn check_agreement(
    pooled: &PooledFactor,
    shared_offset: bool,
    force: bool,
) -> Result<(), Failure> {
    for said in agreement(pooled, shared_offset, force)? {
        tell!("rigident: {said}");
    }
    Ok(())
}
