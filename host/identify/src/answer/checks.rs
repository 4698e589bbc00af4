//! Checks of the recordings behind factors: what is stored with a factor, and what an answer says of it.

use super::judgement::Findings;
use super::result::{Answer, Cause, Run, RunVerdict};
use super::{contradictions, plausibility, remarks};
use rigident_fit::figures::significant;
use rigident_fit::{Checks, Fit};

/// Returns what the checks of a recording find by its fit alone, for its factor to keep. `warnings` are those
/// of its reading; `of_links` is true if a model of links is behind the rows. [`Answer::checks`] has the
/// verdict of the model, too.
pub fn checks(fit: &Fit, warnings: &[String], of_links: bool) -> Checks {
    let mut all = Answer { warnings: warnings.to_vec(), ..Answer::default() };
    all.warnings.extend(contradictions::contradictions(fit));
    all.warnings.extend(plausibility::of_the_fit(fit));
    all.warnings.extend(remarks::of_the_fit(fit, of_links, 0.0).1);
    all.add_lack_of_fit(fit);
    Checks { contradicted: Findings::of(fit, None).contradict(), warnings: all.warnings }
}

impl Answer {
    /// Returns the verdict of this answer for the factor of its fit to keep, which holds no model: what no
    /// bodies have, a motion beyond the limits, another unit. `warnings` are those of reading the recording,
    /// and the answer's first `skipped` ones are not of the fit.
    pub fn checks(&self, fit: &Fit, warnings: &[String], skipped: usize) -> Checks {
        let mut all = checks(fit, warnings, self.model.is_some());
        if self.is_contradicted() {
            all.contradicted = true;
            let own = self.warnings.iter().skip(skipped);
            let own = own.filter(|own| !all.warnings.contains(own)).cloned().collect::<Vec<_>>();
            all.warnings.extend(own);
        }
        all
    }

    /// Adds the fault that explains why the recording cannot be true. What else was said follows from it, and
    /// is information: all but the first `kept` warnings, those of reading the recording.
    pub fn explain(&mut self, cause: Option<Cause>, kept: usize) {
        let Some(cause) = cause else { return };
        let others: Vec<String> = cause.alternatives.iter().map(|what| format!(", or {what}")).collect();
        let effect = if cause.confirmed {
            "without it the recording can be true".to_owned()
        } else if cause.ambiguous {
            "without any one of these the recording can be true".to_owned()
        } else {
            format!(
                "without it residuals are {} of what they are, and something is left",
                percent(cause.residuals_left)
            )
        };
        let said = format!("most likely {}{}: {effect}; {}", cause.what, others.concat(), cause.remedy);
        if cause.confirmed || cause.ambiguous {
            self.notes.extend(self.warnings.drain(kept.min(self.warnings.len())..));
        }
        self.warnings.insert(0, said);
        self.cause = Some(cause);
    }

    /// Adds the runs that only a factor is left of, with what their checks found.
    pub(super) fn add_runs(&mut self, fit: &Fit) {
        for run in &fit.runs {
            let name = &run.recording;
            let (verdict, warnings) = match &run.checks {
                Some(checks) if checks.contradicted => (RunVerdict::Implausible, checks.warnings.as_slice()),
                Some(checks) => (RunVerdict::Plausible, checks.warnings.as_slice()),
                None => (RunVerdict::NotChecked, &[][..]),
            };
            if run.checks.is_none() {
                self.warnings.push(format!(
                    "{name}: its factor carries no checks of the recording, so that nothing says if it is \
                     plausible; write the factor anew with `factor()`"
                ));
            }
            // Of a single run the residuals say the same here.
            let own = warnings.iter().filter(|warning| !self.warnings.contains(warning));
            let named: Vec<String> = own.map(|warning| format!("{name}: {warning}")).collect();
            self.warnings.extend(named);
            self.runs.push(Run { recording: name.clone(), verdict });
        }
    }
}

/// Returns a share in per cent.
fn percent(share: f64) -> String {
    format!("{} %", significant(100.0 * share, 2))
}
