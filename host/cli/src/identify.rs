use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use super::arguments::Identify;
use super::loaded::{Loaded, PLOT_POINTS, StandardOptions, tree_in, tree_of};
use super::options::forgetting::RowsOf;
use super::run_report::RunReport;
use super::{Failure, Folder, Stages, factor, payload};
use rigident::problem::ProblemOptions;
use rigident::problem::tree::drive::Friction;
use rigident_fit::Fit;
use rigident_fit::tare::Tare;
use rigident_io::recording::Recording;
use rigident_model::write;

/// `rigident identify`
pub(super) fn run(arguments: &Identify) -> Result<ExitCode, Failure> {
    identify(arguments, None)
}

/// The same of a recording in memory; `--rig` is then of a fixture's recordings alone.
pub(super) fn of_recording(arguments: &Identify, recording: Recording) -> Result<ExitCode, Failure> {
    identify(arguments, Some(recording))
}

fn identify(arguments: &Identify, memory: Option<Recording>) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    let (path, rig) = (&arguments.recording, arguments.rig.as_deref());
    let calibration = arguments.calibration.calibration.as_deref();
    let known = arguments.known.parse()?;
    let standard = standard_options(arguments)?;
    let friction = Friction::parse(&arguments.tree.friction).map_err(Failure::input)?;
    let options =
        ProblemOptions { friction, drives: arguments.tree.drive.clone(), ..ProblemOptions::default() };
    let tree = &arguments.tree.of;
    let nominal = match &memory {
        Some(recording) => tree_in(Path::new(&recording.name), Some(recording.rig.clone()), tree)?,
        None => tree_of(path, rig, tree)?,
    };
    if nominal.is_none() {
        refuse_without_tree(arguments)?;
    }
    let stages = Stages::new(&format!("reading {}", path.display()));
    let loaded = match memory {
        Some(recording) => Loaded::of_recording(recording, calibration, tree, &options, &stages)?,
        None => Loaded::read(path, rig, calibration, tree, &options, &stages)?,
    };
    if let Some(words) = &arguments.payload.payload {
        payload::carrier(&loaded, words)?;
    } else {
        known.check(loaded.source().parameters()).map_err(Failure::input)?;
    }
    let mut report = RunReport::of_recording(started, &arguments.output, &loaded, "host");
    report.standard = standard;
    let tare =
        factor::bare(&arguments.tare, rig, calibration, &arguments.tree.of, &options, &mut report.notes)?;
    report.warnings.extend(tare.as_ref().and_then(Tare::warning));
    let span = arguments.forgetting.span(&RowsOf::source(loaded.source()))?;
    let mut found = loaded.fit(span, PLOT_POINTS, &stages)?;
    if tare.is_none() && known.is_empty() && loaded.problem.rig.suspension.is_none() {
        report.keeps_factor = true;
    } else {
        report.factor = Some(loaded.factor(&found));
    }
    if let Some(suspension) = &loaded.problem.rig.suspension {
        super::bare_platform::take_platform_off(suspension, &mut found)?;
    }
    match (&tare, arguments.payload.payload.as_deref()) {
        (Some(tare), Some(words)) => carried(arguments, words, (&loaded, tare), &mut found, &mut report)?,
        (Some(tare), None) => {
            factor::say_taken_off(tare, &mut report.notes);
            factor::take_off(tare, &mut found, &mut report.notes).map_err(Failure::input)?;
        }
        (None, _) => {}
    }
    known.apply(&mut found).map_err(Failure::input)?;
    stages.at("answer", 0.0);
    let out = arguments.output.out.as_deref();
    // What is written while the stages are shown would be mixed with them.
    drop(stages);
    report.finish(&found, || Folder::new(out, "identify").map(Some))
}

/// Puts the fit of what a link carries in the place of the arm's.
///
/// # Errors
/// Bad input: runs of different trees, or rows that see nothing of the link.
fn carried<'a>(
    arguments: &'a Identify,
    words: &str,
    (loaded, tare): (&Loaded, &Tare),
    found: &mut Fit,
    report: &mut RunReport<'a>,
) -> Result<(), Failure> {
    let Some(own) = payload::fit(&arguments.payload, words, loaded, found, tare)? else {
        report.warnings.push(payload::not_to_be_used(words));
        arguments.payload.tell_refused("the recording with the payload cannot be true");
        return Ok(());
    };
    report.notes.push(payload::note(&own.payload.result));
    report.warnings.extend(own.warnings);
    *found = own.fit;
    report.payload = Some(own.payload);
    Ok(())
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
    arguments.payload.check()?;
    if arguments.payload.payload.is_some() && (write_model.is_some() || options.symmetric_sides) {
        return Err(Failure::input(
            "--payload: the answer is about what a link carries; --write-model and --symmetric-sides are about the links: identify \
             these without it",
        ));
    }
    if let Some(path) = write_model {
        write::check_target(path).map_err(Failure::input)?;
    }
    let locked = &options.of.changes.lock;
    Ok(StandardOptions { trust, symmetric: options.symmetric_sides, write_model, locked })
}

/// Refuses options of trees where nothing says which tree.
fn refuse_without_tree(arguments: &Identify) -> Result<(), Failure> {
    let options = &arguments.tree;
    let mut given = vec![
        ("--friction", !options.friction.is_empty()),
        ("--drive", !options.drive.is_empty()),
        ("--symmetric-sides", options.symmetric_sides),
        ("--write-model", options.write_model.is_some()),
        ("--payload", arguments.payload.payload.is_some()),
        ("--nominal-sigma", options.nominal_sigma != 1.0),
    ];
    given.extend(options.of.changed());
    super::loaded::refuse_tree_options(&given)
}
