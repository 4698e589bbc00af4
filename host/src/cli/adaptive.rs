//! `--adaptive`: segments decided one by one while the device estimates.

use clap::Args;
use rigident_shared::wire::{EstimateReport, Settings};
use rigident_sim::platform::{Axis, Geometry, MotionProgram};

use super::Failure;
use crate::formats::rig::RigFile;
use crate::identification::Factor;
use crate::identification::pooled::{RowSet, judge};
use crate::planning::adaptive::library::word;
use crate::planning::adaptive::planner::Known;
use crate::planning::adaptive::{Asked, Decision, Information, Next, Planner, RigModel};
use crate::platform::PlatformError;
use crate::report::Stage;
use crate::session::Director;

/// Share of the largest principal moment unless asked otherwise.
const TENSOR_SHARE: f64 = 0.01;

/// Whether somebody decides, and how far.
#[derive(Args, Debug, Clone)]
pub struct Adaptive {
    /// Decide every segment by what the device knows by then; end as soon as what is asked for is reached
    ///
    /// Asked for is --until, or every tensor element, about S and about the centre of mass, to --until-relative.
    #[arg(long, conflicts_with_all = ["plan", "duration_s", "go_on", "forget", "window"])]
    pub adaptive: bool,
    /// With --adaptive: largest 95 % uncertainty of every tensor element, as a share of the largest principal moment
    /// [default: 0.01]
    #[arg(long, value_name = "SHARE", requires = "adaptive", conflicts_with = "until")]
    pub until_relative: Option<f64>,
    /// With --adaptive: begin no further segment after so long, s
    #[arg(long, value_name = "S", default_value_t = 300.0)]
    pub at_most_s: f64,
}

impl Adaptive {
    /// What cannot be asked for: bad input.
    ///
    /// # Errors
    /// A share or a time that is no positive number.
    pub(super) fn check(&self) -> Result<(), Failure> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        if let Some(share) = self.until_relative.filter(|s| !(positive(*s) && *s < 1.0)) {
            return Err(Failure::input(format!(
                "--until-relative {share}: a share of the largest principal moment, between 0 and 1, as 0.01"
            )));
        }
        if !positive(self.at_most_s) {
            return Err(Failure::input(format!(
                "--at-most-s {}: a positive number of seconds",
                self.at_most_s
            )));
        }
        Ok(())
    }

    /// Who decides, if anybody is to.
    ///
    /// # Errors
    /// What is wrong with the platform, or nothing that it could do.
    pub(super) fn directing(
        &self,
        rig: &RigFile,
        geometry: &Geometry,
        settings: &Settings,
    ) -> Result<Option<Directing>, Failure> {
        if !self.adaptive {
            return Ok(None);
        }
        self.check()?;
        let asked = match &settings.stop {
            Some(stop) => Asked::Absolute(std::array::from_fn(|j| {
                if stop.asked >> j & 1 == 1 { f64::from(stop.u95[j]) } else { f64::INFINITY }
            })),
            None => Asked::Tensor(self.until_relative.unwrap_or(TENSOR_SHARE)),
        };
        let sigma = settings.load_cell.noise_n_nm.map(f64::from);
        let model = RigModel::of(rig, geometry.clone(), f64::from(settings.rate_hz), sigma)
            .map_err(Failure::input)?;
        let planner = Planner::new(model.clone(), asked);
        if planner.choices() == 0 {
            return Err(Failure::input(
                "--adaptive: no motion about home keeps the platform's limits; `rigident workspace` shows where it can go",
            ));
        }
        Ok(Some(Directing {
            at_most_s: self.at_most_s,
            planner,
            model,
            decision: None,
            before: Information::zeros(),
            variance_scale: 1.0,
            spent_s: 0.0,
            begun_s: 0.0,
            stages: Vec::new(),
            decisions: Vec::new(),
            warnings: Vec::new(),
        }))
    }
}

/// Decides, and keeps account of it.
pub(super) struct Directing {
    planner: Planner,
    model: RigModel,
    at_most_s: f64,
    decision: Option<Box<Decision>>,
    before: Information,
    variance_scale: f64,
    spent_s: f64,
    begun_s: f64,
    stages: Vec<Stage>,
    decisions: Vec<(String, String)>,
    warnings: Vec<String>,
}

/// What a factor says.
struct Told {
    information: Information,
    estimate: Option<Vec<f64>>,
    variance_scale: f64,
}

impl Directing {
    /// Segments by their beginnings; what was decided and what came of it; what did not go as it should.
    pub(super) fn concluded(self) -> (Vec<Stage>, Vec<(String, String)>, Vec<String>) {
        (self.stages, self.decisions, self.warnings)
    }

    /// Everything that may be decided on, one after the other.
    pub(super) fn everything(&self) -> MotionProgram {
        self.planner.everything()
    }

    /// The longest it may take, s.
    pub(super) fn at_most_s(&self) -> f64 {
        self.at_most_s
    }

    fn told(&self, factor: &Factor) -> Told {
        let (determined, estimate): (Vec<bool>, Vec<f64>) = match factor {
            Factor::Ten(f) => {
                let s = f.solve();
                (s.determined.to_vec(), s.estimate.to_vec())
            }
            Factor::Sixteen(f) => {
                let s = f.solve();
                (s.determined.to_vec(), s.estimate.to_vec())
            }
        };
        let fitted = determined.iter().filter(|d| **d).count();
        let rows = RowSet { rows: factor.rows(), noise_gain: self.model.noise_gain(), sigma_given: true };
        Told {
            information: self.model.of_factor(factor),
            estimate: (fitted == determined.len()).then_some(estimate),
            variance_scale: judge(&[rows], factor.residual_sum_of_squares(), fitted as f64).variance_scale,
        }
    }

    /// What came of the last decision.
    fn account(&mut self, told: &Told, whole: bool) {
        let Some(decision) = self.decision.take() else { return };
        let known = known(told);
        let goal = self.planner.goal(&known);
        let expected = goal.worst(&(self.before + decision.tells()), told.variance_scale);
        let got = goal.worst(&told.information, told.variance_scale);
        let short = if whole { "" } else { " of the whole segment" };
        let said = format!(
            "the worst U95 is {} of what is asked for, {} was expected{short}",
            words(got),
            words(expected)
        );
        eprintln!("  {said}");
        let number = self.decisions.len() + 1;
        self.decisions.push((
            format!("Segment {number}, from {:.1} s", self.begun_s),
            format!("{}: {said}", decision.name),
        ));
        if whole {
            let newly = self.planner.carried_out(&decision, &(told.information - self.before));
            self.lost(&newly, "was told to move and did not");
        }
    }

    fn lost(&mut self, newly: &[bool; 6], what: &str) {
        const AXES: [Axis; 6] = [Axis::X, Axis::Y, Axis::Z, Axis::Roll, Axis::Pitch, Axis::Yaw];
        for (axis, _) in AXES.iter().zip(newly).filter(|(_, lost)| **lost) {
            let said = format!("{} {what}: the rest of the experiment does without it", word(*axis));
            eprintln!("  {said}");
            self.warnings.push(said);
        }
    }
}

fn known(told: &Told) -> Known<'_> {
    Known {
        information: &told.information,
        estimate: told.estimate.as_deref(),
        variance_scale: told.variance_scale,
    }
}

fn words(ratio: f64) -> String {
    if ratio.is_finite() { format!("{ratio:.2}") } else { "not a finite multiple".to_owned() }
}

impl Director for Directing {
    fn next(&mut self, factor: &Factor) -> Result<Option<MotionProgram>, String> {
        let told = self.told(factor);
        self.variance_scale = told.variance_scale;
        self.account(&told, true);
        if self.spent_s >= self.at_most_s {
            self.warnings.push(format!(
                "what was asked for was not reached within {} s (--at-most-s)",
                self.at_most_s
            ));
            return Ok(None);
        }
        match self.planner.next(&known(&told)) {
            Next::Reached => Ok(None),
            Next::Hopeless(parameter) => {
                let said = format!(
                    "{parameter} cannot become as certain as asked for by anything this platform does within its limits"
                );
                eprintln!("{said}");
                self.warnings.push(said);
                Ok(None)
            }
            Next::Segment(decision) => {
                eprintln!("{}: {:.1} s", decision.name, decision.program.duration_s());
                self.before = told.information;
                let program = decision.program.clone();
                self.decision = Some(decision);
                Ok(Some(program))
            }
        }
    }

    fn refused(&mut self, error: &PlatformError) {
        let Some(decision) = self.decision.take() else { return };
        eprintln!("  {error}");
        let newly = self.planner.refused(&decision);
        self.lost(&newly, "is refused by the platform");
    }

    fn begins(&mut self, time_s: f64) {
        let Some(decision) = &self.decision else { return };
        self.begun_s = time_s;
        self.spent_s += decision.program.duration_s();
        self.stages.push(Stage { start_s: time_s, name: decision.name.clone() });
    }

    fn may_be_reached(&mut self, report: &EstimateReport) -> bool {
        let all = (1_u32 << report.estimate.len().min(16)) - 1;
        if u32::from(report.determined) & all != all {
            return false;
        }
        let estimate: Vec<f64> = report.estimate.iter().map(|v| f64::from(*v)).collect();
        let goal = self.planner.goal(&Known {
            information: &self.before,
            estimate: Some(&estimate),
            variance_scale: self.variance_scale,
        });
        let k = 1.96 * self.variance_scale.sqrt();
        report.standard_deviation.iter().zip(goal.u95).all(|(sd, u95)| k * f64::from(*sd) <= u95)
    }

    fn is_reached(&mut self, factor: &Factor) -> bool {
        let told = self.told(factor);
        self.variance_scale = told.variance_scale;
        let known = known(&told);
        let goal = self.planner.goal(&known);
        let reached = told.estimate.is_some() && goal.worst(&told.information, told.variance_scale) <= 1.0;
        if reached {
            self.account(&told, false);
        }
        reached
    }
}
