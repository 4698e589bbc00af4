//! The plain data of a report. SI units throughout; times in seconds on one axis for all plots.

use super::envelope::{envelope_of, extremes};
use rigident_fit::figures::{CONTRADICTED, NOT_IDENTIFIED};
use rigident_identify::answer::result::{Measured, ParameterState};

/// Buckets of the plots that are as wide as the page: about one per user unit.
const FULL_BUCKETS: usize = 900;

/// One number of the result, or the fact that the data do not identify it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Quantity {
    /// Name as in the result file: `m`, `mcx`, `Ixx`, `offset_fx`, `x`, …
    pub name: String,
    /// SI unit as in the result file: `kg`, `kg m2`, …
    pub unit: String,
    /// The estimate, if it is identified.
    pub state: ParameterState,
    /// The true value, where it is known.
    pub truth: Option<f64>,
}

impl Quantity {
    /// Returns the estimate if it is identified and its numbers can be printed.
    pub fn known(&self) -> Option<Measured> {
        self.state.measured().filter(|m| m.value.is_finite() && m.u95.is_finite() && m.u95 >= 0.0)
    }

    /// Returns the words in place of the number, where there is none.
    pub fn missing(&self) -> &'static str {
        missing(self.state)
    }

    /// Returns the estimate minus truth in standard deviations, σ = U95 / 1.96; `None` without truth or
    /// without σ.
    pub fn deviation_sd(&self) -> Option<f64> {
        let m = self.known()?;
        let truth = self.truth.filter(|t| t.is_finite())?;
        Some(1.96 * (m.value - truth) / m.u95).filter(|sd| sd.is_finite())
    }
}

/// Returns the words in place of the number of a state without one.
pub(super) fn missing(state: ParameterState) -> &'static str {
    if state == ParameterState::Contradicted { CONTRADICTED } else { NOT_IDENTIFIED }
}

/// A principal moment of inertia about the centre of mass and its axis in S.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PrincipalAxis {
    /// The moment, kg m².
    pub moment: Quantity,
    /// Unit vector in S.
    pub axis: [f64; 3],
    /// 95 % uncertainty of the axis' direction, rad; not finite where two moments cannot be distinguished.
    pub direction_u95_rad: f64,
}

/// A stretch of the experiment, marked in every plot over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stage {
    /// Beginning, s.
    pub start_s: f64,
    /// The event: `pose 1`, `motion`, …
    pub name: String,
}

/// One parameter's estimate over time. The three vectors have one length; not finite where undetermined.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Convergence {
    /// Name of the parameter, as in the answer.
    pub name: String,
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Estimate.
    pub estimate: Vec<f64>,
    /// 95 % uncertainty.
    pub u95: Vec<f64>,
}

/// Residuals of one wrench channel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Residual {
    /// Channel: `fx` … `mz`.
    pub channel: String,
    /// `N` or `N m`.
    pub unit: String,
    /// Time, s; one per value.
    pub time_s: Vec<f64>,
    /// Measured minus modelled.
    pub values: Vec<f64>,
    /// Standard deviation the residuals should have.
    pub sigma: f64,
}

/// Several quantities of one unit over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimePlot {
    /// The title shown.
    pub title: String,
    /// Unit of all series.
    pub unit: String,
    /// Smallest and largest time, s; `None` of no points.
    pub range_s: Option<(f64, f64)>,
    /// Label and points of each series, at most three, made short: time, s, and value.
    pub series: Vec<(String, Vec<(f64, f64)>)>,
}

impl TimePlot {
    /// Returns a plot without series.
    pub fn new(title: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { title: title.into(), unit: unit.into(), ..Self::default() }
    }

    /// Adds a series of `count` points, `of(k)` being the time, s, and the value of one. Only what is drawn
    /// is retained.
    #[must_use]
    pub fn with(mut self, label: &str, count: usize, of: impl Fn(usize) -> (f64, f64)) -> Self {
        let times = (0..count).map(|k| of(k).0);
        let both = |(a, b): (f64, f64), (c, d): (f64, f64)| (a.min(c), b.max(d));
        if let Some(own) = extremes(times) {
            self.range_s = Some(self.range_s.map_or(own, |range| both(range, own)));
        }
        self.series.push((label.to_owned(), envelope_of(count, of, FULL_BUCKETS)));
        self
    }
}

/// The first pose again at the end: change of the mean wrench.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drift {
    /// Time between the two poses, s.
    pub elapsed_s: f64,
    /// Change of each channel, `fx` … `mz`, last minus first.
    pub changes: Vec<Quantity>,
}

/// The quantity of the plots' horizontal axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Along {
    /// Seconds.
    #[default]
    Time,
    /// Still poses, one row each: every `time_s` holds the pose's number, from one.
    Poses,
}

/// A segment that was decided on while the experiment lasted. Ratios are of the worst 95 % uncertainty over
/// what is asked for; infinite while something is not determined.
#[derive(Clone, Debug, PartialEq)]
pub struct Decided {
    /// The time when it began, s.
    pub begun_s: f64,
    /// The action.
    pub name: String,
    /// The quantity furthest off.
    pub purpose: String,
    /// Before it.
    pub before: f64,
    /// Expected of the whole segment.
    pub expected: f64,
    /// At its end; `None` if it was not seen.
    pub got: Option<f64>,
    /// The duration, s; `None` if its end was not seen.
    pub lasted_s: Option<f64>,
    /// True if the segment reached its end.
    pub whole: bool,
}
