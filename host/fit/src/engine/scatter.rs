//! The noise of still poses by the scatter of their measurements, which bounds that by residuals.

use nalgebra::{DMatrix, DVector};

use super::{Engine, MOST_LEVERAGES};
use crate::Effect;
use crate::lack_of_fit::pose_span::largest_variance;

impl Engine<'_> {
    /// Returns the largest σ of each channel of still poses whose errors of the load cell are estimated, by
    /// the scatter about every linear model: residuals beyond it are no noise, and count against what is
    /// known of the errors. `None` of anything else.
    pub(super) fn largest_sigma(&self) -> Option<Vec<f64>> {
        let (blocks, channels, n) = (&self.blocks, self.source.channels(), self.parameters);
        let of_cell = |effect: &Effect| matches!(effect, Effect::Gain { .. } | Effect::CrossTalk { .. });
        let counts = blocks.filter().row_period_s() <= 0.0
            && blocks.len() <= MOST_LEVERAGES
            && self.columns.nuisances.iter().any(|nuisance| of_cell(&nuisance.effect))
            && (0..blocks.len()).all(|block| (0..channels.len()).all(|c| blocks.measures(block, c)));
        if !counts {
            return None;
        }
        let mut rows = vec![DMatrix::zeros(blocks.len(), n); channels.len()];
        let mut measured = vec![DVector::zeros(blocks.len()); channels.len()];
        let (mut own, mut values) = (vec![0.0; n * channels.len()], vec![0.0; channels.len()]);
        for block in 0..blocks.len() {
            blocks.write(block, &mut own, &mut values);
            for (c, row) in own.chunks_exact(n.max(1)).enumerate() {
                rows[c].row_mut(block).iter_mut().zip(row).for_each(|(to, from)| *to = *from);
                measured[c][block] = values[c];
            }
        }
        let units: Vec<&str> = channels.iter().map(|c| c.unit.as_str()).collect();
        let gain = blocks.filter().noise_gain;
        Some(largest_variance(&rows, &measured, &units).into_iter().map(|v| (v / gain).sqrt()).collect())
    }
}
