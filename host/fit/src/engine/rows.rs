//! Rows absorbed and solved.

use nalgebra::DMatrix;

use super::{Engine, MOST_LEVERAGES, Pass, Solved};
use crate::compensation::{Compensated, NoiseGram, compensate, spread};
use crate::linearised::Linearised;
use crate::outliers::Weights;
use crate::residuals::{raw_sigma, residuals};
use crate::signal_noise::RowNoise;
use crate::weighing::Weighing;
use crate::{BlockResidual, Estimate, Factor, FitError, Noise, RowBlocks, Whitener, parallel};

impl Engine<'_> {
    /// Returns the weighing by σ of the channels alone.
    pub(super) fn diagonal(&self, sigma: Vec<f64>) -> Weighing {
        Weighing::diagonal(sigma, f64::from(self.blocks.filter().every))
    }

    /// Absorbs all rows, with the columns of nuisance parameters if they are linearised.
    pub(super) fn absorb<'e>(
        &'e self,
        weighing: Weighing,
        weights: Weights,
        linearised: Option<Linearised<'e>>,
    ) -> Result<Pass<'e>, FitError> {
        let all = linearised.as_ref().map_or(self.parameters, |_| self.columns.all());
        let blocks = linearised.as_ref().map_or(&*self.blocks, |l| l as &dyn RowBlocks);
        let parts = parallel::map(parallel::threads(), blocks.parts().len(), |k| {
            let part = blocks.parts().get(k).cloned().unwrap_or_default();
            blocks.absorb(part, all, &weighing.whitening, weights.as_slice())
        });
        let mut factor = Factor::new(all);
        let several = parts.len() > 1;
        for part in parts {
            if several { factor.merge(&part) } else { factor = part }
        }
        let noise = self.noise.as_ref().filter(|_| weighing.is_compensated());
        let gram = match (noise, &linearised) {
            (Some(noise), None) => Some(noise.gram(&weighing)),
            (Some(noise), Some(linearised)) => {
                Some(noise.joint_gram(&weighing, &self.columns, linearised)?)
            }
            (None, _) => None,
        };
        Ok(Pass { weighing, factor, gram, linearised, weights })
    }

    pub(super) fn linearise(&self, phi: &[f64]) -> Result<Option<Linearised<'_>>, FitError> {
        let some = !self.columns.is_empty();
        some.then(|| Linearised::new(self.source, &*self.blocks, &self.columns, phi)).transpose()
    }

    /// Returns the row blocks of a pass.
    pub(super) fn rows_of<'p>(&'p self, pass: &'p Pass) -> &'p dyn RowBlocks {
        pass.linearised.as_ref().map_or(&*self.blocks, |l| l as &dyn RowBlocks)
    }

    /// Returns what noise of the signals adds to the rows, times a factor; its square may be wrong by
    /// `doubt`.
    pub(super) fn noise_gram<'g>(&self, expected: &'g DMatrix<f64>, times: f64, doubt: f64) -> NoiseGram<'g> {
        let blocks = self.noise.as_ref().map_or(0.0, RowNoise::independent_blocks);
        let correlated = self.noise.as_ref().map_or(0.0, RowNoise::correlated);
        let coloured = (2.0 * (1.0 + correlated) / blocks.max(1.0)).sqrt();
        let spread = spread(self.blocks.filter(), blocks).max(coloured);
        NoiseGram { expected, times, spread: spread.hypot(doubt) }
    }

    /// Solves a pass whose noise has `scale` times the variance, beside what is known beforehand.
    pub(super) fn solve(&self, pass: &Pass, scale: f64) -> Solved {
        let rounding = self.source.rounding();
        let scaled = if scale == 1.0 { pass.factor.clone() } else { pass.factor.discount(scale) };
        let noise = pass.gram.as_ref().map(|gram| self.noise_gram(gram, 1.0 / scale, pass.weighing.doubt));
        let compensated = noise.and_then(|noise| compensate(&scaled, &noise, rounding));
        let known =
            |rows: Factor| if pass.linearised.is_some() { self.columns.with_prior(&rows) } else { rows };
        let estimate = |known: &Factor| self.estimate(known, 1.0, Noise::Given);
        let leading = |known: Factor| {
            if pass.linearised.is_some() { known.leading(self.parameters) } else { known }
        };
        let least_squares = estimate(&known(scaled.clone()));
        let Some(Compensated { factor, fitted }) = compensated else {
            let all = known(scaled.clone());
            let joint = estimate(&all);
            let factor = leading(all);
            let own = estimate(&factor);
            return Solved { about: joint.clone(), least_squares, own, factor, joint, rows: scaled };
        };
        let rows = factor.clone();
        let [all, fitted] = [factor, fitted].map(known);
        Solved {
            rows,
            joint: estimate(&all),
            about: estimate(&fitted),
            least_squares,
            own: estimate(&leading(fitted)),
            factor: leading(all),
        }
    }

    /// Returns rows over all columns as rows over the parameters alone, with what is known of errors.
    pub(super) fn without_errors(&self, rows: &Factor, with_errors: bool) -> Factor {
        if with_errors { self.columns.with_prior(rows).leading(self.parameters) } else { rows.clone() }
    }

    pub(super) fn estimate(&self, factor: &Factor, scale: f64, noise: Noise) -> Estimate {
        Estimate::new(factor, self.source.rounding(), scale, noise)
    }

    pub(super) fn residuals(
        &self,
        blocks: &dyn RowBlocks,
        values: &[f64],
        weights: &Weights,
    ) -> Vec<BlockResidual> {
        residuals(blocks, self.source.channels().len(), values, weights)
    }

    /// Returns σ of the channels from what a pass leaves.
    pub(super) fn sigma_from_residuals(&self, pass: &Pass) -> Vec<f64> {
        let Solved { about, joint, .. } = self.solve(pass, 1.0);
        let residuals = self.residuals(self.rows_of(pass), &about.values, &pass.weights);
        let fitted = self.fitted_by_channel(pass, &joint);
        let channels = (self.source.channels(), &*self.source.nominal_sigma());
        let mut sigma = raw_sigma(&*self.blocks, channels, &self.measured_rms, &fitted, &residuals);
        let most = self.largest_sigma.iter().flatten();
        sigma.iter_mut().zip(most).for_each(|(sigma, most)| *sigma = sigma.min(*most));
        sigma
    }

    /// Returns how many degrees of freedom parameters and errors take of the rows: `tr(H⁻¹ AᵀWA)` with H the
    /// information of rows and prior. An error that rows tell nothing of takes none.
    pub(super) fn fitted(&self, pass: &Pass, joint: &Estimate) -> f64 {
        let known = if pass.linearised.is_some() { self.columns.known(&joint.covariance) } else { 0.0 };
        (joint.rank() as f64 - known).max(0.0)
    }

    /// Returns the same of each channel's rows; of many rows, where it hardly counts, as much of each.
    fn fitted_by_channel(&self, pass: &Pass, joint: &Estimate) -> Vec<f64> {
        let (rows, channels) = (self.rows_of(pass), self.source.channels().len());
        if rows.len() > MOST_LEVERAGES {
            return vec![self.fitted(pass, joint) / channels.max(1) as f64; channels];
        }
        let n = joint.len();
        let mut covariance = joint.covariance.clone();
        for j in (0..n).filter(|j| !joint.is_determined(*j)) {
            covariance.row_mut(j).fill(0.0);
            covariance.column_mut(j).fill(0.0);
        }
        let mut fitted = vec![0.0; channels];
        let mut whitener = Whitener::new(&pass.weighing.whitening, n);
        let (mut own, mut measured) = (DMatrix::zeros(n, channels), vec![0.0; channels]);
        for block in 0..rows.len() {
            rows.write(block, own.as_mut_slice(), &mut measured);
            let weights = Some(pass.weights.of_block(block)).filter(|own| !own.is_empty());
            whitener.apply(rows.time_s(block), own.as_mut_slice(), &mut measured, weights);
            for (fitted, row) in fitted.iter_mut().zip(own.column_iter()) {
                *fitted += (&covariance * row).dot(&row);
            }
        }
        fitted
    }
}
