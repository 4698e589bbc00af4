//! The plain data of a report. SI units throughout; times in seconds on one axis for all plots.

use crate::answer::result::{Measured, ParameterState, TimeBase};

/// The body nearest to an answer that no body has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestBody {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in S, m.
    pub com_m: [f64; 3],
    /// Tensor about the centre of mass in the order of the parameters, axes of S, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// How far the answer is from it, standard deviations.
    pub distance_sd: f64,
}

impl From<&NearestBody> for crate::answer::result::NearestBody {
    fn from(body: &NearestBody) -> Self {
        let NearestBody { mass_kg, com_m, inertia_com_kgm2, .. } = *body;
        Self { mass_kg, com_m, inertia_com_kgm2, ..Self::default() }
    }
}

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
    /// The estimate if it is identified and its numbers can be printed.
    pub fn known(&self) -> Option<Measured> {
        self.state.measured().filter(|m| m.value.is_finite() && m.u95.is_finite() && m.u95 >= 0.0)
    }

    /// Estimate minus truth in standard deviations, σ = U95 / 1.96; `None` without truth or without σ.
    pub fn deviation_sd(&self) -> Option<f64> {
        let m = self.known()?;
        let truth = self.truth.filter(|t| t.is_finite())?;
        Some(1.96 * (m.value - truth) / m.u95).filter(|sd| sd.is_finite())
    }
}

/// Whether the experiment answered what was asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Status {
    /// Every parameter asked for is identified.
    Identified,
    /// Some are.
    PartlyIdentified,
    /// None is.
    #[default]
    NotIdentified,
    /// The experiment did not come to an end.
    Failed,
}

/// A principal moment of inertia about the centre of mass and its axis in S.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PrincipalAxis {
    /// The moment, kg m².
    pub moment: Quantity,
    /// Unit vector in S.
    pub axis: [f64; 3],
    /// 95 % uncertainty of the axis' direction, rad; not finite where two moments cannot be told apart.
    pub direction_u95_rad: f64,
}

/// Results in the customer's frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameResults {
    /// Name of the frame.
    pub name: String,
    /// Centre of mass (`x`, `y`, `z`) and tensor about the frame's origin (`Ixx` …).
    pub quantities: Vec<Quantity>,
}

/// Everything that is a result, without the data it came from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Results {
    /// Whether the question was answered.
    pub status: Status,
    /// The ten parameters in S, about S's origin.
    pub parameters: Vec<Quantity>,
    /// Centre of mass in S: `x`, `y`, `z`.
    pub centre_of_mass: Vec<Quantity>,
    /// Tensor about the centre of mass in the axes of S: `Ixx`, `Iyy`, `Izz`, `Iyz`, `Izx`, `Ixy`.
    pub inertia_com: Vec<Quantity>,
    /// Principal moments and axes, largest first; empty if the tensor is not identified.
    pub principal: Vec<PrincipalAxis>,
    /// The customer's frame, if the rig file names one.
    pub body_frame: Option<FrameResults>,
    /// Apparent wrench offsets, if they were estimated.
    pub offsets: Vec<Quantity>,
    /// 2-norm condition number of the column-scaled, whitened rows.
    pub condition_number: Option<f64>,
    /// Whether the pseudo-inertia is positive definite; `None` if it is not known.
    pub physically_consistent: Option<bool>,
    /// The nearest body, where no body has the parameters.
    pub nearest_body: Option<NearestBody>,
    /// How several files became one recording.
    pub time_base: Option<TimeBase>,
    /// What was known beforehand, in words.
    pub known: Vec<String>,
    /// What the answer is, where that was asked for: a memory of the last seconds. No warnings.
    pub notes: Vec<String>,
    /// Whatever the reader should know before using the numbers.
    pub warnings: Vec<String>,
    /// Motions that would identify what is not.
    pub advice: Vec<String>,
}

/// Where the data came from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Source {
    /// What was measured.
    pub body_name: String,
    /// Name of the recording.
    pub recording: String,
    /// Where the estimator ran: `inproc`, `qemu`, `host` or a port.
    pub mcu: String,
    /// Sample rate, Hz; `None` for still poses.
    pub rate_hz: Option<f64>,
    /// Rows of the recording.
    pub rows: u64,
    /// Length of the recording, s; `None` for still poses.
    pub duration_s: Option<f64>,
}

/// A stretch of the experiment, marked in every plot over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stage {
    /// Beginning, s.
    pub start_s: f64,
    /// What happens: `pose 1`, `motion`, …
    pub name: String,
}

/// One parameter's estimate over time. The three vectors have one length; not finite where undetermined.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Convergence {
    /// Name of the parameter, as in [`Results::parameters`].
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
    /// What is shown.
    pub title: String,
    /// Unit of all series.
    pub unit: String,
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Label and values of each series, at most three; one value per time.
    pub series: Vec<(String, Vec<f64>)>,
}

/// The first pose again at the end: change of the mean wrench.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drift {
    /// Time between the two poses, s.
    pub elapsed_s: f64,
    /// Change of each channel, `fx` … `mz`, last minus first.
    pub changes: Vec<Quantity>,
}

/// What the plots' horizontal axis counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Along {
    /// Seconds.
    #[default]
    Time,
    /// Still poses, one row each: every `time_s` holds the pose's number, from one.
    Poses,
}

/// All that the page shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReportData {
    /// Where the data came from.
    pub source: Source,
    /// The result.
    pub results: Results,
    /// Rejected rows by reason.
    pub rejected: Vec<(String, u64)>,
    /// Label and value: firmware's hash, serial numbers, calibration dates, …
    pub provenance: Vec<(String, String)>,
    /// What all the `time_s` below are.
    pub along: Along,
    /// Stages of the experiment in order of time.
    pub stages: Vec<Stage>,
    /// One per parameter, in any order.
    pub convergence: Vec<Convergence>,
    /// One per wrench channel.
    pub residuals: Vec<Residual>,
    /// What the residuals are of, if that needs saying (for example: filtered rows).
    pub residual_note: String,
    /// Angular rate, specific force, pose, …
    pub motion: Vec<TimePlot>,
    /// The drift check, if one was made.
    pub drift: Option<Drift>,
    /// Segments that were decided on while it lasted, in order.
    pub decisions: Vec<Decided>,
}

/// A segment that was decided on while the experiment lasted. Ratios are of the worst 95 % uncertainty over what is asked
/// for; infinite while something is not determined.
#[derive(Clone, Debug, PartialEq)]
pub struct Decided {
    /// When it began, s.
    pub begun_s: f64,
    /// What was done.
    pub name: String,
    /// What was furthest off.
    pub purpose: String,
    /// Before it.
    pub before: f64,
    /// Expected of the whole segment.
    pub expected: f64,
    /// At its end; `None` if it was not seen.
    pub got: Option<f64>,
    /// How long it lasted, s; `None` if its end was not seen.
    pub lasted_s: Option<f64>,
    /// Whether it came to its end.
    pub whole: bool,
}
