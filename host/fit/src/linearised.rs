//! Rows with the columns of nuisance parameters, linearised about an estimate.
//!
//! With errors θ of sensors and mounting the rows say `y = A(θ) φ + e(θ)`. About φ̂ this is
//! ```text
//! y = A φ + Σ_k c_k θ_k,   c_k = ∂/∂θ_k (A(θ) φ̂ + e(θ)) at zero
//! ```
//! which at `φ = φ̂` is exact in all that is linear in θ. The columns follow the parameters'; what is known
//! beforehand are rows `θ_k = 0 ± σ_k`, or those of a normal distribution of errors and parameters.

mod left;

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::{
    Channel, Effect, Factor, Filter, FitError, Gaussian, Nuisance, OtherColumns, RigError, RigRows,
    RowBlocks, RowSource, SampleCounts, Scope,
};
use super::{SampleRows, Silent, Whitening, left_of_rows::dot};
use super::{condition, features};

/// Features of the drift.
pub(super) const DRIFTS: usize = 2;

/// The nuisance parameters of a source.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    pub(super) nuisances: Vec<Nuisance>,
    /// Parameters before them.
    parameters: usize,
    /// The place of each channel's offset among the parameters.
    offsets: Vec<Option<usize>>,
    /// Columns of signal errors that the source has.
    signals: usize,
    /// Further knowledge of errors: rows of all columns with their values, of unit σ.
    observations: Vec<(Vec<f64>, f64)>,
    /// The number of them that rows determine ([`RowSource::determined_errors`]).
    determined: usize,
    /// The prior knowledge of what is left of them.
    pub(super) prior: Prior,
    /// The value of each that the signals are corrected for.
    pub(super) corrected: Vec<f64>,
}

/// The prior knowledge of all columns: rows `W x = W μ ± 1`.
#[derive(Clone, Debug)]
pub(super) struct Prior {
    /// μ; zero of what nothing is known of.
    pub(super) mean: DVector<f64>,
    /// W, a row for each column, zero where nothing is known.
    pub(super) whitening: DMatrix<f64>,
    /// Covariance of the nuisance parameters.
    pub(super) covariance: DMatrix<f64>,
    /// A root of that: what one standard deviation of each independent part moves.
    pub(super) colouring: DMatrix<f64>,
}

impl Prior {
    /// Returns what the nuisance parameters' own σ say, or a distribution of those that are in it.
    fn new(parameters: &[super::Parameter], nuisances: &mut [Nuisance], known: Option<&Gaussian>) -> Self {
        let (n, count) = (parameters.len(), nuisances.len());
        let all = n + count;
        let mut prior = Self {
            mean: DVector::zeros(all),
            whitening: DMatrix::zeros(all, all),
            covariance: DMatrix::zeros(count, count),
            colouring: DMatrix::zeros(count, count),
        };
        let names: Vec<String> =
            parameters.iter().map(|p| &p.name).chain(nuisances.iter().map(|k| &k.name)).cloned().collect();
        let place = |name: &str| names.iter().position(|own| own == name);
        let known = known.map(|known| known.only(|name| place(name).is_some()));
        for (k, nuisance) in nuisances.iter_mut().enumerate() {
            if let Some(sd) = known.as_ref().and_then(|known| known.sd(&nuisance.name)) {
                nuisance.sigma = sd;
                continue;
            }
            prior.whitening[(n + k, n + k)] = 1.0 / nuisance.sigma;
            prior.covariance[(k, k)] = nuisance.sigma.powi(2);
            prior.colouring[(k, k)] = nuisance.sigma;
        }
        let Some(known) = known else { return prior };
        let at: Vec<usize> = known.names().iter().filter_map(|name| place(name)).collect();
        let whitening = known.whitening();
        for (i, to) in at.iter().enumerate() {
            prior.mean[*to] = known.mean()[i];
            for (j, from) in at.iter().enumerate() {
                prior.whitening[(*to, *from)] = whitening[(i, j)];
            }
        }
        let errors = known.only(|name| place(name).is_some_and(|at| at >= n));
        let at: Vec<usize> = at.into_iter().filter_map(|at| at.checked_sub(n)).collect();
        let colouring = errors.colouring();
        for (i, to) in at.iter().enumerate() {
            for (j, from) in at.iter().enumerate() {
                prior.covariance[(*to, *from)] = errors.covariance()[(i, j)];
                prior.colouring[(*to, *from)] = colouring[(i, j)];
            }
        }
        prior
    }
}

impl Columns {
    /// Returns the nuisance parameters that a source has, those whose σ is zero left out.
    pub(super) fn of(source: &dyn RowSource) -> Self {
        let mut nuisances = source.nuisances();
        let determined = nuisances.iter().take(source.determined_errors()).filter(|k| k.sigma > 0.0).count();
        nuisances.retain(|k| k.sigma > 0.0);
        let mut prior = Prior::new(source.parameters(), &mut nuisances, source.beforehand());
        let parameters = source.parameters().len();
        let about =
            |name: &str| source.corrected_for().iter().find(|(own, _)| own == name).map_or(0.0, |e| e.1);
        let corrected: Vec<f64> = nuisances.iter().map(|k| about(&k.name)).collect();
        prior.mean.iter_mut().skip(parameters).zip(&corrected).for_each(|(mean, about)| *mean -= about);
        let observations = source.error_observations().into_iter().filter(|row| row.sd > 0.0);
        let observations = observations.map(|row| {
            let mut whitened = vec![0.0; parameters + nuisances.len()];
            for (name, factor) in &row.terms {
                if let Some(k) = nuisances.iter().position(|k| k.name == *name) {
                    whitened[parameters + k] = factor / row.sd;
                }
            }
            let taken: f64 = row.terms.iter().map(|(name, factor)| factor * about(name)).sum();
            (whitened, (row.value - taken) / row.sd)
        });
        let observations = observations.filter(|(row, _)| row.iter().any(|w| *w != 0.0)).collect();
        let number = |k: &Nuisance| match k.effect {
            Effect::Signal(s) => s + 1,
            _ => 0,
        };
        Self {
            signals: nuisances.iter().map(number).max().unwrap_or(0),
            observations,
            nuisances,
            parameters,
            determined,
            offsets: source.channels().iter().map(|c: &Channel| c.offset).collect(),
            prior,
            corrected,
        }
    }

    /// Returns true if there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.nuisances.is_empty()
    }

    /// Returns the number of columns: parameters, then nuisance parameters.
    pub(super) fn all(&self) -> usize {
        self.parameters + self.nuisances.len()
    }

    /// Spreads C rows of the parameters alone, with which `rows` begins, to rows of all columns. `phi` is φ̂,
    /// `sensitivities` are C rows of the errors of signals, `drift` are the Legendre polynomials of the time.
    fn spread(&self, rows: &mut [f64], phi: &[f64], sensitivities: &[f64], drift: [f64; 2]) {
        let (n, all) = (self.parameters, self.all());
        let channels = self.offsets.len();
        let mut predicted = vec![0.0; channels];
        for c in (0..channels).rev() {
            rows.copy_within(c * n..(c + 1) * n, c * all);
            let row = &mut rows[c * all..(c + 1) * all];
            row[n..].fill(0.0);
            let constant = self.offsets[c].map_or(0.0, |j| row[j] * phi.get(j).copied().unwrap_or(0.0));
            predicted[c] = dot(&row[..n], phi) - constant;
        }
        for (k, nuisance) in self.nuisances.iter().enumerate() {
            match nuisance.effect {
                Effect::Gain { channel } => rows[channel * all + n + k] = predicted[channel],
                Effect::CrossTalk { from, to } => rows[to * all + n + k] = predicted[from],
                Effect::None => {}
                Effect::Drift { channel, degree } => {
                    rows[channel * all + n + k] = drift[usize::from(degree > 1)];
                }
                Effect::Signal(signal) => {
                    for c in 0..channels {
                        let own = sensitivities.get(c * self.signals + signal);
                        rows[c * all + n + k] = own.copied().unwrap_or(0.0);
                    }
                }
            }
        }
    }

    /// Returns the degrees of freedom that what is known beforehand takes of a joint estimate with this
    /// covariance.
    pub(super) fn known(&self, covariance: &DMatrix<f64>) -> f64 {
        let of = |row: DVector<f64>| (covariance * &row).dot(&row).clamp(0.0, 1.0);
        let prior: f64 = self.prior.whitening.row_iter().map(|row| of(row.transpose())).sum();
        prior + self.observations.iter().map(|(row, _)| of(DVector::from_column_slice(row))).sum::<f64>()
    }

    /// Returns a joint factor over the parameters and the errors that other recordings share, those of this
    /// one eliminated with what is known of them; `None` if what is known does not come apart like that.
    pub(super) fn rig_rows(&self, joint: &Factor) -> Option<RigRows> {
        let (n, count) = (self.parameters, self.nuisances.len());
        let Prior { mean, whitening, covariance, .. } = &self.prior;
        let shared: Vec<usize> = (0..count).filter(|k| self.nuisances[*k].scope == Scope::Rig).collect();
        let is_own = |j: usize| j >= n && self.nuisances[j - n].scope == Scope::Recording;
        let mut rows = joint.clone();
        if self.determined < count {
            rows = rows.for_given_others(n + self.determined);
        }
        let mut known = Vec::new();
        for (k, row) in whitening.row_iter().enumerate() {
            let mut others = (0..n + count).filter(|j| row[*j] != 0.0);
            if is_own(k) {
                let alone = others.all(is_own);
                known.push((row.iter().copied().collect::<Vec<f64>>(), alone.then(|| (row * mean)[0])?));
            } else if others.any(|j| j < n || is_own(j)) {
                return None;
            }
        }
        known.extend(self.observations.iter().cloned());
        rows.absorb(known.iter().map(|(row, value)| (row.as_slice(), *value)));
        let left = rows.residual_sum_of_squares();
        let kept: Vec<usize> = (0..n).chain(shared.iter().map(|k| n + k)).collect();
        let rows = rows.with_residual(left, joint.rows()).eliminate_others(&kept);
        // The columns are those of what is left of an error that the signals are corrected for.
        let about: Vec<f64> = (0..n).map(|_| 0.0).chain(shared.iter().map(|k| -self.corrected[*k])).collect();
        let errors = shared.iter().map(|k| {
            let Nuisance { name, group, unit, basis, .. } = self.nuisances[*k].clone();
            let expected = mean[n + k] + self.corrected[*k];
            let sigma = covariance[(*k, *k)].sqrt();
            RigError { instrument: String::new(), name, group, unit, basis, expected, sigma }
        });
        let covariance = covariance.select_rows(&shared).select_columns(&shared);
        RigRows::new(n, rows.about(&about), errors.collect(), covariance)
    }

    /// Returns a joint factor with what is known beforehand, and beside the rows, in it.
    pub(super) fn with_prior(&self, joint: &Factor) -> Factor {
        let Prior { mean, whitening, .. } = &self.prior;
        let rows = whitening.row_iter().filter(|row| row.iter().any(|w| *w != 0.0));
        let rows: Vec<(Vec<f64>, f64)> =
            rows.map(|row| (row.iter().copied().collect(), (row * mean)[0])).collect();
        let mut known = joint.clone();
        if self.determined < self.nuisances.len() {
            known = known.for_given_others(self.parameters + self.determined);
        }
        known.absorb(rows.iter().map(|(row, value)| (row.as_slice(), *value)));
        known.absorb(self.observations.iter().map(|(row, value)| (row.as_slice(), *value)));
        let left = known.residual_sum_of_squares();
        // What is known beforehand are no measurements.
        known.with_residual(left, joint.rows())
    }
}

/// Returns the Legendre polynomials of the first and second degree.
fn legendre(t: f64) -> [f64; 2] {
    [t, 1.5 * t * t - 0.5]
}

/// Columns of the errors of signals about φ̂.
pub(super) enum Sensitivities {
    /// The row blocks have them.
    Direct,
    /// By block, channel and error.
    Stored(Vec<f64>),
}

impl Sensitivities {
    /// Returns the columns of a source: its row blocks' own, else half the differences of what it predicts
    /// with errors of either sign, of the size of their σ.
    ///
    /// # Errors
    /// [`FitError`] if a source with errors cannot be filtered.
    pub(super) fn of(
        source: &dyn RowSource,
        blocks: &dyn RowBlocks,
        columns: &Columns,
        phi: &[f64],
    ) -> Result<Self, FitError> {
        let (channels, signals) = (source.channels().len(), columns.signals);
        let mut own = vec![0.0; channels * signals];
        if signals == 0 || blocks.is_empty() || blocks.sensitivities(0, phi, &mut own) {
            return Ok(Self::Direct);
        }
        let mut all = vec![0.0; blocks.len() * channels * signals];
        let of_errors = source.error_columns(phi).filter(|rows| rows.parameters().len() == signals);
        if let Some(of_errors) = of_errors {
            let made = of_errors.condition(&Silent)?;
            let mut measured = vec![0.0; channels];
            let own = all.chunks_exact_mut((channels * signals).max(1)).enumerate();
            own.for_each(|(block, own)| made.write(block, own, &mut measured));
            return Ok(Self::Stored(all));
        }
        for nuisance in &columns.nuisances {
            let Effect::Signal(signal) = nuisance.effect else { continue };
            for sign in [1.0, -1.0] {
                let mut errors = vec![0.0; signals];
                errors[signal] = sign * nuisance.sigma;
                let Some(moved) = source.with_errors(&errors) else { continue };
                let moved = contracted(&*moved, phi).condition(&Silent)?;
                let (mut predicted, mut measured) = (vec![0.0; channels], vec![0.0; channels]);
                for block in 0..blocks.len().min(moved.len()) {
                    moved.write(block, &mut predicted, &mut measured);
                    for (c, (predicted, measured)) in predicted.iter().zip(&measured).enumerate() {
                        let change = sign * (predicted - measured) / (2.0 * nuisance.sigma);
                        all[(block * channels + c) * signals + signal] += change;
                    }
                }
            }
        }
        Ok(Self::Stored(all))
    }

    /// Writes the columns of a block, C rows.
    pub(super) fn write(&self, blocks: &dyn RowBlocks, block: usize, phi: &[f64], out: &mut [f64]) {
        match self {
            Self::Direct => {
                blocks.sensitivities(block, phi, out);
            }
            Self::Stored(all) => {
                let length = out.len();
                if let Some(own) = all.get(block * length..(block + 1) * length) {
                    out.copy_from_slice(own);
                }
            }
        }
    }
}

/// A source whose rows have one coefficient: what given parameters predict.
fn contracted<'a>(source: &'a dyn RowSource, phi: &'a [f64]) -> OtherColumns<'a> {
    let one = source.parameters()[..1].to_vec();
    OtherColumns::new(source, one, move |sample, rows| {
        let mut all = SampleRows::default();
        all.clear(source.channels().len(), phi.len());
        source.rows(sample, &mut all)?;
        let n = phi.len().max(1);
        for (to, row) in rows.smoothed.iter_mut().zip(all.smoothed.chunks_exact(n)) {
            *to = dot(row, phi);
        }
        for (to, row) in rows.differentiated.iter_mut().zip(all.differentiated.chunks_exact(n)) {
            *to = dot(row, phi);
        }
        (rows.measured, rows.missing) = (all.measured, all.missing);
        Ok(())
    })
}

/// Row blocks with the columns of nuisance parameters about an estimate.
pub(super) struct Linearised<'a> {
    blocks: &'a dyn RowBlocks,
    columns: &'a Columns,
    phi: Vec<f64>,
    sensitivities: Sensitivities,
    /// Middle and half the length of the recording, s; blocks where there is no time.
    span: (f64, f64),
}

impl<'a> Linearised<'a> {
    /// Linearises the rows of a source about `phi`.
    ///
    /// # Errors
    /// See [`Sensitivities::of`].
    pub(super) fn new(
        source: &dyn RowSource,
        blocks: &'a dyn RowBlocks,
        columns: &'a Columns,
        phi: &[f64],
    ) -> Result<Self, FitError> {
        let sensitivities = Sensitivities::of(source, blocks, columns, phi)?;
        let last = blocks.len().saturating_sub(1);
        let (from, to) = (blocks.time_s(0), blocks.time_s(last));
        let (from, to) = if to > from { (from, to) } else { (0.0, last as f64) };
        let span = (0.5 * (from + to), (0.5 * (to - from)).max(f64::MIN_POSITIVE));
        Ok(Self { blocks, columns, phi: phi.to_vec(), sensitivities, span })
    }

    /// Returns φ̂.
    pub(super) fn phi(&self) -> &[f64] {
        &self.phi
    }

    /// Spreads the rows of a block to all columns, with the columns of the errors of signals.
    fn spread(&self, block: usize, rows: &mut [f64], sensitivities: &[f64]) {
        self.columns.spread(rows, &self.phi, sensitivities, legendre(self.time(block)));
        // Drift is not seen there.
        for (c, row) in rows.chunks_exact_mut(self.columns.all().max(1)).enumerate() {
            if !self.blocks.measures(block, c) {
                row.fill(0.0);
            }
        }
    }

    fn time(&self, block: usize) -> f64 {
        let (middle, half) = self.span;
        let is_timed = self.blocks.time_s(self.blocks.len().saturating_sub(1)) > self.blocks.time_s(0);
        let at = if is_timed { self.blocks.time_s(block) } else { block as f64 };
        (at - middle) / half
    }
}

impl RowBlocks for Linearised<'_> {
    fn filter(&self) -> &Filter {
        self.blocks.filter()
    }

    fn counts(&self) -> &SampleCounts {
        self.blocks.counts()
    }

    fn parts(&self) -> &[Range<usize>] {
        self.blocks.parts()
    }

    fn time_s(&self, block: usize) -> f64 {
        self.blocks.time_s(block)
    }

    fn write(&self, block: usize, rows: &mut [f64], measured: &mut [f64]) {
        let Columns { offsets, parameters, signals, .. } = self.columns;
        self.blocks.write(block, &mut rows[..offsets.len() * parameters], measured);
        let mut own = vec![0.0; offsets.len() * signals];
        self.sensitivities.write(self.blocks, block, &self.phi, &mut own);
        self.spread(block, rows, &own);
    }

    fn measures(&self, block: usize, channel: usize) -> bool {
        self.blocks.measures(block, channel)
    }

    fn write_blocks(&self, blocks: Range<usize>, channels: usize, rows: &mut [f64], measured: &mut [f64]) {
        left::write(self, blocks, channels, rows, measured);
    }

    fn left(&self, blocks: Range<usize>, values: &[f64], out: &mut [f64]) {
        left::left(self, blocks, values, out);
    }

    fn features(&self) -> usize {
        let is_direct = matches!(self.sensitivities, Sensitivities::Direct);
        let own = self.blocks.features();
        if is_direct && own > 0 { own + DRIFTS } else { 0 }
    }

    fn write_features(&self, block: usize, out: &mut [f64]) {
        let own = out.len().saturating_sub(DRIFTS);
        if let Some((own, drift)) = out.split_at_mut_checked(own) {
            self.blocks.write_features(block, own);
            drift.copy_from_slice(&legendre(self.time(block)));
        }
    }

    fn write_of(&self, features: &[f64], rows: &mut [f64], measured: &mut [f64]) {
        let Columns { offsets, parameters, signals, .. } = self.columns;
        let Some((features, drift)) = features.split_last_chunk() else { return };
        self.blocks.write_of(features, &mut rows[..offsets.len() * parameters], measured);
        let mut own = vec![0.0; offsets.len() * signals];
        self.blocks.sensitivities_of(features, &self.phi, &mut own);
        self.columns.spread(rows, &self.phi, &own, *drift);
    }

    fn absorb(
        &self,
        blocks: Range<usize>,
        parameters: usize,
        whitening: &Whitening,
        weights: Option<&[f64]>,
    ) -> Factor {
        match weights {
            None if self.features() > 0 => features::absorb(self, blocks, parameters, whitening),
            _ => condition::absorb(self, blocks, parameters, whitening, weights),
        }
    }
}

/// Rows of noise alone, with the columns of nuisance parameters: half the difference of blocks with noise of
/// either sign.
pub(super) struct NoiseColumns<'a> {
    columns: &'a Columns,
    phi: &'a [f64],
    more: (&'a dyn RowBlocks, &'a Sensitivities),
    less: (&'a dyn RowBlocks, &'a Sensitivities),
    by: f64,
}

impl<'a> NoiseColumns<'a> {
    /// Returns the columns about φ̂ of two sets of blocks that differ by noise of the size `sigma`, of either
    /// sign.
    pub(super) fn new(
        columns: &'a Columns,
        phi: &'a [f64],
        [more, less]: [(&'a dyn RowBlocks, &'a Sensitivities); 2],
        sigma: f64,
    ) -> Self {
        Self { columns, phi, more, less, by: 0.5 / sigma }
    }

    /// Spreads the rows of a block, of noise of unit σ, to all columns.
    pub(super) fn spread(&self, block: usize, rows: &mut [f64]) {
        let length = self.columns.offsets.len() * self.columns.signals;
        let (mut own, mut other) = (vec![0.0; length], vec![0.0; length]);
        self.more.1.write(self.more.0, block, self.phi, &mut own);
        self.less.1.write(self.less.0, block, self.phi, &mut other);
        own.iter_mut().zip(&other).for_each(|(a, b)| *a = self.by * (*a - b));
        // Nothing drifts of noise alone.
        self.columns.spread(rows, self.phi, &own, [0.0; 2]);
    }
}

#[cfg(test)]
#[path = "linearised_tests.rs"]
mod tests;
