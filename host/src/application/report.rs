//! The results of a job at its end, and the conclusions from them.

use rigident_fit::Fit;
use rigident_fit::pool::PooledFactor;
use rigident_identify::answer::result::ExperimentSummary;
use rigident_identify::answer::{Answer, Context, Drift, Source, Status, TimeBase, Tracking};
use rigident_io::rig::RigFile;
use rigident_present::{self, Decided, Series, Stage, TimePlot};

use super::loaded::{Loaded, StandardOptions};
use super::{Caller, Covariance, Error, WrittenModel};
use rigident_identify::answer::payload::PayloadResult;

/// Everything that a job knows at its end beside the fit.
pub struct Report<'a> {
    /// The rig file.
    pub rig: &'a RigFile,
    /// The recording with its model; `None` where only a factor is at hand.
    pub loaded: Option<&'a Loaded>,
    /// The way standard parameters of links are sought.
    pub standard: StandardOptions<'a>,
    /// The load of a link, if the fit is of that.
    pub payload: Option<PayloadResult>,
    /// The origin of the numbers.
    pub source: Source,
    /// The parameters asked for; empty: all.
    pub asked: Vec<String>,
    /// The factor to keep: with the fixture in it and without what was known beforehand.
    pub factor: Option<PooledFactor>,
    /// True if the factor to keep is that of the fit that is answered: it is made with the answer.
    pub keeps_factor: bool,
    /// True values of the parameters in their order, where they are known; never used for the answer.
    pub parameter_truth: Option<&'a [f64]>,
    /// Stages of an experiment.
    pub stages: Vec<Stage>,
    /// Segments that were decided on while it lasted.
    pub decisions: Vec<Decided>,
    /// First against last pose.
    pub drift: Option<Drift>,
    /// The tracking of a platform.
    pub tracking: Option<Tracking>,
    /// The course of an experiment that decides for itself.
    pub experiment: Option<ExperimentSummary>,
    /// Plots of the platform's motion, after those of the recording.
    pub motion: Vec<TimePlot>,
    /// Device, serial numbers, calibration dates.
    pub provenance: Vec<(String, String)>,
    /// Things that were done, as information.
    pub notes: Vec<String>,
    /// Things to act on.
    pub warnings: Vec<String>,
    /// Why the experiment broke off, if it did.
    pub error: Option<String>,
}

impl<'a> Report<'a> {
    /// Returns the report of a recording without an experiment.
    pub fn of_recording(loaded: &'a Loaded, mcu: &str) -> Self {
        Self {
            loaded: Some(loaded),
            source: loaded.origin(mcu),
            warnings: loaded.warnings.clone(),
            notes: loaded.notes.clone(),
            provenance: provenance(&loaded.problem.rig),
            ..Self::of_factor(&loaded.problem.rig, Source::default())
        }
    }

    /// Returns the report of a factor alone.
    pub fn of_factor(rig: &'a RigFile, source: Source) -> Self {
        Self {
            asked: Vec::new(),
            rig,
            loaded: None,
            standard: StandardOptions::DEFAULT,
            payload: None,
            source,
            factor: None,
            keeps_factor: false,
            parameter_truth: None,
            stages: Vec::new(),
            decisions: Vec::new(),
            drift: None,
            tracking: None,
            experiment: None,
            motion: Vec::new(),
            provenance: Vec::new(),
            notes: Vec::new(),
            warnings: Vec::new(),
            error: None,
        }
    }

    /// Concludes the answer of a fit, with all that is stored, written and shown of it.
    ///
    /// # Errors
    /// [`Error::Answer`] if what was asked for is no parameter.
    pub fn conclude(mut self, fit: Fit, caller: &Caller<'_>) -> Result<Identified, Error> {
        let mut answer = self.answer(&fit, caller)?;
        let model = self
            .standard
            .write_model
            .zip(self.loaded)
            .and_then(|(path, loaded)| WrittenModel::of(loaded, &self.standard, &fit, &answer, path));
        answer.warnings.extend(model.iter().flat_map(|model| model.remarks.iter().cloned()));
        let mut motion = self.loaded.map_or_else(Vec::new, Loaded::motion);
        motion.append(&mut self.motion);
        let shown = Shown {
            is_static: answer.source.rate_hz.is_none() && self.loaded.is_some(),
            origin_s: self.loaded.map_or(0.0, |loaded| loaded.source().time_ns(0) as f64 * 1e-9),
            motion,
            stages: self.stages,
            decisions: self.decisions,
            provenance: self.provenance,
        };
        let rig = self.rig.clone();
        Ok(Identified { answer, fit, rig, factor: self.factor, model, error: self.error, shown })
    }

    /// Concludes the answer alone; the report's notes and warnings go into it.
    ///
    /// # Errors
    /// [`Error::Answer`] if what was asked for is no parameter.
    pub fn answer(&mut self, fit: &Fit, caller: &Caller<'_>) -> Result<Answer, Error> {
        let time_base: Option<TimeBase> = self.loaded.and_then(Loaded::time_base);
        let read = self.warnings.len();
        let context = Context {
            links: self
                .loaded
                .filter(|_| self.payload.is_none())
                .and_then(|loaded| loaded.links(&self.standard)),
            payload: self.payload.clone(),
            body: self.rig.body.as_ref(),
            truth: self.rig.truth.as_ref(),
            parameter_truth: self.parameter_truth,
            asked: &self.asked,
            source: std::mem::take(&mut self.source),
            time_base,
            error: self.error.clone(),
            notes: std::mem::take(&mut self.notes),
            warnings: std::mem::take(&mut self.warnings),
            rate_sigma: self.loaded.map_or(0.0, |loaded| loaded.source().rate_sigma()),
            tracking: self.tracking.take(),
            experiment: self.experiment.take(),
            drift: self.drift.take(),
            findings: self.loaded.map_or_else(Vec::new, |loaded| loaded.problem.findings.clone()),
            ..Context::default()
        };
        let mut answer = Answer::new(fit, context)?;
        let cause = self.loaded.and_then(|loaded| loaded.judge(fit, &mut answer, caller));
        if self.keeps_factor {
            self.factor = self.loaded.map(|loaded| loaded.factor_of(fit, &answer, read));
        }
        answer.explain(cause, read);
        Ok(answer)
    }
}

/// The content of a page beside answer and fit.
#[derive(Clone, Debug)]
struct Shown {
    is_static: bool,
    origin_s: f64,
    motion: Vec<TimePlot>,
    stages: Vec<Stage>,
    decisions: Vec<Decided>,
    provenance: Vec<(String, String)>,
}

/// An answer with all that it rests on.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The answer.
    pub answer: Answer,
    /// The fit that it is of.
    pub fit: Fit,
    /// The rig file.
    pub rig: RigFile,
    /// All that the recording says, to merge and to solve again; `None` of a factor's own answer.
    pub factor: Option<PooledFactor>,
    /// The model to be written; `None` if none was asked for, or the answer has no standard parameters.
    pub model: Option<WrittenModel>,
    /// Why the experiment broke off, if it did.
    pub error: Option<String>,
    shown: Shown,
}

impl Identified {
    /// Returns true if everything that was asked for is identified.
    pub fn is_whole(&self) -> bool {
        self.answer.status == Status::Identified
    }

    /// Returns the name of the file that keeps the factor.
    pub fn factor_name(&self) -> String {
        format!("{}.factor", self.answer.source.recording)
    }

    /// Returns the covariance of the numbers of the answer.
    ///
    /// ```
    /// use rigident::application::{Caller, IdentifyOptions, identify};
    ///
    /// let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/examples/bracket.csv");
    /// let found = identify(path.into(), &IdentifyOptions::default(), &Caller::default())?;
    /// let covariance = found.covariance();
    /// assert_eq!(covariance.names[0], "m");
    /// let u95 = found.answer.parameters[0].state.measured().unwrap().u95;
    /// assert!((1.96 * covariance.matrix[(0, 0)].sqrt() / u95 - 1.0).abs() < 1e-3);
    /// # Ok::<(), rigident::application::Error>(())
    /// ```
    pub fn covariance(&self) -> Covariance {
        Covariance::of(&self.answer, &self.fit)
    }

    /// Returns the page of the answer, HTML.
    pub fn page(&self) -> String {
        let shown = self.shown.clone();
        let series = Series {
            motion: shown.motion,
            stages: shown.stages,
            decisions: shown.decisions,
            provenance: shown.provenance,
            ..Series::new(&self.fit, &self.answer, shown.is_static, shown.origin_s)
        };
        rigident_present::report(&self.answer, &series)
    }
}

/// Returns serial numbers and calibration dates of a rig file, label and value.
pub fn provenance(rig: &RigFile) -> Vec<(String, String)> {
    let mut notes = Vec::new();
    let mut add = |what: &str, value: &Option<String>| {
        if let Some(value) = value {
            notes.push((what.to_owned(), value.clone()));
        }
    };
    add("Load cell, serial number", &rig.load_cell.serial);
    add("Load cell, calibrated on", &rig.load_cell.calibrated_on);
    if let Some(calibration) = rig.calibrated() {
        add("Rig, calibrated on", &Some(format!("{} ({})", calibration.date, calibration.name)));
    }
    if let Some(imu) = rig.imu.first() {
        add("IMU, serial number", &imu.serial);
        add("IMU, calibrated on", &imu.calibrated_on);
    }
    notes
}
