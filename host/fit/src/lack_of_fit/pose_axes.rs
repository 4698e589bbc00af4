//! Channels of still poses that follow the columns of other channels: axes, signs or frames that are not
//! those of the model.
//!
//! A force along one axis has no part of the gravity along the others. These are columns of an F-test beside
//! all that the model has. Small parts are cross-talk and tilt, so that the size of what is left decides
//! beside it.

use nalgebra::DMatrix;

use super::bins::Bins;
use super::pose_drift::{FALSE_ALARM, explained, metrics};
use super::score::Common;

/// Returns the numbers of channels whose residuals follow what `column` has in any of the channels.
pub(super) fn find(bins: &Bins, column: usize) -> Vec<usize> {
    let all: Vec<_> = bins.rows.iter().map(|rows| rows.column(column).into_owned()).collect();
    let there: Vec<_> = all.into_iter().filter(|own| own.iter().any(|v| *v != 0.0)).collect();
    if there.is_empty() {
        return Vec::new();
    }
    let (columns, metrics) = (DMatrix::from_columns(&there), metrics(bins));
    let common = Common::new(bins, &metrics, &[]);
    let follows = |channel: &usize| {
        explained(bins, &common, *channel, &columns).is_some_and(|found| found.probability < FALSE_ALARM)
    };
    (0..bins.channels).filter(follows).collect()
}
