//! Forgetting: one pass in the order of time, as the device does it.

use nalgebra::{DMatrix, DVector};
use rigident_shared::forgetting::Span;

use super::{Conclusion, Engine, Pass, SIGMA_ROUNDS};
use crate::convergence;
use crate::forgetting::Memory;
use crate::linearised::Prior;
use crate::outliers::{Reference, Watch, Weights};
use crate::residuals::{raw_sigma, rms};
use crate::weighing::Weighing;
use crate::{BlockResidual, Convergence, Fit, FitError, Noise, Nuisance, NuisanceFit, RowBlocks};

impl Engine<'_> {
    pub(super) fn forgetting(
        &self,
        span: Span<f64>,
        sigma: Vec<f64>,
        sigma_given: bool,
    ) -> Result<Fit, FitError> {
        let (mut pass, mut convergence) = self.remember(span, sigma)?;
        if !sigma_given {
            for _ in 0..SIGMA_ROUNDS {
                let sigma = self.sigma_of_the_remembered(span, &pass);
                (pass, convergence) = self.remember(span, sigma)?;
            }
        }
        let mut conclusion = self.conclude(&pass, sigma_given);
        conclusion.outliers.clone_from(&pass.weights.outliers);
        self.restrict(&mut conclusion, span, &pass.weighing);
        // Intervals as wide as the result's, which is known only now.
        let wider = conclusion.check.variance_scale.sqrt() * conclusion.noise.coverage_factor()
            / Noise::Given.coverage_factor();
        for measured in convergence.iter_mut().flat_map(|point| point.parameters.iter_mut().flatten()) {
            measured.u95 *= wider;
        }
        self.finish(pass, conclusion, convergence, Some(span))
    }

    /// Returns what errors that are not estimated bring to an estimate that has forgotten older rows: of the
    /// rows in the span `φ̂ − φ = (AᵀWA)⁻¹ AᵀW c_k θ_k` (S. F. Schmidt, 1966, consider parameters); then how
    /// much of it is known beforehand.
    pub(super) fn considered(
        &self,
        pass: &Pass,
        conclusion: &Conclusion,
        span: Span<f64>,
    ) -> Result<(Vec<NuisanceFit>, DVector<f64>), FitError> {
        let Some(rows) = self.linearise(&conclusion.estimate.values)? else {
            return Ok((Vec::new(), DVector::zeros(self.parameters)));
        };
        let first = rows.len() - recent(&conclusion.residuals, span).len().min(rows.len());
        let joint = rows.absorb(first..rows.len(), self.columns.all(), &pass.weighing.whitening, None).r();
        let n = self.parameters;
        let (own, others) =
            (joint.view((0, 0), (n, n)), joint.view((0, n), (n, self.columns.nuisances.len())));
        let moved = own.clone_owned().svd(true, true).solve(&others.clone_owned(), f64::EPSILON);
        let moved = moved.unwrap_or_else(|_| DMatrix::zeros(n, self.columns.nuisances.len()));
        let Prior { mean, colouring, .. } = &self.columns.prior;
        let brought = -(&moved * colouring);
        let of = |(k, nuisance): (usize, &Nuisance)| NuisanceFit {
            nuisance: nuisance.clone(),
            expected: mean[n + k] + self.columns.corrected[k],
            value: mean[n + k] + self.columns.corrected[k],
            sd: nuisance.sigma,
            drawn: 0.0,
            contributions: brought.column(k).iter().copied().collect(),
        };
        let found = self.columns.nuisances.iter().enumerate().map(of).collect();
        Ok((found, moved * mean.rows(n, self.columns.nuisances.len())))
    }

    /// Restricts what residuals say to the rows that are retained.
    pub(super) fn restrict(&self, conclusion: &mut Conclusion, span: Span<f64>, weighing: &Weighing) {
        let channels = self.source.channels().len();
        let blocks = conclusion.factor.rows() as f64 / channels.max(1) as f64;
        conclusion.share = blocks / self.blocks.len().max(1) as f64;
        let recent = recent(&conclusion.residuals, span);
        conclusion.residual_rms = rms(recent, channels);
        conclusion.coloured = self.coloured(recent, weighing, &conclusion.check);
    }

    pub(super) fn sigma_of_the_remembered(&self, span: Span<f64>, pass: &Pass) -> Vec<f64> {
        let estimate = self.estimate(&pass.factor, 1.0, Noise::Given);
        let weights =
            Weights::of(&*self.blocks, &Reference::of(&estimate, 1.0, self.limit), &pass.weighing.total);
        let residuals = self.residuals(&*self.blocks, &estimate.values, &weights);
        let channels = self.source.channels();
        let fitted = vec![estimate.rank() as f64 / channels.len().max(1) as f64; channels.len()];
        let channels = (channels, &*self.source.nominal_sigma());
        raw_sigma(&*self.blocks, channels, &self.measured_rms, &fitted, recent(&residuals, span))
    }

    /// Returns the root mean square, per whitened row, of what noise of the signals brings to the
    /// coefficients.
    pub(super) fn coefficient_noise(&self, weighing: &Weighing) -> Vec<f64> {
        let rows = (self.blocks.len() * weighing.sigma.len()).max(1) as f64;
        match &self.noise {
            Some(noise) => {
                let gram = noise.gram(weighing);
                gram.diagonal().iter().take(self.parameters).map(|square| (square / rows).sqrt()).collect()
            }
            None => vec![0.0; self.parameters],
        }
    }

    pub(super) fn remember(
        &self,
        span: Span<f64>,
        sigma: Vec<f64>,
    ) -> Result<(Pass<'_>, Vec<Convergence>), FitError> {
        let (blocks, channels, n) = (&*self.blocks, sigma.len(), self.parameters);
        let filter = blocks.filter();
        let weighing = self.diagonal(sigma);
        let noise = match self.source.coefficient_noise(filter, &weighing.sigma) {
            Some(noise) => noise,
            None => self.coefficient_noise(&weighing),
        };
        let (Span::TimeConstant(span_s) | Span::Window(span_s)) = span;
        let mut memory = Memory::new(span, filter, noise, channels)
            .ok_or(FitError::Forgetting { span_s, width_s: filter.width_s })?;
        let whitening = &weighing.whitening;
        let every = convergence::every(blocks, self.options.convergence_points, n);
        let mut watch = Watch::new(&weighing.sigma, filter.noise_gain);
        let mut weights = Weights::none(channels);
        let mut reference: Option<Reference> = None;
        // First block that is not in the memory.
        let mut waiting = 0;
        let (mut rows, mut measured, mut own) =
            (vec![0.0; channels * n], vec![0.0; channels], vec![1.0; channels]);
        let mut points = Vec::new();
        for block in 0..blocks.len() {
            blocks.write(block, &mut rows, &mut measured);
            if let Some(reference) = &reference
                && watch.weigh(reference, &rows, &measured, &mut own)
            {
                weights.set(block, blocks.len(), &own);
            }
            if block + 1 - waiting >= memory.segment_blocks as usize {
                memory.take(&blocks.absorb(waiting..block + 1, n, whitening, weights.as_slice()));
                waiting = block + 1;
                let whole = memory.factor();
                let deviations = whole.standard_deviations();
                if let Some(parameters) = whole.well_determined(&deviations) {
                    memory.recentre(&parameters);
                    let before = reference.iter().flat_map(|r| &r.standard_deviation);
                    // One that a segment makes twice as good was no measure of the noise.
                    if before.zip(&deviations).any(|(before, now)| now + now < *before) {
                        watch.forget_statistics();
                    }
                    let limit = self.limit;
                    reference = Some(Reference {
                        parameters,
                        standard_deviation: deviations,
                        noise_scale: 1.0,
                        limit,
                    });
                }
            }
            if every > 0 && (block + 1) % every == 0 {
                let mut whole = memory.factor();
                whole.merge(&blocks.absorb(waiting..block + 1, n, whitening, weights.as_slice()));
                let estimate = self.estimate(&whole, 1.0, Noise::Given);
                points.push(Convergence {
                    time_s: blocks.time_s(block),
                    parameters: (0..n).map(|j| estimate.measured(j)).collect(),
                });
            }
        }
        let mut factor = memory.factor();
        factor.merge(&blocks.absorb(waiting..blocks.len(), n, whitening, weights.as_slice()));
        Ok((Pass { weighing, factor, gram: None, linearised: None, weights }, points))
    }
}

/// Returns the residuals of the last seconds, as many as the span.
fn recent(residuals: &[BlockResidual], span: Span<f64>) -> &[BlockResidual] {
    let (Span::TimeConstant(span_s) | Span::Window(span_s)) = span;
    let end_s = residuals.last().map_or(0.0, |r| r.time_s);
    let first = residuals.partition_point(|r| r.time_s < end_s - span_s);
    residuals.get(first..).unwrap_or(residuals)
}
