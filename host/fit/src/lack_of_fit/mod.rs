//! Lack of fit: what the residuals say against one unchanging rigid body, whatever the source of the rows.
//!
//! A change at one time ([`change`]), bodies that are not rigid ([`rigidity`]), and drift from still pose to
//! still pose ([`pose_drift`]). Each is a score test (C. R. Rao 1948) of columns that the model does not
//! have, beside the common fit of all that it has. Nothing here knows of bodies: columns say themselves what
//! they are.

mod bins;
pub mod change;
mod clear_band;
mod directions;
mod filters;
mod metric;
mod noise;
mod noise_filled;
mod pose_axes;
pub mod pose_drift;
pub mod pose_span;
pub mod rigidity;
mod score;

use statrs::function::beta::checked_beta_reg;

use super::outliers::Weights;
use super::{Kind, Owner, Parameter, RowBlocks, Whitening};
use bins::Bins;
pub use change::{Change, Changed, ColumnStep};
pub use pose_drift::PoseDrift;
use rigidity::Stored;
pub use rigidity::{Motion, NotRigid};

/// Residuals of less than this share of the measurements are no noise but rounding, and what the filter
/// leaves of fast motion: a recording that was computed.
const NOISE_FREE: f64 = 1e-4;

/// Variance of the residuals, over the stated one, from which on a cause is searched for.
pub const SUSPECT: f64 = 1.5;

/// The part that a column has in the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// It belongs to what is identified: masses.
    Body,
    /// It belongs to what is identified, and angular accelerations multiply it.
    Turning,
    /// It belongs to what is identified, and changes by itself: friction warms, wears and runs in.
    Friction,
    /// The offset of a channel.
    Offset,
    /// It is fitted, and does not change: gains, mounting.
    Fixed,
    /// It is fitted, and is the drift of a channel that is known beforehand to be small.
    Drift,
}

impl Role {
    /// Returns the part of a parameter.
    pub fn of(parameter: &Parameter) -> Self {
        match (&parameter.owner, parameter.kind) {
            (_, Kind::Offset) => Self::Offset,
            (Owner::Channel(_), _) => Self::Fixed,
            (_, Kind::Viscous | Kind::Coulomb | Kind::Load) => Self::Friction,
            (_, Kind::Inertia) => Self::Turning,
            _ => Self::Body,
        }
    }

    /// Returns true if it belongs to a body that is identified.
    pub fn is_body(self) -> bool {
        matches!(self, Self::Body | Self::Turning)
    }
}

/// The measured side's coefficient in a residual.
pub(super) const MEASURED: f64 = -1.0;

/// Noise of the signals in the rows, in series that are as likely as that which is there.
pub trait NoiseRows {
    /// Returns the number of series.
    fn series(&self) -> usize;

    /// Returns what the squares of a series count, so that the sum over all is that of the noise.
    fn weight(&self, series: usize) -> f64;

    /// Returns by how much the squares may be wrong, as a share of themselves.
    fn doubt(&self) -> f64;

    /// Calls `visit` with the time and the whitened rows of each block of a series, C rows of all columns
    /// and, last, of the measured side.
    fn each(&self, series: usize, visit: &mut dyn FnMut(f64, &[f64]));
}

/// Filtered rows with the estimate that they are compared with.
#[derive(Clone, Copy)]
pub struct Rows<'a> {
    /// The row blocks, with all columns that were fitted.
    pub blocks: &'a dyn RowBlocks,
    /// Estimate of every column.
    pub values: &'a [f64],
    /// Part of every column.
    pub roles: &'a [Role],
    /// Whitening that the estimate was made with.
    pub whitening: &'a Whitening,
    /// Noise of the signals in the rows; `None`: none that counts.
    pub noise: Option<&'a dyn NoiseRows>,
    /// Weights of outliers.
    pub weights: &'a Weights,
    /// True if there are efforts of drives among the channels: friction that is not in the columns resembles
    /// much else.
    pub has_drives: bool,
    /// True if residuals are larger than the noise stated, or autocorrelated: then the cause is searched for.
    pub is_suspect: bool,
}

impl Rows<'_> {
    /// Returns the columns of some part.
    fn columns(&self, wanted: impl Fn(Role) -> bool) -> Vec<usize> {
        (0..self.roles.len()).filter(|j| wanted(self.roles[*j])).collect()
    }
}

/// The evidence of the residuals against the model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LackOfFit {
    /// A change at one time.
    pub change: Option<Change>,
    /// The motion within.
    pub not_rigid: Option<NotRigid>,
    /// Channels that drift from still pose to still pose.
    pub pose_drift: Vec<PoseDrift>,
    /// Numbers of channels of still poses that follow the columns of other channels.
    pub crossed: Vec<usize>,
}

impl LackOfFit {
    /// Returns true if the rows are not those of one unchanging rigid model.
    pub fn contradicts(&self) -> bool {
        self.change.is_some() || self.not_rigid.as_ref().is_some_and(|found| found.motion.spoils())
    }

    /// Returns how far a parameter was away from its mean before or after a change, at most.
    pub fn shift(&self, column: usize) -> f64 {
        let steps = self.change.iter().flat_map(|change| &change.steps);
        steps.filter(|step| step.column == column).map(|step| step.value.abs()).fold(0.0, f64::max)
    }
}

/// Searches for a lack of fit.
pub fn look(rows: &Rows) -> LackOfFit {
    let stored = Stored::whole(rows);
    let bins = stored.as_ref().map_or_else(|| Bins::new(rows), |stored| stored.bins.clone());
    if bins.unexplained < NOISE_FREE {
        return LackOfFit::default();
    }
    if rows.blocks.filter().row_period_s() <= 0.0 {
        // Cross-talk as large as anything would explain all axes.
        let of_model = rows.columns(|role| role.is_body() || role == Role::Offset);
        let first = of_model.iter().position(|k| rows.roles[*k].is_body());
        let crossed = first.map(|column| pose_axes::find(&bins.clone().only(&of_model), column));
        // Drift as large as is known beforehand is in the estimate already: what it leaves is more.
        let others = rows.columns(|role| role != Role::Drift);
        let pose_drift = pose_drift::find(&bins.only(&others));
        return LackOfFit { pose_drift, crossed: crossed.unwrap_or_default(), ..LackOfFit::default() };
    }
    let change = change::find(rows, &bins);
    // What explains the residuals better than a step is no step.
    let not_rigid = (rows.is_suspect || change.is_some()).then(|| rigidity::find(rows, stored)).flatten();
    match (&change, &not_rigid) {
        (Some(step), Some(motion)) if step.explained > motion.explained => {
            LackOfFit { change, ..LackOfFit::default() }
        }
        (_, Some(_)) => LackOfFit { not_rigid, ..LackOfFit::default() },
        _ => LackOfFit { change, ..LackOfFit::default() },
    }
}

/// Returns the probability that r independent numbers of unit variance have this sum of squares or more, the
/// variance being known by ν others (Fisher and Snedecor).
fn tail(square: f64, r: usize, others: f64) -> f64 {
    if r == 0 || square <= 0.0 {
        return 1.0;
    }
    checked_beta_reg(0.5 * others, 0.5 * r as f64, others / (others + square)).unwrap_or(1.0)
}

#[cfg(test)]
mod tests;
