//! Sources of rows from recordings: what is identified, and from what.
//!
//! A [`Problem`] holds a [`RowSource`] with what is known of the thing itself: one rigid body
//! ([`rigident_rows::body`]) or a tree of links ([`rigident_rows::tree`]), in motion or in still poses, from
//! one file or from several with clocks of their own; either on springs ([`rigident_vibration::suspension`]).

#[cfg(test)]
mod arm_tests;
pub mod clocks;
pub mod instruments;

use self::clocks::{Aligned, Pose, StreamError, StreamSet, align};
use self::instruments::instrument;
use crate::answer::result::TimeBase;
use crate::answer::{self, Links, StandardRequest};
use rigident_fit::{DeviceFactor, Fit, FitError, FitOptions, Progress, RowSource, fit, fit_device};
use rigident_io::recording::Recording;
use rigident_io::rig::RigFile;
use rigident_model::{Finding, Model};
use rigident_rows::body::BodySource;
use rigident_rows::body::prepare::{PrepareError, prepare, prepare_owned};
pub use rigident_rows::tree::ProblemOptions;
use rigident_rows::tree::limits::beyond;
use rigident_rows::tree::{self, TreePrepareError, TreeSource, TreeSourceError};
use rigident_vibration::suspension::bare::massless;
use rigident_vibration::suspension::by_modes::contradiction;
use rigident_vibration::suspension::{self, SuspendedSource, SuspensionError};

/// The reason that a recording poses no problem that can be solved.
#[derive(Debug, thiserror::Error)]
pub enum ProblemError {
    /// Columns or keys are missing or impossible, for one body.
    #[error(transparent)]
    Body(#[from] PrepareError),
    /// Columns or keys are missing or impossible, for a tree.
    #[error(transparent)]
    Tree(#[from] TreePrepareError),
    /// The model has no base parameters, or the frames do not fit it.
    #[error(transparent)]
    Model(#[from] TreeSourceError),
    /// Poses of a platform on springs make no rows.
    #[error(transparent)]
    Suspension(#[from] Box<SuspensionError>),
    /// Several files make no recording.
    #[error(transparent)]
    Streams(#[from] StreamError),
    /// There is no fit.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// The thing that is identified.
pub enum Subject {
    /// One rigid body.
    Body {
        /// The source of its rows.
        source: Box<BodySource>,
        /// True if its specific force is that of gravity columns, in the axes of S; an IMU was not used.
        gravity_columns: bool,
    },
    /// A tree of links.
    Tree {
        /// The source of its rows.
        source: Box<TreeSource>,
        /// Joints that never move, a base that never turns.
        idle: Vec<Finding>,
    },
    /// One body, or a tree of links, on a platform that springs carry.
    Suspended {
        /// The source of its rows.
        source: Box<SuspendedSource>,
        /// Joints that never move.
        idle: Vec<Finding>,
    },
}

/// A recording with its rig file and model, ready to be fitted.
pub struct Problem {
    /// Name of the recording.
    pub name: String,
    /// The rig file with every calibration done.
    pub rig: RigFile,
    /// The thing that is identified, with its rows.
    pub subject: Subject,
    /// The steps and findings on the way, in words.
    pub notes: Vec<String>,
    /// The warnings that a user should act on, as far as it was seen before the fit.
    pub warnings: Vec<String>,
    /// The findings outside of the rows, for an answer to be judged by.
    pub findings: Vec<answer::Finding>,
    /// Several files with clocks of their own.
    clocks: Option<Box<Clocks>>,
}

/// Several files with clocks of their own, and what was identified from them.
struct Clocks {
    set: StreamSet,
    aligned: Aligned,
    tree: Option<(Model, ProblemOptions)>,
}

impl Problem {
    /// Poses the problem of a recording: a tree's if there is a model, else one body's.
    ///
    /// # Errors
    /// [`ProblemError`] says what is missing or does not fit.
    pub fn from_recording(
        recording: &Recording,
        model: Option<&Model>,
        options: &ProblemOptions,
    ) -> Result<Self, ProblemError> {
        if recording.rig.suspension.is_some() {
            return Self::on_springs(recording, model);
        }
        let Some(model) = model else { return Self::of_body(recording.clone()) };
        let prepared = tree::prepare::prepare(recording, model, options)?;
        Ok(Self {
            name: recording.name.clone(),
            rig: recording.rig.clone(),
            subject: Subject::Tree {
                source: Box::new(TreeSource::new(prepared.input)?),
                idle: prepared.idle,
            },
            notes: prepared.notes,
            warnings: prepared.warnings,
            findings: Vec::new(),
            clocks: None,
        })
    }

    /// Poses the problem of one body's recording that is needed no more: its numbers are held once.
    ///
    /// # Errors
    /// [`ProblemError`] says what is missing or does not fit.
    pub fn of_body(recording: Recording) -> Result<Self, ProblemError> {
        if recording.rig.suspension.is_some() {
            return Self::on_springs(&recording, None);
        }
        let name = recording.name.clone();
        let prepared = prepare_owned(recording)?;
        let source = Box::new(BodySource::new(prepared.input, prepared.rig.imu.first()));
        Ok(Self {
            name,
            rig: prepared.rig,
            subject: Subject::Body { source, gravity_columns: prepared.gravity_columns },
            notes: prepared.notes,
            warnings: Vec::new(),
            findings: Vec::new(),
            clocks: None,
        })
    }

    /// Poses the problem of a recording on springs.
    fn on_springs(recording: &Recording, model: Option<&Model>) -> Result<Self, ProblemError> {
        let prepared = suspension::prepare(recording, model).map_err(Box::new)?;
        let mut notes = prepared.notes;
        notes.extend(recording.rig.suspension.as_ref().and_then(massless));
        let judged = match prepared.source.is_body() {
            true => contradiction(recording, prepared.source.support()),
            false => Ok(None),
        };
        let (findings, warnings) = match judged {
            Ok(found) => (found.map(answer::Finding::contradiction).into_iter().collect(), Vec::new()),
            Err(why) => (Vec::new(), vec![why]),
        };
        Ok(Self {
            name: recording.name.clone(),
            rig: recording.rig.clone(),
            subject: Subject::Suspended { source: Box::new(prepared.source), idle: prepared.idle },
            notes,
            warnings,
            findings,
            clocks: None,
        })
    }

    /// Poses the problem of several files with clocks of their own: a tree's if there is a model, else one
    /// body's.
    ///
    /// # Errors
    /// [`ProblemError`] if they have nothing in common, or cannot be identified.
    pub fn from_streams(
        mut set: StreamSet,
        model: Option<&Model>,
        options: &ProblemOptions,
    ) -> Result<Self, ProblemError> {
        set.settle(model.is_none())?;
        let tree = model.map(|model| (model.clone(), options.clone()));
        let aligned = match &tree {
            None => align(&set, None)?,
            Some((model, options)) => align(&set, Some(&|recording| tree_source(recording, model, options)))?,
        };
        let mut problem = Self::from_recording(&aligned.recording, model, options)?;
        problem.warnings.extend(aligned.warnings.iter().cloned());
        problem.clocks = Some(Box::new(Clocks { set, aligned, tree }));
        Ok(problem)
    }

    /// Wraps a subject that is ready, with its rig file.
    pub fn new(name: &str, rig: RigFile, subject: Subject) -> Self {
        Self {
            name: name.to_owned(),
            rig,
            subject,
            notes: Vec::new(),
            warnings: Vec::new(),
            findings: Vec::new(),
            clocks: None,
        }
    }

    /// Returns the rows.
    pub fn source(&self) -> &dyn RowSource {
        match &self.subject {
            Subject::Body { source, .. } => &**source,
            Subject::Tree { source, .. } => &**source,
            Subject::Suspended { source, .. } => &**source,
        }
    }

    /// Returns the rows alone.
    pub(crate) fn into_source(self) -> Box<dyn RowSource> {
        match self.subject {
            Subject::Body { source, .. } => source,
            Subject::Tree { source, .. } => source,
            Subject::Suspended { source, .. } => source,
        }
    }

    /// Returns the source of a tree's rows; `None` of one body.
    pub fn tree(&self) -> Option<&TreeSource> {
        match &self.subject {
            Subject::Tree { source, .. } => Some(source),
            Subject::Body { .. } | Subject::Suspended { .. } => None,
        }
    }

    /// Returns the tree for an answer, with the request for its standard parameters; `None` of one body.
    pub fn links<'a>(&'a self, standard: Option<StandardRequest<'a>>) -> Option<Links<'a>> {
        let (input, base, drives, idle) = match &self.subject {
            Subject::Body { .. } => return None,
            Subject::Tree { source, idle } => (source.input(), source.base(), source.drive_motions(), idle),
            Subject::Suspended { source, .. } if source.is_body() => return None,
            Subject::Suspended { source, idle } => (source.input(), source.base(), Vec::new(), idle),
        };
        Some(Links {
            model: &input.model,
            base,
            situation: input.situation,
            drives,
            as_stated: &input.as_stated,
            idle: idle.iter().map(ToString::to_string).collect(),
            beyond: beyond(input).into_iter().map(|b| (b.text, b.impossible)).collect(),
            standard,
        })
    }

    /// Returns how several files became one recording; `None` of a single file.
    pub fn time_base(&self) -> Option<&TimeBase> {
        self.clocks.as_ref().map(|clocks| &clocks.aligned.time_base)
    }

    /// Returns several files as one recording, their clocks set; `None` of a single file.
    pub fn aligned(&self) -> Option<&Recording> {
        self.clocks.as_ref().map(|clocks| &clocks.aligned.recording)
    }

    /// Fits the parameters; the uncertainty of several clocks is counted.
    ///
    /// # Errors
    /// [`ProblemError::Fit`] if there are no rows, [`ProblemError::Streams`] if shifted clocks leave none.
    pub fn fit(&self, options: &FitOptions, progress: &dyn Progress) -> Result<Fit, ProblemError> {
        let mut found = fit(self.source(), options, progress)?;
        if let Some(clocks) = &self.clocks {
            let Clocks { set, aligned, tree } = &**clocks;
            let pose: &Pose<'_> = &|recording| match tree {
                None => body_source(recording),
                Some((model, options)) => tree_source(recording, model, options),
            };
            found.count_shifts(&clocks::shifts::moves(set, aligned, pose)?);
            // The kernel smooths: on the grid differences show less noise than a stream has.
            found.stated_noise.retain(|noise| noise.far_off().is_some_and(|ratio| ratio > 1.0));
        }
        found.name_instruments(|error| instrument(&self.rig, error));
        Ok(found)
    }

    /// Judges a factor that a device made of this recording.
    ///
    /// # Errors
    /// [`ProblemError`] if the factor is of other parameters, or there are no rows.
    pub fn fit_device(
        self,
        device: &DeviceFactor,
        options: &FitOptions,
        progress: &dyn Progress,
    ) -> Result<(Self, Fit), ProblemError> {
        let subject = match self.subject {
            Subject::Tree { source, idle } => {
                Subject::Tree { source: Box::new(source.in_device_order()?), idle }
            }
            other @ (Subject::Body { .. } | Subject::Suspended { .. }) => other,
        };
        let problem = Self { subject, ..self };
        let mut found = fit_device(problem.source(), device, options, progress)?;
        found.name_instruments(|error| instrument(&problem.rig, error));
        Ok((problem, found))
    }
}

fn body_source(recording: &Recording) -> Result<Box<dyn RowSource>, StreamError> {
    let prepared = prepare(recording)?;
    Ok(Box::new(BodySource::new(prepared.input, prepared.rig.imu.first())))
}

fn tree_source(
    recording: &Recording,
    model: &Model,
    options: &ProblemOptions,
) -> Result<Box<dyn RowSource>, StreamError> {
    let prepared = tree::prepare::prepare(recording, model, options)?;
    let source = TreeSource::new(prepared.input).map_err(|error| StreamError::Rows(error.to_string()))?;
    Ok(Box::new(source))
}
