use std::process::ExitCode;
use std::time::Instant;

use super::arguments::Output;
use super::loaded::{Loaded, StandardOptions};
use super::outcome::{CANNOT_BE_TRUE, say, say_not_written};
use super::payload::Payload;
use super::written_model::WrittenModel;
use super::{ExitStatus, Failure, Folder};
use rigident::answer::result::ExperimentSummary;
use rigident::answer::{Answer, Context, Drift, Source, Status, TimeBase, Tracking};
use rigident::present::{self, Decided, Series, Stage, TimePlot};
use rigident_fit::Fit;
use rigident_fit::pool::PooledFactor;
use rigident_io::rig::RigFile;

/// Everything that a command knows at its end beside the fit.
pub(super) struct RunReport<'a> {
    /// When the command began.
    pub(super) started: Instant,
    pub(super) output: &'a Output,
    pub(super) rig: &'a RigFile,
    /// The recording with its model; `None` where only a factor is at hand.
    pub(super) loaded: Option<&'a Loaded>,
    pub(super) standard: StandardOptions<'a>,
    /// What a link carries, where the fit is of that.
    pub(super) payload: Option<Payload<'a>>,
    pub(super) source: Source,
    /// The parameters asked for; empty: all.
    pub(super) asked: Vec<String>,
    /// The factor to keep: with the fixture in it and without what was known beforehand.
    pub(super) factor: Option<PooledFactor>,
    /// True if the factor to keep is that of the fit that is answered: it is made with the answer.
    pub(super) keeps_factor: bool,
    pub(super) parameter_truth: Option<&'a [f64]>,
    pub(super) stages: Vec<Stage>,
    pub(super) decisions: Vec<Decided>,
    pub(super) drift: Option<Drift>,
    pub(super) tracking: Option<Tracking>,
    pub(super) experiment: Option<ExperimentSummary>,
    /// Plots of the platform's motion, after those of the recording.
    pub(super) motion: Vec<TimePlot>,
    /// Device, serial numbers, calibration dates.
    pub(super) provenance: Vec<(String, String)>,
    pub(super) notes: Vec<String>,
    pub(super) warnings: Vec<String>,
    /// Why the experiment broke off, if it did.
    pub(super) error: Option<String>,
}

impl<'a> RunReport<'a> {
    /// Returns the report of a recording without an experiment.
    pub(super) fn of_recording(started: Instant, output: &'a Output, loaded: &'a Loaded, mcu: &str) -> Self {
        Self {
            loaded: Some(loaded),
            source: loaded.origin(mcu),
            warnings: loaded.warnings.clone(),
            notes: loaded.notes.clone(),
            provenance: super::outcome::provenance(&loaded.problem.rig),
            ..Self::of_factor(started, output, &loaded.problem.rig, Source::default())
        }
    }

    /// Returns the report of a factor alone.
    pub(super) fn of_factor(started: Instant, output: &'a Output, rig: &'a RigFile, source: Source) -> Self {
        Self {
            started,
            output,
            asked: output.estimate.clone(),
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

    /// Concludes the answer, prints it, writes the files and returns the exit status. The folder is made only when there
    /// is an answer.
    ///
    /// # Errors
    /// What was asked for is no parameter, a file cannot be written, or the experiment broke off.
    pub(super) fn finish(
        mut self,
        fit: &Fit,
        folder: impl FnOnce() -> Result<Option<Folder>, Failure>,
    ) -> Result<ExitCode, Failure> {
        let mut answer = self.answer(fit)?;
        let model = self.standard.write_model.and_then(|path| {
            let found = WrittenModel::of(self.loaded?, &self.standard, fit, &answer, path);
            if found.is_none() && answer.is_contradicted() {
                say_not_written(path, CANNOT_BE_TRUE);
            }
            found
        });
        answer.warnings.extend(model.iter().flat_map(|model| model.remarks.iter().cloned()));
        let folder = folder()?;
        answer.elapsed_s = self.started.elapsed().as_secs_f64();
        let json = serde_json::to_string_pretty(&answer)
            .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
        // The answer first: a full disk must not keep it from the user.
        if self.output.json {
            say(json.as_str());
        } else {
            say(present::plain::text(&answer).trim_end());
        }
        let (loads, whole) = self
            .payload
            .as_ref()
            .map_or_else(|| Ok((String::new(), true)), |payload| payload.write(&answer))?;
        if let Some(folder) = folder {
            self.write(fit, &answer, (&json, model.as_ref()), &folder, &loads)?;
        }
        Ok(ExitStatus::of(whole && answer.status == Status::Identified).into())
    }

    /// Concludes the answer; the report's notes and warnings go into it.
    ///
    /// # Errors
    /// What was asked for is no parameter.
    pub(super) fn answer(&mut self, fit: &Fit) -> Result<Answer, Failure> {
        let time_base: Option<TimeBase> = self.loaded.and_then(Loaded::time_base);
        let read = self.warnings.len();
        let context = Context {
            links: self
                .loaded
                .filter(|_| self.payload.is_none())
                .and_then(|loaded| loaded.links(&self.standard)),
            payload: self.payload.as_ref().map(|payload| payload.result.clone()),
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
        let mut answer = Answer::new(fit, context).map_err(Failure::input)?;
        let cause = self.loaded.and_then(|loaded| loaded.judge(fit, &mut answer));
        if self.keeps_factor {
            self.factor = self.loaded.map(|loaded| loaded.factor_of(fit, &answer, read));
        }
        answer.explain(cause, read);
        Ok(answer)
    }

    fn write(
        &mut self,
        fit: &Fit,
        answer: &Answer,
        (json, model): (&str, Option<&WrittenModel>),
        folder: &Folder,
        loads: &str,
    ) -> Result<(), Failure> {
        let is_static = answer.source.rate_hz.is_none() && self.loaded.is_some();
        let origin_s = self.loaded.map_or(0.0, |loaded| loaded.source().time_ns(0) as f64 * 1e-9);
        let mut motion = self.loaded.map_or_else(Vec::new, Loaded::motion);
        motion.append(&mut self.motion);
        let series = Series {
            motion,
            stages: std::mem::take(&mut self.stages),
            decisions: std::mem::take(&mut self.decisions),
            provenance: std::mem::take(&mut self.provenance),
            ..Series::new(fit, answer, is_static, origin_s)
        };
        folder.write("result.json", json.as_bytes())?;
        if let Some(factor) = &self.factor {
            folder.write(&format!("{}.factor", answer.source.recording), &factor.to_bytes())?;
        }
        let page = folder.write("report.html", present::report(answer, &series).as_bytes())?;
        let model = model.map_or_else(|| Ok(String::new()), WrittenModel::write)?;
        let place = folder.path().display();
        if let Some(error) = &self.error {
            return Err(Failure::link(format!("{error}\nWhat came before is in {place}")));
        }
        if !self.output.json {
            say(format_args!("\nFiles in {place}; open {} in a browser{model}{loads}.", page.display()));
        }
        Ok(())
    }
}
