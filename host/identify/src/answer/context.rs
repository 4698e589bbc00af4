//! The data that an answer needs beside a fit.

use std::time::SystemTime;

use super::payload::PayloadResult;
use super::result::{Drift, ExperimentSummary, Source, TimeBase, Tracking};
use rigident_fit::DriveMotion;
use rigident_io::rig::{BodyTable, TruthTable};
use rigident_model::Model;
use rigident_model::base::{BaseParameters, Situation};

/// The circumstances of a fit that its answer tells.
#[derive(Clone, Debug)]
pub struct Context<'a> {
    /// The tree, where base parameters were estimated.
    pub links: Option<Links<'a>>,
    /// The link that carries the one body, and the runs without it; no load yet.
    pub payload: Option<PayloadResult>,
    /// The customer's frame, for one body.
    pub body: Option<&'a BodyTable>,
    /// The true body, given beside the answer and never used by it.
    pub truth: Option<&'a TruthTable>,
    /// True values of the parameters in their order, likewise.
    pub parameter_truth: Option<&'a [f64]>,
    /// The words of `--estimate`.
    pub asked: &'a [String],
    /// The origin of the numbers.
    pub source: Source,
    /// The way several files became one recording.
    pub time_base: Option<TimeBase>,
    /// Why the experiment broke off, if it did.
    pub error: Option<String>,
    /// Information that asks for nothing.
    pub notes: Vec<String>,
    /// The warnings that a user should act on, beyond what the fit says itself.
    pub warnings: Vec<String>,
    /// The findings outside of the fit, to be judged with it; said after all other warnings.
    pub findings: Vec<Finding>,
    /// Standard deviation (1 σ) of the rates in the rows, rad/s, for the note on its effect; zero: not known.
    pub rate_sigma: f64,
    /// The tracking of a platform.
    pub tracking: Option<Tracking>,
    /// The course of an experiment that decides for itself.
    pub experiment: Option<ExperimentSummary>,
    /// First against last pose.
    pub drift: Option<Drift>,
    /// Date and time of the run, RFC 3339; by default now.
    pub date: String,
}

impl Default for Context<'_> {
    fn default() -> Self {
        Self {
            links: None,
            payload: None,
            body: None,
            truth: None,
            parameter_truth: None,
            asked: &[],
            source: Source::default(),
            time_base: None,
            error: None,
            notes: Vec::new(),
            warnings: Vec::new(),
            findings: Vec::new(),
            rate_sigma: 0.0,
            tracking: None,
            experiment: None,
            drift: None,
            date: now(),
        }
    }
}

/// The findings about a recording outside of its fit.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Finding {
    /// It in words, with what to do about it.
    pub text: String,
    /// True if the recording cannot be true with it, so that the answer is implausible.
    pub contradicts: bool,
}

impl Finding {
    /// Returns something to act on, with which the recording may be true.
    pub fn warning(text: impl Into<String>) -> Self {
        Self { text: text.into(), contradicts: false }
    }

    /// Returns something with which the recording cannot be true.
    pub fn contradiction(text: impl Into<String>) -> Self {
        Self { text: text.into(), contradicts: true }
    }
}

/// Returns date and time, UTC, as RFC 3339 has it.
pub fn now() -> String {
    humantime::format_rfc3339_seconds(SystemTime::now()).to_string()
}

/// A tree whose base parameters are the first columns of a fit.
#[derive(Clone, Debug)]
pub struct Links<'a> {
    /// The model of the rows, fixed joints welded.
    pub model: &'a Model,
    /// The base parameters, in the order of the columns.
    pub base: &'a BaseParameters,
    /// The measured quantities and the kind of base.
    pub situation: Situation,
    /// Motion of the drives that have parameters.
    pub drives: Vec<DriveMotion>,
    /// Parameters of drives that there are because the model states them, by name: without them an answer is
    /// whole.
    pub as_stated: &'a [String],
    /// Why some parameters cannot be identified in this motion, as found before the fit.
    pub idle: Vec<String>,
    /// The quantities beyond the limits of the model, and whether it is so far beyond that it cannot be.
    pub beyond: Vec<(String, bool)>,
    /// The way standard parameters are sought; `None`: not at all.
    pub standard: Option<StandardRequest<'a>>,
}

/// A request for standard parameters of every link.
#[derive(Clone, Copy, Debug)]
pub struct StandardRequest<'a> {
    /// The nominal model as its file has it, links on fixed joints on their own.
    pub nominal: &'a Model,
    /// Relative standard deviation (1 σ) that it is trusted with.
    pub trust: f64,
    /// True if right links mirror left ones.
    pub symmetric: bool,
    /// True if an answer without them is an error.
    pub required: bool,
}

impl<'a> StandardRequest<'a> {
    /// Returns the request for those nearest to a nominal model, as far as there are any.
    pub fn of(nominal: &'a Model) -> Self {
        Self { nominal, trust: 1.0, symmetric: false, required: false }
    }
}
