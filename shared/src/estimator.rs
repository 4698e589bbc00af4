//! The pipeline from an aligned reading to the factor: what firmware and host both run.
//!
//! Lives here: the order of the steps, whitening, the counters ([`Pipeline`]); and what makes rows of
//! readings ([`Model`]): one body ([`Estimator`]) or two links ([`TwoLinkEstimator`]). May not live here: the
//! steps themselves ([`crate::screening`], [`crate::calibration`], [`crate::regressor`], [`crate::tree`],
//! [`crate::conditioning`],
//! [`crate::factor`]), messages, files.

mod config;
mod counters;
pub mod frames;
mod knocks;
mod model;
mod noise;
pub mod two_links;
pub mod watch;

pub use config::{ConfigError, EstimatorConfig};
pub use counters::{ChannelStatistics, Counters};
pub use knocks::{LONGEST as LONGEST_KNOCK, Reference};
pub use model::{Model, OneBody, Store};
pub use noise::{BODY, BodyNoise, Noiseless, Refreshed, RowNoise};
pub use two_links::{JointAttitude, TwoLinkReading, TwoLinks};

use crate::Scalar;
use crate::calibration::ImuMounting;
use crate::conditioning::{Conditioner, Kernel};
use crate::factor::{Gathering, Gram, InformationFactor};
use crate::forgetting::{ImuNoise, MemoryConfig, Plan};
use crate::linear_algebra::ROOM;
use crate::regressor::{self, RegressorBlock, SIGNALS, SMOOTHED};
use crate::screening::{Limits, Rejection};
use config::{check_sigma, period_ns, plan, weights};
use knocks::Watch;

/// Tells what became of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The reading may not be used; the filter starts anew after it.
    Rejected(Rejection),
    /// The reading is in the filter.
    Pending,
    /// The reading completed a row block, which is now in the factor.
    Absorbed,
}

/// The estimator of one body's `N` parameters: 10, or 16 with the wrench offset. `TAPS` is the room for the
/// filter.
pub type Estimator<T, const N: usize, const TAPS: usize> =
    Pipeline<T, OneBody<T>, N, SIGNALS, { SIGNALS - SMOOTHED }, TAPS>;

/// The estimator of two links' `N` parameters: 19, or 25 with the wrench offset.
pub type TwoLinkEstimator<T, const N: usize, const TAPS: usize> =
    Pipeline<T, TwoLinks<T>, N, { two_links::SIGNALS }, { two_links::DIFFERENTIATED }, TAPS>;

/// The estimator of `N` parameters from the rows that `M` makes of readings, by way of `S` signals of which
/// the last `D` are differentiated. `TAPS` is the room for the filter.
#[derive(Clone, Copy, Debug)]
pub struct Pipeline<
    T: Scalar,
    M: Model<T, N, S>,
    const N: usize,
    const S: usize,
    const D: usize,
    const TAPS: usize,
> {
    config: EstimatorConfig<T>,
    model: M,
    conditioner: Conditioner<T, S, D, TAPS>,
    store: M::Store,
    noise: M::Noise,
    gathering: Gathering<T, N>,
    looking: Looking,
    /// Standard deviations of what is gathered, between the last steps of a check.
    deviations: [T; N],
    memory: Option<Plan<T, N>>,
    /// A segment that is not yet in the memory is in the gathering.
    segment_waits: bool,
    /// The factor of a moment, as far as it is put together.
    snapshot: Snapshot<T, M::Store, N>,
    /// √row_every / σ per channel.
    weights: [T; 6],
    period_ns: u64,
    last_time_ns: Option<u64>,
    counters: Counters,
    reference: Option<Reference<T, N>>,
    watch: Watch<T>,
    statistics: ChannelStatistics<T>,
    /// The factor on each row of the last block beside its weight.
    last_factors: [T; 6],
    last_signals: Option<[T; S]>,
}

impl<T: Scalar, const N: usize, const TAPS: usize> Estimator<T, N, TAPS> {
    /// Returns an estimator that has seen nothing.
    ///
    /// # Errors
    /// [`ConfigError`] says which setting is impossible.
    pub fn new(config: &EstimatorConfig<T>) -> Result<Self, ConfigError> {
        const { assert!(N == 10 || N == 16, "ten parameters, or sixteen with the offset") }
        let mut estimator = Self::UNUSED;
        estimator.begin(config)?;
        Ok(estimator)
    }

    /// Makes it such an estimator in place; see [`Self::set_up`].
    ///
    /// # Errors
    /// See [`Self::new`].
    pub fn begin(&mut self, config: &EstimatorConfig<T>) -> Result<(), ConfigError> {
        self.set_up(config, &OneBody::NEW)
    }

    /// Returns the row block absorbed last, not whitened.
    pub fn last_block(&self) -> Option<RegressorBlock<T>> {
        self.last_signals.map(|signals| regressor::block(&signals, &self.config.mounting.position))
    }
}

impl<T: Scalar, M: Model<T, N, S>, const N: usize, const S: usize, const D: usize, const TAPS: usize>
    Pipeline<T, M, N, S, D, TAPS>
{
    /// The estimator before it is set up: [`Self::set_up`] must follow. All bits are zero, so that it costs
    /// no flash to write it.
    pub const UNUSED: Self = Self {
        config: EstimatorConfig {
            rate_hz: T::ZERO,
            filter_width_s: T::ZERO,
            row_every: 0,
            channel_sigma: [T::ZERO; 6],
            known_offset: [T::ZERO; 6],
            mounting: ImuMounting::UNUSED,
            limits: Limits::ZERO,
        },
        model: M::UNUSED,
        conditioner: Conditioner::UNUSED,
        store: M::Store::EMPTY,
        noise: M::Noise::UNUSED,
        gathering: Gathering::EMPTY,
        looking: Looking::Gathering,
        deviations: [T::ZERO; N],
        memory: None,
        segment_waits: false,
        snapshot: Snapshot {
            store: M::Store::EMPTY,
            segment: None,
            whole: InformationFactor::EMPTY,
            step: 0,
        },
        weights: [T::ZERO; 6],
        period_ns: 0,
        last_time_ns: None,
        counters: Counters::NONE,
        reference: None,
        watch: Watch::UNUSED,
        statistics: ChannelStatistics::NONE,
        last_factors: [T::ZERO; 6],
        last_signals: None,
    };

    /// Makes it an estimator that has seen nothing, in place: the fewer copies of it a stack has to hold the
    /// better. On an error it is of no use.
    ///
    /// # Errors
    /// [`ConfigError`] says which setting is impossible.
    pub fn set_up(&mut self, config: &EstimatorConfig<T>, model: &M) -> Result<(), ConfigError> {
        check_sigma(config)?;
        self.conditioner
            .set_up(config.rate_hz, config.filter_width_s, config.row_every)
            .map_err(ConfigError::Kernel)?;
        self.config = *config;
        self.model = *model;
        self.watch = Watch::new(&config.channel_sigma, self.conditioner.kernel().noise_gain());
        self.weights = weights(config);
        self.period_ns = period_ns(config.rate_hz, config.filter_width_s);
        (self.memory, self.noise) = (None, M::Noise::UNUSED);
        self.reset();
        Ok(())
    }

    /// States the noise of the IMU per reading, 1 σ, and starts anew: rows are then weighed by it, and what
    /// it adds to the factor is taken off from estimates. Without, and of models whose rows it is not known
    /// in, the load cell's noise is the only one.
    ///
    /// # Errors
    /// [`ConfigError::ImuNoise`] if a number is negative or not finite. Nothing changes.
    #[inline(never)]
    pub fn set_imu_noise(&mut self, imu: &ImuNoise<T>) -> Result<(), ConfigError> {
        if ![imu.accel, imu.gyro].iter().all(|sigma| sigma.is_finite() && *sigma >= T::ZERO) {
            return Err(ConfigError::ImuNoise);
        }
        self.noise.set_up(&self.config, self.conditioner.kernel(), self.conditioner.averaged(), imu);
        self.reset();
        Ok(())
    }

    /// Retains rows as this says instead of all, and starts anew. [`Self::remember`] must then be called
    /// after every reading, or soon after: it is not done within one, as it takes some hundred thousand
    /// operations.
    ///
    /// # Errors
    /// [`ConfigError::Memory`]: a span shorter than the filter or not finite, rows without time, or rows that only a
    /// store of everything takes. Nothing changes.
    #[inline(never)]
    pub fn set_memory(&mut self, config: &MemoryConfig<T>) -> Result<(), ConfigError> {
        if !M::Store::FORGETS {
            return Err(ConfigError::Memory);
        }
        self.memory = Some(self.plan(config).ok_or(ConfigError::Memory)?);
        self.reset();
        Ok(())
    }

    fn plan(&self, memory: &MemoryConfig<T>) -> Option<Plan<T, N>> {
        plan(&self.config, self.conditioner.kernel(), memory)
    }

    /// Returns whether [`Self::set_up`] and, if something is to be forgotten, [`Self::set_memory`] would
    /// succeed.
    ///
    /// # Errors
    /// The errors that they would return.
    #[inline(never)]
    pub fn check(config: &EstimatorConfig<T>, memory: Option<&MemoryConfig<T>>) -> Result<(), ConfigError> {
        check_sigma(config)?;
        let (kernel, _) =
            Kernel::<T, TAPS>::for_rows(config.rate_hz, config.filter_width_s, config.row_every)
                .map_err(ConfigError::Kernel)?;
        match memory {
            Some(memory) if !M::Store::FORGETS || plan::<T, N, TAPS>(config, &kernel, memory).is_none() => {
                Err(ConfigError::Memory)
            }
            _ => Ok(()),
        }
    }

    /// Lets the model follow a reading without absorbing anything of it.
    #[inline(never)]
    pub fn follow(&mut self, reading: &M::Reading) {
        if self.model.screen(reading).is_ok() {
            self.model.signals(&self.config, reading);
        }
    }

    /// Returns what makes the rows.
    pub fn model(&self) -> &M {
        &self.model
    }

    /// Returns the configuration.
    pub fn config(&self) -> &EstimatorConfig<T> {
        &self.config
    }

    /// Takes one reading through the whole pipeline.
    #[inline]
    pub fn absorb(&mut self, reading: &M::Reading) -> Outcome {
        self.counters.readings = self.counters.readings.saturating_add(1);
        if let Err(rejection) = self.model.screen(reading) {
            self.reject(rejection);
            return Outcome::Rejected(rejection);
        }
        self.look_for_gap(M::time_ns(reading));
        let signals = self.model.signals(&self.config, reading);
        let rows = self.conditioner.push(&signals).and_then(|y| self.model.rows(&self.config, &y));
        match rows {
            Some(signals) => {
                self.absorb_signals(&signals);
                Outcome::Absorbed
            }
            None => Outcome::Pending,
        }
    }

    fn reject(&mut self, rejection: Rejection) {
        let (Rejection::NotFinite(channel) | Rejection::Saturated(channel) | Rejection::Frozen(channel)) =
            rejection;
        self.counters.rejected = self.counters.rejected.saturating_add(1);
        if let Some(count) = self.counters.rejected_by_channel.get_mut(usize::from(channel)) {
            *count = count.saturating_add(1);
        }
        self.counters.last_rejection = Some(rejection);
        self.conditioner.reset();
        self.noise.interrupt();
        self.last_time_ns = None;
    }

    /// Starts anew where half a period or more is missing or too much: the filter knows no time.
    fn look_for_gap(&mut self, time_ns: u64) {
        if self.period_ns == 0 {
            return;
        }
        if let Some(last) = self.last_time_ns {
            let step = time_ns.wrapping_sub(last);
            // From a half to one and a half: below wraps round.
            if step.wrapping_sub(self.period_ns / 2) > self.period_ns {
                self.counters.gaps = self.counters.gaps.saturating_add(1);
                self.conditioner.reset();
                self.noise.interrupt();
            }
        }
        self.last_time_ns = Some(time_ns);
    }

    /// Absorbs a row block, made of conditioned signals in the axes of S.
    fn absorb_signals(&mut self, signals: &[T; S]) {
        let mut weights = self.weights;
        if let Some(reference) = &self.reference {
            let mut innovation = M::residual(&self.config, &self.model, signals, &reference.parameters);
            let sd = &reference.standard_deviation;
            let spread = |c: usize| M::spread(&self.config, &self.model, signals, sd, c);
            self.last_factors = self.watch.factors(reference, spread, &innovation, &self.statistics);
            for ((e, weight), (factor, knocks)) in innovation
                .iter_mut()
                .zip(&mut weights)
                .zip(self.last_factors.iter().zip(&mut self.counters.knocks))
            {
                *e *= *factor;
                *weight *= *factor;
                *knocks = knocks.saturating_add(u16::from(*factor < T::ONE));
            }
            self.statistics.add(innovation);
        }
        let (factors, store, noise) = (&self.last_factors, &mut self.store, &mut self.noise);
        M::absorb(&self.config, &self.model, signals, &weights, factors, store, noise);
        self.last_signals = Some(*signals);
        self.counters.blocks = self.counters.blocks.saturating_add(1);
        if self.store.segment_is_complete() {
            self.close_segment();
        }
    }

    /// Does the rest of the work of the last row block, if there is any, with a reading that only waits in
    /// the filter. Returns true if there was.
    #[inline]
    pub fn settle(&mut self) -> bool {
        self.store.settle()
    }

    /// Takes the segment, unless one waits that is not yet stored; that one is followed by a longer one.
    #[cold]
    #[inline(never)]
    fn close_segment(&mut self) {
        if !self.segment_waits {
            self.store.take_segment(&mut self.gathering.whole);
            self.noise.close_segment(self.counters.blocks);
            self.segment_waits = true;
        }
    }

    /// Returns one factor of everything absorbed, or of what is retained of it. `(RᵀR)⁻¹` is the covariance
    /// for the σ of the configuration.
    pub fn factor(&self) -> InformationFactor<T, N> {
        let mut whole = self.store.factor();
        if self.segment_waits {
            whole.merge(&self.gathering.whole);
        }
        whole
    }

    /// Keeps a copy of everything absorbed so far, to make one factor of it while more is absorbed:
    /// [`Self::fold`].
    #[inline(never)]
    pub fn take_snapshot(&mut self) {
        self.snapshot.store = self.store;
        let memory = self.store.memory_gram();
        self.noise.take_snapshot(self.counters.blocks, self.segment_waits, memory.as_ref());
        self.snapshot.segment = self.segment_waits.then_some(self.gathering.whole);
        (self.snapshot.whole, self.snapshot.step) = (InformationFactor::EMPTY, 0);
    }

    /// Does one step towards the factor of the snapshot. Returns true when [`Self::folded`] is that.
    #[inline(never)]
    pub fn fold(&mut self) -> bool {
        let Snapshot { store, segment, whole, step } = &mut self.snapshot;
        if !store.fold(whole, step) {
            return false;
        }
        if let Some(segment) = segment.take() {
            whole.merge(&segment);
        }
        if self.noise.counts() {
            self.noise.begin_snapshot(&self.snapshot.whole);
        }
        true
    }

    /// Does one step towards the factor of the snapshot without what noise of the signals adds, once it is
    /// folded. Returns true when [`Self::folded`] is that: what estimates are made of. What is handed over is
    /// not compensated.
    #[inline(never)]
    pub fn compensate(&mut self) -> bool {
        if !self.noise.counts() {
            return true;
        }
        let done = self.noise.compensate(true);
        if done && let Some(compensated) = self.noise.compensated(true) {
            self.snapshot.whole = compensated;
        }
        done
    }

    /// Returns what noise of the signals has added to `RᵀR` of [`Self::folded`], before it is compensated;
    /// `None`: nothing.
    pub fn gram(&self) -> Option<&Gram<T, ROOM>> {
        self.noise.snapshot()
    }

    /// Returns the factor that [`Self::fold`] has put together: to the last bit that of [`Self::factor`] at
    /// the snapshot.
    pub fn folded(&self) -> &InformationFactor<T, N> {
        &self.snapshot.whole
    }

    /// Returns whether not everything is retained, [`Self::set_memory`].
    pub fn remembers(&self) -> bool {
        self.store.remembers()
    }

    /// Returns the row blocks in a segment of the memory, if there is one.
    pub fn segment_blocks(&self) -> Option<u16> {
        self.memory.as_ref().map(Plan::segment_blocks)
    }

    /// Returns whether [`Self::remember`] has something to do.
    #[inline]
    pub fn has_segment(&self) -> bool {
        self.segment_waits
    }

    /// Puts a segment that is complete into the memory, and checks what that now holds as [`Self::look`] does
    /// where everything is retained. `None` if there is no such segment.
    #[inline(never)]
    pub fn remember(&mut self, knock_limit: T) -> Option<[T; N]> {
        if !core::mem::take(&mut self.segment_waits) {
            return None;
        }
        let memory = self.store.memory()?;
        memory.take(&self.gathering.whole, self.noise.segment());
        let mut whole = memory.factor();
        if self.noise.counts() {
            self.noise.begin_memory(&whole, &memory.gram());
            while !self.noise.compensate(false) {}
            whole = self.noise.compensated(false).unwrap_or(whole);
        }
        let standard_deviation = whole.standard_deviations();
        let parameters = whole.well_determined(&standard_deviation);
        if let Some(parameters) = &parameters {
            memory.recentre(parameters);
        }
        self.refer_to(parameters, standard_deviation, knock_limit);
        while !self.refresh() {}
        if let (Some(noise), Some(memory)) = (self.noise.per_row(), self.store.memory()) {
            memory.set_noise(&noise);
        }
        Some(standard_deviation)
    }

    /// Does a step towards another whitening. Returns true if there is none left to do.
    fn refresh(&mut self) -> bool {
        // Rows that wait are reduced before rows are whitened together: a part of that with the reading
        // before, no row block between.
        let left = self.conditioner.until_output();
        match self.noise.steps_to_together() {
            Some(1) if left >= 2 => {
                self.store.begin_together();
            }
            Some(0) if left >= 3 && self.store.begin_together() => return false,
            _ => {}
        }
        match self.noise.refresh(&self.config, self.counters.blocks) {
            Refreshed::More => return false,
            Refreshed::Done => {}
            Refreshed::Together(variance) => {
                self.store.see_together();
                self.watch.set_variance(variance);
                return false;
            }
        }
        if let Some(by) = self.noise.take_shrink(self.counters.blocks) {
            self.store.scale(by);
        }
        true
    }

    fn refer_to(&mut self, parameters: Option<[T; N]>, standard_deviation: [T; N], knock_limit: T) {
        if let Some(parameters) = parameters {
            // One that a single check makes twice as good was no measure of the noise: with it goes what it
            // left.
            let before = self.reference.iter().flat_map(|r| &r.standard_deviation);
            if before.zip(&standard_deviation).any(|(before, now)| *now + *now < *before) {
                self.statistics = ChannelStatistics::default();
            }
            self.reference =
                Some(Reference { parameters, standard_deviation, noise_scale: T::ONE, knock_limit });
            if let Some(reference) = &self.reference {
                self.noise.begin_refresh(&self.config, reference, self.counters.blocks);
            }
        }
    }

    /// Does one step of a check of what has been absorbed, between readings. Returns the standard deviation
    /// of every parameter with the last step. A well-determined answer becomes the [`Reference`], with this
    /// `knock_limit`. Where not everything is retained it is [`Self::remember`] that checks.
    #[inline(never)]
    pub fn look(&mut self, knock_limit: T) -> Option<[T; N]> {
        if self.remembers() {
            return None;
        }
        let looking = self.looking;
        self.looking = match looking {
            Looking::Gathering if !self.store.gather(&mut self.gathering) => Looking::Gathering,
            Looking::Gathering if self.noise.counts() => {
                self.noise.begin_look(&self.gathering.whole, self.counters.blocks);
                Looking::Compensating
            }
            Looking::Gathering => {
                self.deviations = self.gathering.whole.standard_deviations();
                Looking::Referring
            }
            Looking::Compensating if !self.noise.compensate(false) => Looking::Compensating,
            Looking::Compensating => {
                if let Some(compensated) = self.noise.compensated(false) {
                    self.gathering.whole = compensated;
                }
                Looking::Measuring
            }
            Looking::Measuring => {
                self.deviations = self.gathering.whole.standard_deviations();
                Looking::Referring
            }
            Looking::Referring => {
                let parameters = self.gathering.whole.well_determined(&self.deviations);
                self.refer_to(parameters, self.deviations, knock_limit);
                if !self.noise.counts() {
                    return Some(self.end_look());
                }
                Looking::Refreshing
            }
            Looking::Refreshing if !self.refresh() => Looking::Refreshing,
            Looking::Refreshing => {
                return Some(self.end_look());
            }
        };
        None
    }

    /// Ends a check with nothing gathered, for the next one to begin: this step has more room than its first
    /// one.
    fn end_look(&mut self) -> [T; N] {
        (self.gathering.whole, self.looking) = (InformationFactor::EMPTY, Looking::Gathering);
        self.deviations
    }

    /// Starts anew with a factor that was absorbed before, what noise of the signals had added to its `RᵀR`,
    /// and what had happened until then. As after a gap, the filter is empty. Returns false where not
    /// everything is retained: then it has only started anew.
    #[inline(never)]
    pub fn restore(
        &mut self,
        factor: &InformationFactor<T, N>,
        gram: &Gram<T, BODY>,
        counters: &Counters,
        knock_limit: T,
    ) -> bool {
        self.reset();
        if !self.store.restore(factor) {
            return false;
        }
        self.counters = *counters;
        self.noise.restore(gram, counters.blocks);
        // The answer so far is the reference again, and rows are whitened by what follows from it.
        while self.look(knock_limit).is_none() {}
        self.noise.restored(&self.config);
        self.statistics = ChannelStatistics::NONE;
        true
    }

    /// Returns what happened so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Returns sums over the innovations since a reference was given, or since a check last halved one of its
    /// standard deviations.
    pub fn channel_statistics(&self) -> &ChannelStatistics<T> {
        &self.statistics
    }

    /// Gives the parameters that innovations are taken against, and that knocks are known by.
    pub fn set_reference(&mut self, reference: Reference<T, N>) {
        self.reference = Some(reference);
    }

    /// Returns the signals of the row block absorbed last, conditioned, in the axes of S, the known offset
    /// taken off.
    pub fn last_signals(&self) -> Option<&[T; S]> {
        self.last_signals.as_ref()
    }

    /// Returns the factor on each row of the block absorbed last: less than 1 where a knock has spoilt it.
    pub fn last_factors(&self) -> &[T; 6] {
        &self.last_factors
    }

    /// Returns the variance of the whitened, filtered noise per row: `row_every Σh²`. The residual sum of
    /// squares of the factor divided by this and by its degrees of freedom estimates how far the σ given are
    /// off.
    pub fn noise_gain(&self) -> T {
        T::from_u32(u32::from(self.config.row_every)) * self.conditioner.kernel().noise_gain()
    }

    /// Returns the number of readings under the filter.
    pub fn span(&self) -> usize {
        self.conditioner.span()
    }

    /// Returns the filter's kernel.
    pub fn kernel(&self) -> &Kernel<T, TAPS> {
        self.conditioner.kernel()
    }

    /// Starts anew with the same configuration.
    pub fn reset(&mut self) {
        self.model.restart(&self.config);
        self.conditioner.reset();
        self.store = M::Store::EMPTY;
        if let Some(plan) = &self.memory {
            self.store.set_memory(plan);
        }
        self.segment_waits = false;
        (self.gathering, self.looking) = (Gathering::EMPTY, Looking::Gathering);
        self.noise.reset(&self.config);
        self.last_time_ns = None;
        self.counters = Counters::NONE;
        self.reference = None;
        self.watch = Watch::new(&self.config.channel_sigma, self.conditioner.kernel().noise_gain());
        self.last_factors = [T::ONE; 6];
        self.statistics = ChannelStatistics::NONE;
        self.last_signals = None;
    }
}

/// Tells which step of a check is next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Looking {
    /// Levels are merged.
    Gathering,
    /// The part that noise of the signals adds is taken off.
    Compensating,
    /// Standard deviations are measured.
    Measuring,
    /// The answer becomes the reference.
    Referring,
    /// The whitening that follows from it is made.
    Refreshing,
}

/// Holds what was absorbed up to a moment, on its way to one factor.
#[derive(Clone, Copy, Debug)]
struct Snapshot<T: Scalar, S, const N: usize> {
    store: S,
    /// A segment that was not yet in the memory.
    segment: Option<InformationFactor<T, N>>,
    whole: InformationFactor<T, N>,
    step: u8,
}

/// Returns the wrench of a block less what `parameters` (10, or 16 with the offset) predict: N, N m.
pub fn residual<T: Scalar, const N: usize>(block: &RegressorBlock<T>, parameters: &[T; N]) -> [T; 6] {
    let mut e = block.wrench;
    for (column, phi) in block.columns.iter().zip(parameters) {
        for (e, a) in e.iter_mut().zip(column) {
            *e -= *a * *phi;
        }
    }
    for (e, offset) in e.iter_mut().zip(parameters.iter().skip(10)) {
        *e -= *offset;
    }
    e
}

#[cfg(test)]
mod tests;
