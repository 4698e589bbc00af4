//! Channels of still poses that follow the columns of other channels: axes, signs or frames that are not those of the model.
//!
//! A force along one axis has no part of the gravity along the others. An F-test of these as columns of its own, beside all that
//! the model has; small parts are cross-talk and tilt, so that the size of what is left decides beside it.

use nalgebra::DMatrix;

use super::bins::Bins;
use super::pose_drift::{FALSE_ALARM, Poses};

/// Returns the numbers of channels whose residuals follow what `column` has in any of the channels.
pub(super) fn find(bins: &Bins, column: usize) -> Vec<usize> {
    let all: Vec<_> = bins.rows.iter().map(|rows| rows.column(column).into_owned()).collect();
    let there: Vec<_> = all.into_iter().filter(|own| own.iter().any(|v| *v != 0.0)).collect();
    if there.is_empty() {
        return Vec::new();
    }
    let (columns, poses) = (DMatrix::from_columns(&there), Poses::new(bins));
    let follows = |channel: &usize| {
        poses.explained(*channel, &columns).is_some_and(|found| found.probability < FALSE_ALARM)
    };
    (0..bins.channels).filter(follows).collect()
}
