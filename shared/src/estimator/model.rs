//! The source of rows, and their destination: the two things in which the estimators of different bodies
//! differ.

use super::EstimatorConfig;
use super::noise::{BodyNoise, RowNoise};
use crate::Scalar;
use crate::calibration::Reading;
use crate::factor::{BodyCascade, Cascade, Gathering, Gram, InformationFactor};
use crate::forgetting::{Memory, Plan};
use crate::linear_algebra::ROOM;
use crate::regressor::{self, RegressorBlock, SIGNALS};
use crate::screening::{Rejection, Screen};

/// Makes rows: six rows of `N` columns from a reading, by way of `S` signals that are filtered alike.
///
/// Every coefficient and the wrench must be linear, with constant coefficients, in the signals; then one FIR
/// over the signals is the same FIR over the rows.
pub trait Model<T: Scalar, const N: usize, const S: usize>: Copy {
    /// Tells what the sensors said at one instant.
    type Reading;
    /// Tells what absorbs the rows.
    type Store: Store<T, N>;
    /// Tells what noise of the signals does to the rows.
    type Noise: RowNoise<T, N>;
    /// The model before it is set up.
    const UNUSED: Self;

    /// Starts anew with this configuration.
    fn restart(&mut self, config: &EstimatorConfig<T>);
    /// Returns when it was.
    fn time_ns(reading: &Self::Reading) -> u64;
    /// Returns why the reading may not be used, if so.
    ///
    /// # Errors
    /// The reason, with the channel.
    fn screen(&mut self, reading: &Self::Reading) -> Result<(), Rejection>;
    /// Returns the signals of a reading. Those that are differentiated are the last.
    fn signals(&mut self, config: &EstimatorConfig<T>, reading: &Self::Reading) -> [T; S];
    /// Returns what remains linear of calibration, done once per row block: conditioned signals in the axes
    /// of S, the known offset taken off. `None` while the rows are not yet to be trusted.
    fn rows(&mut self, config: &EstimatorConfig<T>, conditioned: &[T; S]) -> Option<[T; S]>;
    /// Returns the measured wrench less what the parameters predict: N, N m.
    fn residual(config: &EstimatorConfig<T>, model: &Self, signals: &[T; S], parameters: &[T; N]) -> [T; 6];
    /// Returns `Σ_j |a_j| sd_j` of channel c.
    fn spread(config: &EstimatorConfig<T>, model: &Self, signals: &[T; S], sd: &[T; N], c: usize) -> T;
    /// Absorbs the six rows, each multiplied by its weight and its factor, or by its factor and whitened
    /// together.
    fn absorb(
        config: &EstimatorConfig<T>,
        model: &Self,
        signals: &[T; S],
        weights: &[T; 6],
        factors: &[T; 6],
        store: &mut Self::Store,
        noise: &mut Self::Noise,
    );
}

/// Absorbs rows of `N` parameters and keeps `f32` from stagnating.
pub trait Store<T: Scalar, const N: usize>: Copy {
    /// The store of no rows.
    const EMPTY: Self;
    /// Tells whether it can keep a memory in place of everything.
    const FORGETS: bool;

    /// Returns one factor of everything absorbed.
    fn factor(&self) -> InformationFactor<T, N>;
    /// Does one step towards one factor of everything absorbed, using the store up. Returns true when
    /// `whole`, which began empty, is it.
    fn fold(&mut self, whole: &mut InformationFactor<T, N>, step: &mut u8) -> bool;
    /// Does one step towards a factor of everything absorbed. Returns true when `gathering` holds it.
    fn gather(&mut self, gathering: &mut Gathering<T, N>) -> bool;
    /// Begins with this factor instead of nothing. False, and nothing is done, where not everything is
    /// retained.
    fn restore(&mut self, factor: &InformationFactor<T, N>) -> bool;
    /// Keeps what this memory keeps, from now on.
    fn set_memory(&mut self, _plan: &Plan<T, N>) {}
    /// Returns the memory, if there is one.
    fn memory(&mut self) -> Option<&mut Memory<T, N>> {
        None
    }
    /// Returns whether a memory keeps what is absorbed.
    fn remembers(&self) -> bool {
        false
    }
    /// Returns what noise of the signals has added to it.
    fn memory_gram(&self) -> Option<Gram<T, ROOM>> {
        None
    }
    /// Does the rest of the work of absorbing, if there is any. Returns true if there was.
    fn settle(&mut self) -> bool {
        false
    }
    /// Multiplies all rows absorbed so far.
    fn scale(&mut self, _by: T) {}
    /// Receives that the rows of a block are whitened together from now on.
    fn see_together(&mut self) {}
    /// Does a part of [`Self::see_together`], a reading or two before it. Returns true if there was something
    /// to begin with.
    fn begin_together(&mut self) -> bool {
        false
    }
    /// Returns whether enough has been absorbed for a segment of it.
    fn segment_is_complete(&self) -> bool {
        false
    }
    /// Takes that out.
    fn take_segment(&mut self, _segment: &mut InformationFactor<T, N>) {}
}

impl<T: Scalar, const N: usize> Store<T, N> for BodyCascade<T, N> {
    const EMPTY: Self = Self::new();
    const FORGETS: bool = true;

    #[inline]
    fn factor(&self) -> InformationFactor<T, N> {
        Self::factor(self)
    }
    fn fold(&mut self, whole: &mut InformationFactor<T, N>, step: &mut u8) -> bool {
        Self::fold(self, whole, step)
    }
    fn restore(&mut self, factor: &InformationFactor<T, N>) -> bool {
        Self::restore(self, factor)
    }
    #[inline]
    fn gather(&mut self, gathering: &mut Gathering<T, N>) -> bool {
        Self::gather(self, gathering)
    }
    #[inline]
    fn set_memory(&mut self, plan: &Plan<T, N>) {
        Self::set_memory(self, plan);
    }
    #[inline]
    fn memory(&mut self) -> Option<&mut Memory<T, N>> {
        Self::memory(self)
    }
    fn memory_gram(&self) -> Option<Gram<T, ROOM>> {
        Self::memory_gram(self)
    }
    #[inline]
    fn settle(&mut self) -> bool {
        Self::settle(self)
    }
    fn scale(&mut self, by: T) {
        Self::scale(self, by);
    }
    fn see_together(&mut self) {
        Self::see_together(self);
    }
    fn begin_together(&mut self) -> bool {
        Self::begin_together(self)
    }
    #[inline]
    fn remembers(&self) -> bool {
        Self::remembers(self)
    }
    #[inline]
    fn segment_is_complete(&self) -> bool {
        Self::segment_is_complete(self)
    }
    #[inline]
    fn take_segment(&mut self, segment: &mut InformationFactor<T, N>) {
        Self::take_segment(self, segment);
    }
}

impl<T: Scalar, const N: usize, const UPPER: usize> Store<T, N> for Cascade<T, N, UPPER> {
    const EMPTY: Self = Self::new();
    const FORGETS: bool = false;

    #[inline]
    fn factor(&self) -> InformationFactor<T, N> {
        Self::factor(self)
    }
    fn fold(&mut self, whole: &mut InformationFactor<T, N>, step: &mut u8) -> bool {
        Self::fold(self, whole, step)
    }
    fn restore(&mut self, factor: &InformationFactor<T, N>) -> bool {
        Self::restore(self, factor)
    }
    #[inline]
    fn gather(&mut self, gathering: &mut Gathering<T, N>) -> bool {
        Self::gather(self, gathering)
    }
}

/// One body on the load cell, with one IMU: ten parameters, or sixteen with the wrench offset.
#[derive(Clone, Copy, Debug)]
pub struct OneBody<T: Scalar> {
    screen: Screen<T>,
}

impl<T: Scalar> OneBody<T> {
    /// The model with which an estimator is set up.
    pub const NEW: Self = Self { screen: Screen::UNUSED };

    /// Returns the filtered rows in the axes of S.
    fn block(config: &EstimatorConfig<T>, signals: &[T; SIGNALS]) -> RegressorBlock<T> {
        regressor::block(signals, &config.mounting.position)
    }
}

impl<T: Scalar, const N: usize> Model<T, N, SIGNALS> for OneBody<T> {
    type Reading = Reading<T>;
    type Store = BodyCascade<T, N>;
    type Noise = BodyNoise<T>;
    const UNUSED: Self = Self::NEW;

    fn restart(&mut self, config: &EstimatorConfig<T>) {
        self.screen = Screen::new(config.limits);
    }

    #[inline(always)]
    fn time_ns(reading: &Reading<T>) -> u64 {
        reading.time_ns
    }

    #[inline]
    fn screen(&mut self, reading: &Reading<T>) -> Result<(), Rejection> {
        self.screen.check(reading)
    }

    #[inline]
    fn signals(&mut self, config: &EstimatorConfig<T>, reading: &Reading<T>) -> [T; SIGNALS] {
        config.mounting.signals(reading)
    }

    #[inline]
    fn rows(&mut self, config: &EstimatorConfig<T>, conditioned: &[T; SIGNALS]) -> Option<[T; SIGNALS]> {
        let mut signals = config.mounting.mounted(conditioned);
        config.take_off_offset(&mut signals);
        Some(signals)
    }

    fn residual(
        config: &EstimatorConfig<T>,
        _: &Self,
        signals: &[T; SIGNALS],
        parameters: &[T; N],
    ) -> [T; 6] {
        super::residual(&Self::block(config, signals), parameters)
    }

    fn spread(config: &EstimatorConfig<T>, _: &Self, signals: &[T; SIGNALS], sd: &[T; N], c: usize) -> T {
        let mut sum = T::ZERO;
        for (column, sd) in Self::block(config, signals).columns.iter().zip(sd) {
            sum += column.get(c).map_or(T::ZERO, |a| a.abs()) * *sd;
        }
        sum + sd.get(10 + c).copied().unwrap_or(T::ZERO)
    }

    #[inline(always)]
    fn absorb(
        config: &EstimatorConfig<T>,
        _: &Self,
        signals: &[T; SIGNALS],
        weights: &[T; 6],
        factors: &[T; 6],
        store: &mut Self::Store,
        noise: &mut Self::Noise,
    ) {
        let lever_arm = &config.mounting.position;
        match noise.together() {
            Some((whitening, low_pass)) => {
                store.absorb_together(signals, lever_arm, factors, whitening, low_pass);
            }
            None => store.absorb(signals, lever_arm, weights),
        }
    }
}
