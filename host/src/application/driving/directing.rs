//! An experiment whose segments are decided one by one while the device estimates.

use hexapod::{Axis, BodySet, Geometry, MotionProgram, Segment};
use rigident_shared::wire::{EstimateReport, Settings};

use super::super::Course;
use super::{Attendant, DrivingError};
use rigident_device::platform::PlatformError;
use rigident_device::session::{Director, Proposal};
use rigident_fit::Factor;
use rigident_fit::figures::significant;
use rigident_identify::answer::result::{ExperimentSummary, SegmentSummary};
use rigident_io::rig::RigFile;
use rigident_plan::adaptive::library::word;
use rigident_plan::adaptive::planner::Known;
use rigident_plan::adaptive::{
    Asked, Decision, Forecast, Foreseen, Information, Next, Observed, Planner, RigModel,
};
use rigident_plan::machine;
use rigident_present::{Decided, Stage};

/// Share of the largest principal moment unless asked otherwise.
const TENSOR_SHARE: f64 = 0.01;

/// After this long no further segment begins unless asked otherwise, s.
const AT_MOST_S: f64 = 300.0;

/// An identified estimate that a scale rules out.
const CONTRADICTED: &str = "the estimate is none of the bodies that the scale, load_max_kg and load_within_m \
                            allow: it is not used to plan with. One of them is wrong";

/// When an experiment ends.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct End {
    /// Of one that decides for itself: largest 95 % uncertainty of every tensor element, as a share of the
    /// largest principal moment, where the device has no rule to stop by. Default: 0.01.
    pub until_relative: Option<f64>,
    /// A programme ends after this long, s; one that decides for itself begins no further segment then, by
    /// default after 300 s.
    pub at_most_s: Option<f64>,
}

impl End {
    /// Refuses an end that is none.
    ///
    /// # Errors
    /// [`DrivingError::UntilRelative`], [`DrivingError::AtMost`].
    pub fn check(&self) -> Result<(), DrivingError> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        if let Some(share) = self.until_relative.filter(|s| !(positive(*s) && *s < 1.0)) {
            return Err(DrivingError::UntilRelative(share));
        }
        match self.at_most_s.filter(|s| !positive(*s)) {
            Some(seconds) => Err(DrivingError::AtMost(seconds)),
            None => Ok(()),
        }
    }
}

/// Decides, and keeps account of it.
pub struct Directing<'a> {
    at: &'a dyn Attendant,
    planner: Planner,
    model: RigModel,
    at_most_s: f64,
    decision: Option<Box<Decision>>,
    before: Information,
    variance_scale: f64,
    spent_s: f64,
    begun_s: f64,
    /// Of the worst uncertainty over what is asked for, before the segment, and of which parameter.
    worst_before: (f64, String),
    last_expected: f64,
    stages: Vec<Stage>,
    /// When the segments began, and what they were.
    driven: Vec<(f64, MotionProgram)>,
    decisions: Vec<Decided>,
    warnings: Vec<String>,
    asked: Asked,
    reached: bool,
    /// The uncertainty by the last factor over the one that is asked for, and the parameter that is furthest
    /// off.
    last: Option<(f64, &'static str)>,
    /// The uncertainties that can be reached in the remaining time, where they are not those asked for.
    forecast: Forecast,
    /// Why it ended before.
    why: Option<String>,
}

/// Results of an experiment that decides for itself, beside the answer.
pub struct Decisions {
    /// Segments by their beginnings.
    pub stages: Vec<Stage>,
    /// The decisions and their results.
    pub decisions: Vec<Decided>,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
    /// The course of the experiment.
    pub came: Course,
    /// All that was commanded, rests between segments included; `None` if nothing was.
    pub program: Option<MotionProgram>,
}

impl<'a> Directing<'a> {
    /// Returns who decides; `body` is what the load cell may carry, in S.
    ///
    /// # Errors
    /// [`DrivingError::NoChoice`]: the platform can do nothing. The rig file lacks a place.
    pub fn new(
        end: &End,
        (rig, geometry): (&RigFile, &Geometry),
        settings: &Settings,
        body: Option<BodySet>,
        at: &'a dyn Attendant,
    ) -> Result<Self, DrivingError> {
        let asked = match &settings.stop {
            Some(stop) => {
                Asked::Absolute(std::array::from_fn(|j| stop.u95(j).map_or(f64::INFINITY, f64::from)))
            }
            None => Asked::Tensor(end.until_relative.unwrap_or(TENSOR_SHARE)),
        };
        let sigma = settings.load_cell.noise_n_nm.map(f64::from);
        let reserved = geometry.clone().with_reserve(machine::RESERVE);
        let model = RigModel { body, ..RigModel::of(rig, reserved, f64::from(settings.rate_hz), sigma)? };
        let planner = Planner::new(model.clone(), asked);
        if planner.choices() == 0 {
            return Err(DrivingError::NoChoice);
        }
        Ok(Self {
            at,
            at_most_s: end.at_most_s.unwrap_or(AT_MOST_S),
            planner,
            model,
            decision: None,
            before: Information::zeros(),
            variance_scale: 1.0,
            spent_s: 0.0,
            begun_s: 0.0,
            worst_before: (f64::INFINITY, String::new()),
            last_expected: f64::INFINITY,
            stages: Vec::new(),
            driven: Vec::new(),
            decisions: Vec::new(),
            warnings: Vec::new(),
            asked,
            reached: false,
            last: None,
            forecast: Forecast::default(),
            why: None,
        })
    }

    /// Ends the experiment and returns its results.
    pub fn concluded(mut self) -> Decisions {
        if let Some(decision) = self.decision.take().filter(|_| self.stages.len() > self.decisions.len()) {
            let decided = self.decided(&decision, self.last_expected);
            self.decisions.push(decided);
        }
        Decisions {
            came: Course { summary: self.summary(), why: self.unmet() },
            program: commanded(&self.driven),
            stages: self.stages,
            decisions: self.decisions,
            warnings: self.warnings,
        }
    }

    fn summary(&self) -> ExperimentSummary {
        let finite = |ratio: f64| ratio.is_finite().then_some(ratio);
        let segment = |decided: &Decided| SegmentSummary {
            begun_s: decided.begun_s,
            lasted_s: decided.lasted_s,
            name: decided.name.clone(),
            furthest: decided.purpose.clone(),
            before: finite(decided.before),
            expected: finite(decided.expected),
            reached: decided.got.and_then(finite),
        };
        ExperimentSummary {
            rig_s: 0.0,
            goal: self.in_words(1.0),
            reached: self.reached,
            goal_ratio: self.last.and_then(|(worst, _)| finite(worst)),
            predicted_ratio: match self.forecast.said() {
                Some(Foreseen::Share(worst)) => Some(worst),
                _ => None,
            },
            predicted_moment_u95_kgm2: match self.forecast.said() {
                Some(Foreseen::Moment(u95)) => Some(u95),
                _ => None,
            },
            decisions: self.decisions.iter().map(segment).collect(),
        }
    }

    /// Returns what is to be said of a goal that was not reached.
    fn unmet(&self) -> Option<String> {
        if self.reached {
            return None;
        }
        let why = self.why.clone().unwrap_or_else(|| "the experiment ended before".to_owned());
        let got = match self.last {
            Some((worst, parameter)) if worst.is_finite() => {
                format!("{} was reached, {parameter} is furthest off", self.in_words(worst))
            }
            _ => "not all of the body is identified, so that it is not known what that is".to_owned(),
        };
        Some(format!(
            "{} was asked for and is not reached: {got}. {}{}",
            self.in_words(1.0),
            why[..1].to_uppercase(),
            &why[1..]
        ))
    }

    /// Returns an uncertainty over the one that is asked for, in words.
    fn in_words(&self, ratio: f64) -> String {
        match self.asked {
            Asked::Tensor(share) => format!("{:.2} % of the largest principal moment", 100.0 * share * ratio),
            Asked::Absolute(_) if ratio == 1.0 => "`until`".to_owned(),
            Asked::Absolute(_) => format!("{ratio:.2} times that"),
        }
    }

    fn ends(&mut self, why: String) {
        self.at.hear(&why);
        self.why = Some(why);
    }

    fn notice(&mut self, observed: &Observed) {
        let worst = observed.worst(&self.asked, &self.model);
        let goal = self.planner.goal(&observed.known());
        self.last = Some((worst, goal.furthest(&observed.information)));
    }

    /// Says what can be reached where the time there is will not do, again when that has changed.
    fn promise(&mut self, observed: &Observed, decision: &Decision) {
        let left_s = self.at_most_s - self.spent_s;
        let known = observed.known();
        if decision.expected_s <= left_s {
            return;
        }
        let then = decision.information_after(left_s, &known);
        let foreseen = self.asked.foreseen(&self.planner.goal(&known), &known, &then);
        let Some(foreseen) = foreseen.and_then(|foreseen| self.forecast.take(foreseen)) else { return };
        let takes = match decision.expected_s {
            s if s.is_finite() => format!("would take {s:.0} s more"),
            _ => "cannot be reached".to_owned(),
        };
        let can_be = match foreseen {
            Foreseen::Share(worst) => format!("{} can be", self.in_words(worst)),
            Foreseen::Moment(u95) => {
                let u95 = significant(u95, 2);
                format!(
                    "every element of the tensor can be known to ±{u95} kg m²; the largest moment is not \
                     known well yet"
                )
            }
        };
        self.at.hear(&format!("{} {takes}; in the {left_s:.0} s there are, {can_be}", self.in_words(1.0)));
    }

    fn decided(&self, decision: &Decision, expected: f64) -> Decided {
        let (before, purpose) = self.worst_before.clone();
        Decided {
            begun_s: self.begun_s,
            name: decision.name.clone(),
            purpose,
            before,
            expected,
            got: None,
            lasted_s: None,
            whole: false,
        }
    }

    /// Returns everything that may be decided on, one after the other.
    pub(super) fn everything(&self) -> MotionProgram {
        self.planner.everything()
    }

    /// Returns the longest time that it may take, s.
    pub(super) fn at_most_s(&self) -> f64 {
        self.at_most_s
    }

    /// Takes in the result of the last decision.
    fn account(&mut self, observed: &Observed, ended_s: Option<f64>) {
        let whole = ended_s.is_none();
        let Some(decision) = self.decision.take() else { return };
        let known = observed.known();
        let goal = self.planner.goal(&known);
        let expected = goal.worst(&(self.before + decision.information()), observed.variance_scale);
        let got = observed.worst(&self.asked, &self.model);
        let short = if whole { "" } else { " of the whole segment" };
        let said = format!(
            "the worst U95 is {} of what is asked for, {} was expected{short}",
            words(got),
            words(expected)
        );
        self.at.hear(&format!("  {said}"));
        let lasted_s = ended_s.map_or(decision.program.duration_s(), |s| s - self.begun_s);
        let decided = self.decided(&decision, expected);
        self.decisions.push(Decided { got: Some(got), lasted_s: Some(lasted_s), whole, ..decided });
        if whole {
            let newly = self.planner.carried_out(&decision, &(observed.information - self.before));
            self.lost(&newly, "was commanded to move and did not");
        }
    }

    /// States what the segment is for.
    fn judge_before(&mut self, observed: &Observed, decision: &Decision) {
        let goal = self.planner.goal(&observed.known());
        let worst = observed.worst(&self.asked, &self.model);
        let purpose = match observed.estimate {
            Some(_) if worst.is_finite() => goal.furthest(&observed.information),
            _ => "everything",
        };
        self.worst_before = (worst, purpose.to_owned());
        self.last_expected =
            goal.worst(&(observed.information + decision.information()), observed.variance_scale);
    }

    fn lost(&mut self, newly: &[bool; 6], what: &str) {
        const AXES: [Axis; 6] = [Axis::X, Axis::Y, Axis::Z, Axis::Roll, Axis::Pitch, Axis::Yaw];
        for (axis, _) in AXES.iter().zip(newly).filter(|(_, lost)| **lost) {
            let said = format!("{} {what}: the rest of the experiment does without it", word(*axis));
            self.at.hear(&format!("  {said}"));
            self.warnings.push(said);
        }
    }
}

/// Joins several programs to one, with rests between them.
fn commanded(driven: &[(f64, MotionProgram)]) -> Option<MotionProgram> {
    let (_, first) = driven.first()?;
    let mut whole = MotionProgram { start: first.start, segments: Vec::new() };
    for (begun_s, program) in driven {
        let rest_s = begun_s - whole.duration_s();
        if rest_s > 0.0 {
            whole.segments.push(Segment::Hold { duration_s: rest_s });
        }
        whole.segments.extend(program.segments.iter().cloned());
    }
    Some(whole)
}

fn words(ratio: f64) -> String {
    if ratio.is_finite() { format!("{ratio:.2}") } else { "not a finite multiple".to_owned() }
}

impl Director for Directing<'_> {
    fn next(&mut self, factor: &Factor) -> Result<Option<Proposal>, String> {
        let observed = self.model.observed(factor);
        self.variance_scale = observed.variance_scale;
        self.account(&observed, None);
        self.notice(&observed);
        if self.spent_s >= self.at_most_s {
            self.ends(format!("the {} s of `at_most_s` are over", self.at_most_s));
            return Ok(None);
        }
        let next = self.planner.next(&observed.known());
        if self.planner.contradicted() && !self.warnings.iter().any(|w| w == CONTRADICTED) {
            self.at.hear(&format!("  {CONTRADICTED}"));
            self.warnings.push(CONTRADICTED.to_owned());
        }
        match next {
            Next::Reached => {
                self.reached = true;
                Ok(None)
            }
            Next::Question(program) => Ok(Some(Proposal { program, drive: false })),
            Next::Unsafe => {
                self.ends(
                    "no motion is known to keep every limit whatever of what may be on the load cell is \
                     there: say more of it (load_max_kg, load_within_m, offset_within_n_nm)"
                        .to_owned(),
                );
                Ok(None)
            }
            Next::Hopeless(parameter) => {
                self.ends(format!(
                    "{parameter} cannot become as certain as asked for by anything this platform does within \
                     its limits"
                ));
                Ok(None)
            }
            Next::Segment(decision) => {
                self.at.hear(&format!("{}: {:.1} s", decision.name, decision.program.duration_s()));
                self.promise(&observed, &decision);
                self.judge_before(&observed, &decision);
                self.before = observed.information;
                let program = decision.program.clone();
                self.decision = Some(decision);
                Ok(Some(Proposal { program, drive: true }))
            }
        }
    }

    fn refused(&mut self, error: &PlatformError) {
        match self.decision.take() {
            Some(decision) => {
                self.at.hear(&format!("  {error}"));
                self.planner.refused(&decision);
            }
            None => {
                let newly = self.planner.answered(false);
                self.lost(&newly, "is refused by the platform");
            }
        }
    }

    fn taken(&mut self) {
        self.planner.answered(true);
    }

    fn begins(&mut self, time_s: f64) {
        let Some(decision) = &self.decision else { return };
        self.begun_s = time_s;
        self.spent_s += decision.program.duration_s();
        self.stages.push(Stage { start_s: time_s, name: format!("{}", self.stages.len() + 1) });
        self.driven.push((time_s, decision.program.clone()));
    }

    fn may_be_reached(&mut self, report: &EstimateReport) -> bool {
        let all = (1_u32 << report.estimate.len().min(16)) - 1;
        if report.determined & all != all {
            return false;
        }
        let estimate: Vec<f64> = report.estimate.iter().map(|v| f64::from(*v)).collect();
        let goal = self.planner.goal(&Known {
            information: &self.before,
            estimate: Some(&estimate),
            first: None,
            variance_scale: self.variance_scale,
        });
        let k = 1.96 * self.variance_scale.sqrt();
        report.standard_deviation.iter().zip(goal.u95).all(|(sd, u95)| k * f64::from(*sd) <= u95)
    }

    fn is_reached(&mut self, factor: &Factor, time_s: f64) -> bool {
        let observed = self.model.observed(factor);
        self.variance_scale = observed.variance_scale;
        let reached = observed.worst(&self.asked, &self.model) <= 1.0;
        if reached {
            self.reached = true;
            self.notice(&observed);
            self.account(&observed, Some(time_s));
        }
        reached
    }
}
