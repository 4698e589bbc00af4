//! From a recording to an answer.

use std::path::{Path, PathBuf};
use std::time::Instant;

use rigident_shared::forgetting::Span;

use super::bare_platform::take_platform_off;
use super::loaded::{Loaded, PLOT_POINTS, StandardOptions};
use super::recorded::listed;
use super::span::{self, RowsOf};
use super::tare::{Fixture, ReadWith, bare, take_off, taken_off};
use super::tree::{tree_in, tree_of};
use super::{Caller, Error, Identified, Notice, Recorded, Report, Tree, TreeOption, payload};
use rigident_fit::prior::KnownValues;
use rigident_fit::tare::Tare;
use rigident_fit::{Fit, Progress};
use rigident_model::write;
use rigident_rows::tree::ProblemOptions;
use rigident_rows::tree::drive::Friction;

/// The way a recording is identified.
#[derive(Clone, Debug)]
pub struct IdentifyOptions {
    /// Rig file. Default: `NAME.rig.toml` beside the recording; a recording in memory has its own, and this
    /// one is of the fixture's.
    pub rig: Option<PathBuf>,
    /// Calibration of the rig. Default: that of the rig file.
    pub calibration: Option<PathBuf>,
    /// The time for which rows are retained; `None`: all of them.
    pub span: Option<Span<f64>>,
    /// Runs with the bare fixture, which is taken off.
    pub tare: Vec<Fixture>,
    /// The prior knowledge.
    pub known: KnownValues,
    /// The parameters that must be identified: any of m, mc, I, offset, or single names; empty: all.
    pub asked: Vec<String>,
    /// The tree that the recording is of.
    pub tree: Tree,
    /// Friction columns of the joints.
    pub friction: Friction,
    /// Drives that turn with several joints: `NAME=J1+J2`.
    pub drives: Vec<String>,
    /// Relative standard deviation (1 σ) that the nominal model is trusted with where the data leave
    /// something open.
    pub nominal_sigma: f64,
    /// In the standard parameters right links mirror left ones.
    pub symmetric_sides: bool,
    /// The file that a model with the standard parameters is to be written to: [`Identified::model`] writes
    /// it.
    pub write_model: Option<PathBuf>,
    /// The link whose payload is identified, beyond what the tare has: `LINK` or `LINK@x,y,z,roll,pitch,yaw`
    /// in m and degrees.
    pub payload: Option<String>,
}

impl Default for IdentifyOptions {
    fn default() -> Self {
        Self {
            rig: None,
            calibration: None,
            span: None,
            tare: Vec::new(),
            known: KnownValues::default(),
            asked: Vec::new(),
            tree: Tree::default(),
            friction: Friction::default(),
            drives: Vec::new(),
            nominal_sigma: 1.0,
            symmetric_sides: false,
            write_model: None,
            payload: None,
        }
    }
}

impl IdentifyOptions {
    /// Refuses what goes together with no recording.
    fn check(&self) -> Result<(), Error> {
        let trust = self.nominal_sigma;
        if !trust.is_finite() || trust <= 0.0 {
            return Err(Error::NominalSigma(trust));
        }
        if self.payload.is_some() && self.tare.is_empty() {
            return Err(Error::PayloadWithoutTare);
        }
        if self.payload.is_some() && (self.write_model.is_some() || self.symmetric_sides) {
            return Err(Error::PayloadAndLinks);
        }
        if let Some(path) = &self.write_model {
            write::check_target(path)?;
        }
        Ok(())
    }

    fn standard(&self) -> StandardOptions<'_> {
        StandardOptions {
            trust: self.nominal_sigma,
            symmetric: self.symmetric_sides,
            write_model: self.write_model.as_deref(),
            locked: &self.tree.changes.lock,
        }
    }

    /// Returns what is asked of a tree, if anything is: the first of it.
    fn asked_of_tree(&self) -> Option<TreeOption> {
        let given = [
            (TreeOption::Friction, self.friction != Friction::default()),
            (TreeOption::Drives, !self.drives.is_empty()),
            (TreeOption::SymmetricSides, self.symmetric_sides),
            (TreeOption::WriteModel, self.write_model.is_some()),
            (TreeOption::Payload, self.payload.is_some()),
            (TreeOption::NominalSigma, self.nominal_sigma != 1.0),
        ];
        let first = given.into_iter().find(|(_, is_given)| *is_given).map(|(option, _)| option);
        first.or_else(|| self.tree.asked())
    }
}

/// Identifies the body, or the tree of links, of a recording.
///
/// # Errors
/// [`Error`] says why there is no answer; of a recording that cannot be true there is one, which says so.
pub fn identify(
    recording: Recorded,
    options: &IdentifyOptions,
    caller: &Caller<'_>,
) -> Result<Identified, Error> {
    caller.stoppable(|| identified(recording, options, caller))
}

fn identified(
    recording: Recorded,
    options: &IdentifyOptions,
    caller: &Caller<'_>,
) -> Result<Identified, Error> {
    let started = Instant::now();
    options.check()?;
    let recording = match recording {
        Recorded::File(path) => Recorded::File(listed(path)),
        memory @ Recorded::Memory(_) => memory,
    };
    let (rig, calibration) = (options.rig.as_deref(), options.calibration.as_deref());
    let problem = ProblemOptions {
        friction: options.friction.clone(),
        drives: options.drives.clone(),
        ..ProblemOptions::default()
    };
    let tree = &options.tree;
    if let Some(option) = options.asked_of_tree() {
        let nominal = match &recording {
            Recorded::Memory(own) => tree_in(Path::new(&own.name), Some(own.rig.clone()), tree)?,
            Recorded::File(path) => tree_of(path, rig, tree)?,
        };
        if nominal.is_none() {
            return Err(Error::OnlyForTrees(option));
        }
    }
    caller.stage(&format!("reading {}", recording.name()), 0.0);
    let loaded = Loaded::of(recording, rig, calibration, tree, &problem, caller)?;
    match &options.payload {
        Some(words) => {
            payload::carrier(&loaded, words)?;
        }
        None => options.known.check(loaded.source().parameters())?,
    }
    let mut report = Report::of_recording(&loaded, "host");
    (report.asked, report.standard) = (options.asked.clone(), options.standard());
    let tare = bare(&options.tare, ReadWith { rig, calibration, tree }, &problem, &mut report.notes, caller)?;
    report.warnings.extend(tare.as_ref().and_then(Tare::warning));
    let span = span::checked(options.span, &RowsOf::source(loaded.source()))?;
    let mut found = loaded.fit(span, PLOT_POINTS, caller)?;
    let suspension = loaded.problem.rig.suspension.as_ref();
    if tare.is_none() && options.known.is_empty() && suspension.is_none() {
        report.keeps_factor = true;
    } else {
        report.factor = Some(loaded.factor(&found));
    }
    if let Some(suspension) = suspension {
        take_platform_off(suspension, &mut found)?;
    }
    match (&tare, options.payload.as_deref()) {
        (Some(tare), Some(words)) => carried(words, (&loaded, tare), &mut found, &mut report, caller)?,
        (Some(tare), None) => {
            report.notes.push(taken_off(tare));
            take_off(tare, &mut found, &mut report.notes)?;
        }
        (None, _) => {}
    }
    options.known.apply(&mut found)?;
    caller.stage("answer", 0.0);
    let mut answered = report.conclude(found, caller)?;
    answered.answer.elapsed_s = started.elapsed().as_secs_f64();
    Ok(answered)
}

/// Puts the fit of what a link carries in the place of the arm's.
///
/// # Errors
/// Runs of different trees, or rows that see nothing of the link.
fn carried(
    words: &str,
    (loaded, tare): (&Loaded, &Tare),
    found: &mut Fit,
    report: &mut Report<'_>,
    caller: &Caller<'_>,
) -> Result<(), Error> {
    let Some(own) = payload::fit(words, loaded, found, tare)? else {
        report.warnings.push(caller.words(&Notice::PayloadNotUsed(words.to_owned())));
        return Ok(());
    };
    let (link, without) = (own.result.link.clone(), own.result.without.clone());
    report.notes.push(caller.words(&Notice::Payload { link, without }));
    report.warnings.extend(own.warnings);
    *found = own.fit;
    report.payload = Some(own.result);
    Ok(())
}
