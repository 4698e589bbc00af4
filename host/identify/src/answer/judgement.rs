//! The one judgement: the status of an answer and the state of each parameter, for every subject and every
//! way in.
//!
//! The findings about a recording come in as [`Findings`]; [`Answer::judge`] is the only place that sets a
//! status or a state of an answer by them. A recording that cannot be true has nothing identified: its
//! parameters are contradicted, what derives from them is taken out, and the numbers of its fit are retained
//! apart, in [`super::result::UnusableFit`]. A factor keeps the same judgement of its recording
//! ([`super::checks()`]), since what it was made by is not in it.

use super::context::{Finding, Links};
use super::result::{Answer, ParameterState, SCHEMA, Status, UnusableParameter};
use super::{contradictions, plausibility};
use rigident_fit::{CheckedRun, Fit};

/// Names the fields that an answer that cannot be true does not have.
pub const WITHHELD: [&str; 16] = [
    "mass_kg",
    "com_m",
    "com_u95_m",
    "inertia_com_kgm2",
    "inertia_com_u95_kgm2",
    "inertia_origin_kgm2",
    "principal",
    "body_frame",
    "physically_consistent",
    "consistency",
    "standard_parameters",
    "complete",
    "budget",
    "improvement",
    "prior_dominated",
    "rests_on",
];

/// Holds the findings of a recording, for its answer to be judged by.
pub(super) struct Findings<'a> {
    /// The fit, with what contradicts the rig's errors, the lack of fit, and the checks of runs that only a
    /// factor is left of.
    pub(super) fit: &'a Fit,
    /// True if the bodies would have negative mass.
    pub(super) reversed: bool,
    /// True if no bodies have the parameters.
    pub(super) no_bodies: bool,
    /// True if the motion goes so far beyond the limits of the model that it cannot be.
    pub(super) beyond: bool,
    /// True if the parameters are those of the nominal model but for one large factor.
    pub(super) scaled: bool,
    /// The findings outside of the fit.
    pub(super) others: &'a [Finding],
}

impl<'a> Findings<'a> {
    /// Returns what a fit says by itself, with nothing found of bodies.
    pub(super) fn of(fit: &'a Fit, links: Option<&Links>) -> Self {
        let beyond = links.is_some_and(|links| links.beyond.iter().any(|(_, impossible)| *impossible));
        Self { fit, reversed: false, no_bodies: false, beyond, scaled: false, others: &[] }
    }

    /// Returns true if the recording, or one of those that only a factor is left of, cannot be true.
    pub(super) fn contradict(&self) -> bool {
        let fit = self.fit;
        self.reversed
            || self.no_bodies
            || self.beyond
            || self.scaled
            || self.others.iter().any(|finding| finding.contradicts)
            || contradictions::is_contradicted(fit)
            || !plausibility::of_the_fit(fit).is_empty()
            || fit.lack_of_fit.contradicts()
            || fit.runs.iter().any(CheckedRun::is_contradicted)
    }
}

impl Answer {
    /// Judges an answer whose parameters have the states that rows and prior knowledge give them: sets its
    /// status, and takes out what must not be used. `asked` are the numbers of the parameters that were asked
    /// for.
    pub(super) fn judge(&mut self, findings: &Findings, asked: &[usize]) {
        let is_identified = |j: &&usize| self.parameters.get(**j).is_some_and(|p| p.state.is_identified());
        let identified = asked.iter().filter(is_identified).count();
        let contradicted = findings.contradict();
        self.status = match identified {
            _ if self.error.is_some() => Status::Failed,
            _ if contradicted => Status::Implausible,
            n if n == asked.len() => Status::Identified,
            0 => Status::NotIdentified,
            _ => Status::PartlyIdentified,
        };
        if contradicted {
            self.contradict();
        }
    }

    /// Returns an answer of the earlier schema as one of this one.
    pub(super) fn of_earlier_schema(mut self) -> Self {
        SCHEMA.clone_into(&mut self.schema);
        self.of_file()
    }

    /// Returns an answer as it is read: one that says that its recording cannot be true has no numbers,
    /// whoever wrote it.
    pub(super) fn of_file(mut self) -> Self {
        if self.status == Status::Implausible {
            self.contradict();
            if let Some(person) = &mut self.person {
                person.withhold();
            }
        }
        self
    }

    /// Adds what was found of a person, as far as it may be used.
    #[must_use]
    pub fn with_person(mut self, mut person: super::person::PersonResult) -> Self {
        if self.is_contradicted() {
            person.withhold();
        }
        self.person = Some(person);
        self
    }

    /// Returns true if the recording cannot be true: nothing of it may be used.
    pub fn is_contradicted(&self) -> bool {
        self.status == Status::Implausible || self.fit.is_some()
    }

    /// Makes the answer one of a recording that cannot be true, as where a fault explains what the model
    /// leaves of it.
    pub(crate) fn withhold(&mut self) {
        self.status = Status::Implausible;
        self.contradict();
    }

    /// Makes every number of the fit one that must not be used, and takes out what derives from them:
    /// [`WITHHELD`].
    fn contradict(&mut self) {
        let mut fit = self.fit.take().unwrap_or_default();
        fit.consistency = self.consistency.take().or(fit.consistency);
        for parameter in &mut self.parameters {
            let Some(measured) = parameter.state.measured() else { continue };
            parameter.state = ParameterState::Contradicted;
            fit.parameters.push(UnusableParameter {
                name: parameter.name.clone(),
                unit: parameter.unit.clone(),
                value: measured.value,
                u95: measured.u95,
            });
        }
        self.fit = Some(fit).filter(|fit| !fit.parameters.is_empty() || fit.consistency.is_some());
        self.prior_dominated.clear();
        (self.mass_kg, self.com_m, self.com_u95_m) = (None, None, None);
        (self.inertia_com_kgm2, self.inertia_com_u95_kgm2, self.inertia_origin_kgm2) = (None, None, None);
        self.principal.clear();
        (self.body_frame, self.physically_consistent) = (None, None);
        (self.standard_parameters, self.complete) = (None, None);
        self.budget.clear();
        self.rests_on.clear();
        self.improvement = None;
    }
}
