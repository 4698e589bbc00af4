use std::process::ExitCode;
use std::time::Instant;

use super::arguments::Identify;
use super::loaded::{Loaded, PLOT_POINTS, StandardOptions, tree_of};
use super::options::forgetting::RowsOf;
use super::run_report::RunReport;
use super::{Failure, Folder, Stages};
use crate::model::{remarks, write};
use crate::problem::ProblemOptions;
use crate::problem::tree::drive::Friction;

/// `rigident identify`
pub(super) fn run(arguments: &Identify) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    let (path, rig) = (&arguments.recording, arguments.rig.as_deref());
    let calibration = arguments.calibration.calibration.as_deref();
    let known = arguments.known.parse()?;
    let standard = standard_options(arguments)?;
    let friction = Friction::parse(&arguments.tree.friction).map_err(Failure::input)?;
    let options =
        ProblemOptions { friction, drives: arguments.tree.drive.clone(), ..ProblemOptions::default() };
    if tree_of(path, rig, &arguments.tree.of)?.is_none() {
        refuse_without_tree(arguments)?;
    }
    let stages = Stages::new(&format!("reading {}", path.display()));
    let loaded = Loaded::read(path, rig, calibration, &arguments.tree.of, &options, &stages)?;
    known.check(loaded.source().parameters()).map_err(Failure::input)?;
    let mut report = RunReport::of_recording(started, &arguments.output, &loaded, "host");
    report.standard = standard;
    let tare = super::factor::tare(
        &arguments.tare,
        rig,
        calibration,
        &arguments.tree.of,
        &mut report.notes,
        &mut report.warnings,
    )?;
    let span = arguments.forgetting.span(&RowsOf::source(loaded.source()))?;
    let mut found = loaded.fit(span, PLOT_POINTS, &stages)?;
    report.factor = Some(loaded.factor(&found));
    if let Some(suspension) = &loaded.problem.rig.suspension {
        super::bare_platform::take_platform_off(suspension, &mut found)?;
    }
    if let Some(tare) = tare {
        tare.take_off(&mut found).map_err(Failure::input)?;
    }
    known.apply(&mut found).map_err(Failure::input)?;
    if let (Some(path), Some((model, file))) = (standard.write_model, loaded.nominal()) {
        report.warnings.extend(remarks::remarks(model, file, path, &arguments.tree.of.changes.lock));
    }
    stages.at("answer", 0.0);
    let out = arguments.output.out.as_deref();
    // What is written while the stages are shown would be mixed with them.
    drop(stages);
    report.finish(&found, || Folder::new(out, "identify").map(Some))
}

/// Returns how standard parameters are sought.
///
/// # Errors
/// Bad input: an impossible σ, or a model that cannot be written.
fn standard_options(arguments: &Identify) -> Result<StandardOptions<'_>, Failure> {
    let options = &arguments.tree;
    let trust = options.nominal_sigma;
    if !trust.is_finite() || trust <= 0.0 {
        return Err(Failure::input(format!("--nominal-sigma {trust}: must be finite and greater than zero")));
    }
    let write_model = options.write_model.as_deref();
    if let Some(path) = write_model {
        write::check_target(path).map_err(Failure::input)?;
    }
    Ok(StandardOptions { trust, symmetric: options.symmetric_sides, write_model })
}

/// Refuses options of trees where nothing says which tree.
fn refuse_without_tree(arguments: &Identify) -> Result<(), Failure> {
    let options = &arguments.tree;
    let mut given = vec![
        ("--friction", !options.friction.is_empty()),
        ("--drive", !options.drive.is_empty()),
        ("--symmetric-sides", options.symmetric_sides),
        ("--write-model", options.write_model.is_some()),
        ("--nominal-sigma", options.nominal_sigma != 1.0),
    ];
    given.extend(options.of.changed());
    super::loaded::refuse_tree_options(&given)
}
