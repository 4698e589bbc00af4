//! The processing of every sample: calibration, alignment, estimator. No I/O, no panic, no heap, no f64.
//!
//! [`sample_path`] is the one entry; the release check searches for its symbol and walks what it can reach.
//! Frames are processed by [`crate::frame_path`].

use rigident_shared::alignment::{Aligner, AlignerConfig, ImuReading};
use rigident_shared::calibration::{GaugeCalibration, Reading};
use rigident_shared::consistency::Search;
#[cfg(feature = "storage")]
use rigident_shared::estimator::BODY;
use rigident_shared::estimator::{
    ChannelStatistics, ConfigError, Counters, Estimator, Outcome, TwoLinkReading,
};
#[cfg(feature = "links")]
use rigident_shared::estimator::{TwoLinkEstimator, two_links::PARAMETERS};
use rigident_shared::factor::{Gram, InformationFactor, Solver};
use rigident_shared::forgetting::{ImuNoise, MemoryConfig};
use rigident_shared::spatial::{AngularRate, SpecificForce};
use rigident_shared::wire::{FactorRow, MAX_NOISY_PARAMETERS, MAX_PARAMETERS};

use crate::place::{HasVariant, begin};
use crate::settings::SampleConfiguration;

/// Room for the filter: 0.1 s of averages at up to 640 Hz.
const TAPS: usize = 64;
/// Room for that of two links' signals, five times as many: 0.1 s at up to 320 Hz.
#[cfg(feature = "links")]
const LINK_TAPS: usize = 32;
/// Row blocks between two checks of the factor, for the stop rule and for what knocks are recognised by.
const LOOK_EVERY_BLOCKS: u16 = 50;
/// Two links with the wrench offset.
#[cfg(feature = "links")]
const WITH_OFFSET: usize = PARAMETERS + 6;

/// Tells what a sensor said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Words {
    /// Six gauge voltages and their capture time.
    Gauges {
        /// Capture time, ns.
        time_ns: u64,
        /// Voltages.
        volts: [f32; 6],
    },
    /// An IMU reading.
    Imu(ImuReading<f32>),
    /// A reading of the second link's IMU.
    SecondImu(ImuReading<f32>),
    /// A reading that needs no alignment: of a recording. Of one body only its base is examined.
    Aligned(TwoLinkReading<f32>),
}

/// The estimators of all models, and what is done with any of them. This table is the one place that lists
/// them.
macro_rules! models {
    ($d:tt $($(#[$meta:meta])* $variant:ident = $tag:literal: $estimator:ty;)*) => {
        /// The tag of the first variant is 0: what is not yet set up is all zero bits.
        #[derive(Clone)]
        #[repr(u8)]
        #[allow(clippy::large_enum_variant, reason = "no heap")]
        enum ModelEstimator {
            $($(#[$meta])* $variant($estimator) = $tag,)*
        }

        $(
            // The variant is what the trait is given.
            $(#[$meta])*
            const _: fn($estimator) -> ModelEstimator = ModelEstimator::$variant;
            $(#[$meta])*
            // SAFETY: the enum has `repr(u8)`, and this is its variant with this tag.
            unsafe impl HasVariant<$estimator, $tag> for ModelEstimator {
                const UNUSED: $estimator = <$estimator>::UNUSED;
            }
        )*

        /// Runs `$body` for the estimator of any model.
        macro_rules! any {
            ($d estimator:expr, $d name:ident => $d body:expr) => {
                match $d estimator {
                    $($(#[$meta])* ModelEstimator::$variant($d name) => $d body,)*
                }
            };
        }
    };
}

models! { $
    Ten = 0: Estimator<f32, 10, TAPS>;
    Sixteen = 1: Estimator<f32, 16, TAPS>;
    #[cfg(feature = "links")]
    Nineteen = 2: TwoLinkEstimator<f32, PARAMETERS, LINK_TAPS>;
    #[cfg(feature = "links")]
    TwentyFive = 3: TwoLinkEstimator<f32, WITH_OFFSET, LINK_TAPS>;
}

/// The state of the path.
#[derive(Clone)]
pub struct SamplePath {
    gauges: GaugeCalibration<f32>,
    aligner: Aligner<f32>,
    /// The aligner of the second link's IMU, if there is one.
    second: Option<Aligner<f32>>,
    /// The second aligner's last reading; that of the first is in `reading` from the beginning.
    other: Reading<f32>,
    /// Tells which of these two waits for the other's of the same instant.
    waits: [bool; 2],
    /// Halves that waited in vain.
    unmatched: u32,
    reading: TwoLinkReading<f32>,
    estimator: ModelEstimator,
    /// Tells whether readings are absorbed; else they are only aligned.
    absorbing: bool,
    stop: Option<StopLimits>,
    knock_limit: f32,
    /// Row blocks until the next check.
    until_look: u16,
    /// There is something for [`SamplePath::catch_up`].
    behind: bool,
    /// The last reading coincided with a step of a check.
    stepped: bool,
    stop_rule_met: bool,
}

/// The stop rule as standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopLimits {
    /// Largest standard deviation of each parameter; infinite for one that is not asked for.
    pub(crate) standard_deviation: [f32; MAX_PARAMETERS],
    /// A run is not ended before this many row blocks.
    pub(crate) minimum_blocks: u32,
}

// SAFETY: `Path` has `repr(u8)`, and this is its variant with the tag 1.
unsafe impl HasVariant<SamplePath, 1> for crate::Path {
    /// All bits are zero, so that it costs no flash to write it.
    const UNUSED: SamplePath = SamplePath {
        gauges: GaugeCalibration { matrix: [[0.0; 6]; 6] },
        aligner: Aligner::UNUSED,
        second: None,
        other: TwoLinkReading::ZERO.base,
        waits: [false; 2],
        unmatched: 0,
        reading: TwoLinkReading::ZERO,
        estimator: ModelEstimator::Ten(Estimator::UNUSED),
        absorbing: false,
        stop: None,
        knock_limit: 0.0,
        until_look: 0,
        behind: false,
        stepped: false,
        stop_rule_met: false,
    };
}

impl SamplePath {
    /// Returns whether a path can be made of this.
    ///
    /// # Errors
    /// [`ConfigError`] says why not.
    pub(crate) fn check(configuration: &SampleConfiguration) -> Result<(), ConfigError> {
        let SampleConfiguration { estimator, memory, .. } = configuration;
        let memory = memory.as_ref();
        match (&configuration.second, configuration.estimates_offset) {
            // What can be wrong does not depend on the offset.
            (None, _) => Estimator::<f32, 10, TAPS>::check(estimator, memory),
            #[cfg(feature = "links")]
            (Some(_), _) => TwoLinkEstimator::<f32, PARAMETERS, LINK_TAPS>::check(estimator, memory),
            #[cfg(not(feature = "links"))]
            (Some(_), _) => Ok(()),
        }
    }

    /// Returns a path that still has to be [`Self::set_up`]. Its estimator is written in place, for the fewer
    /// copies of it a stack has to hold the better.
    pub(crate) fn place(path: &mut crate::Path) -> Option<&mut Self> {
        if !matches!(path, crate::Path::Samples(_)) {
            begin::<_, Self, 1>(path);
        }
        match path {
            crate::Path::Samples(samples) => Some(samples),
            _ => None,
        }
    }

    #[inline(never)]
    pub(crate) fn set_up(&mut self, configuration: &SampleConfiguration) -> Result<(), ConfigError> {
        self.gauges = configuration.gauges;
        self.aligner.set_up(configuration.aligner);
        let second = configuration.second.as_ref();
        self.second = second.map(|(_, aligner)| Aligner::new(*aligner));
        (self.waits, self.unmatched) = ([false; 2], 0);
        (self.reading, self.absorbing) = (TwoLinkReading::ZERO, false);
        (self.stop, self.knock_limit) = (configuration.stop, configuration.knock_limit);
        (self.behind, self.stop_rule_met) = (false, false);
        let SampleConfiguration { estimator: config, memory, .. } = configuration;
        let estimator = &mut self.estimator;
        match (second, configuration.estimates_offset) {
            (None, false) => begin::<_, Estimator<f32, 10, TAPS>, 0>(estimator),
            (None, true) => begin::<_, Estimator<f32, 16, TAPS>, 1>(estimator),
            #[cfg(feature = "links")]
            (Some(_), false) => begin::<_, TwoLinkEstimator<f32, PARAMETERS, LINK_TAPS>, 2>(estimator),
            #[cfg(feature = "links")]
            (Some(_), true) => begin::<_, TwoLinkEstimator<f32, WITH_OFFSET, LINK_TAPS>, 3>(estimator),
            #[cfg(not(feature = "links"))]
            (Some(_), _) => {}
        }
        match (&mut self.estimator, second) {
            (ModelEstimator::Ten(e), _) => e.begin(config)?,
            (ModelEstimator::Sixteen(e), _) => e.begin(config)?,
            #[cfg(feature = "links")]
            (ModelEstimator::Nineteen(e), Some((model, _))) => e.set_up(config, model)?,
            #[cfg(feature = "links")]
            (ModelEstimator::TwentyFive(e), Some((model, _))) => e.set_up(config, model)?,
            #[cfg(feature = "links")]
            _ => {}
        }
        self.set_imu_noise(&configuration.imu_noise)?;
        if let Some(memory) = memory {
            self.set_memory(memory)?;
        }
        self.until_look = self.look_every();
        Ok(())
    }

    /// States the noise of the first IMU.
    #[inline(never)]
    fn set_imu_noise(&mut self, noise: &ImuNoise<f32>) -> Result<(), ConfigError> {
        any!(&mut self.estimator, e => e.set_imu_noise(noise))
    }

    /// Keeps what this memory keeps instead of everything.
    #[inline(never)]
    fn set_memory(&mut self, memory: &MemoryConfig<f32>) -> Result<(), ConfigError> {
        any!(&mut self.estimator, e => e.set_memory(memory))
    }

    /// Returns the number of row blocks between two checks: a memory is checked with each of its segments.
    fn look_every(&self) -> u16 {
        any!(&self.estimator, e => e.segment_blocks()).unwrap_or(LOOK_EVERY_BLOCKS)
    }

    pub(crate) fn absorb_from_now_on(&mut self, absorbing: bool) {
        self.absorbing = absorbing;
        if !absorbing {
            self.aligner.give_up_waiting();
            if let Some(second) = &mut self.second {
                second.give_up_waiting();
            }
        }
    }

    pub(crate) fn restart(&mut self) {
        any!(&mut self.estimator, e => e.reset());
        self.aligner.reset();
        if let Some(second) = &mut self.second {
            second.reset();
        }
        self.waits = [false; 2];
        (self.until_look, self.behind, self.stop_rule_met) = (self.look_every(), false, false);
    }

    #[inline(never)]
    fn push_gauges(&mut self, time_ns: u64, volts: &[f32; 6]) {
        let wrench = self.gauges.wrench(volts);
        self.aligner.push_wrench(time_ns, wrench);
        if let Some(second) = &mut self.second {
            second.push_wrench(time_ns, wrench);
        }
    }

    /// Returns whether readings are those of two links.
    pub(crate) fn has_two_links(&self) -> bool {
        match &self.estimator {
            ModelEstimator::Ten(_) | ModelEstimator::Sixteen(_) => false,
            #[cfg(feature = "links")]
            ModelEstimator::Nineteen(_) | ModelEstimator::TwentyFive(_) => true,
        }
    }

    /// Returns the reading that was taken last.
    #[inline]
    pub(crate) fn reading(&self) -> &TwoLinkReading<f32> {
        &self.reading
    }

    /// Returns whether [`sample_path`] without words has something to do.
    #[inline]
    pub(crate) fn has_more(&self) -> bool {
        match &self.second {
            None => self.aligner.is_ready(),
            Some(second) => self.may_join(second),
        }
    }

    #[inline(never)]
    fn may_join(&self, second: &Aligner<f32>) -> bool {
        let [base, other] = self.waits;
        (base || self.aligner.is_ready()) && (other || second.is_ready())
    }

    #[inline(never)]
    fn push_second(&mut self, reading: &ImuReading<f32>) {
        if let Some(second) = &mut self.second {
            second.push_imu(reading);
        }
    }

    #[inline(never)]
    fn take_joined(&mut self) -> Option<Outcome> {
        (self.has_more() && self.join()).then(|| self.absorb())
    }

    /// Takes one body's reading, made where it stays, and absorbs it.
    #[inline(always)]
    fn take_aligned(&mut self) -> Option<Outcome> {
        self.aligner.pop_into(&mut self.reading.base).then(|| self.absorb())
    }

    #[inline(never)]
    fn take(&mut self, reading: &TwoLinkReading<f32>) -> Outcome {
        self.reading = *reading;
        self.absorb()
    }

    /// Joins two aligners' readings of the same load-cell sample. Returns false while one of them is missing.
    fn join(&mut self) -> bool {
        let Some(second) = &mut self.second else { return false };
        let TwoLinkReading { base, specific_force, angular_rate, attitude } = &mut self.reading;
        loop {
            let [base_waits, other_waits] = self.waits;
            let base_is_there = base_waits || pop(&mut self.aligner, base);
            let both_are = base_is_there && (other_waits || pop(second, &mut self.other));
            if !both_are {
                self.waits = [base_is_there, other_waits];
                return false;
            }
            let (base_ns, other_ns) = (base.time_ns, self.other.time_ns);
            self.waits = [base_ns > other_ns, other_ns > base_ns];
            if base_ns == other_ns {
                (*specific_force, *angular_rate) = (self.other.specific_force, self.other.angular_rate);
                *attitude = TwoLinkReading::ZERO.attitude;
                return true;
            }
            self.unmatched = self.unmatched.saturating_add(1);
        }
    }

    #[inline(always)]
    fn absorb(&mut self) -> Outcome {
        let reading = &mut self.reading;
        if !self.absorbing {
            // The joint's attitude goes on all the same.
            match &mut self.estimator {
                ModelEstimator::Ten(_) | ModelEstimator::Sixteen(_) => {}
                #[cfg(feature = "links")]
                ModelEstimator::Nineteen(e) => e.follow(reading),
                #[cfg(feature = "links")]
                ModelEstimator::TwentyFive(e) => e.follow(reading),
            }
            return Outcome::Pending;
        }
        let outcome = match &mut self.estimator {
            ModelEstimator::Ten(e) => e.absorb(&reading.base),
            ModelEstimator::Sixteen(e) => e.absorb(&reading.base),
            #[cfg(feature = "links")]
            ModelEstimator::Nineteen(e) => {
                let outcome = e.absorb(reading);
                reading.attitude = e.model().attitude();
                outcome
            }
            #[cfg(feature = "links")]
            ModelEstimator::TwentyFive(e) => {
                let outcome = e.absorb(reading);
                reading.attitude = e.model().attitude();
                outcome
            }
        };
        self.look(outcome);
        outcome
    }

    /// Returns whether there is something for [`Self::catch_up`]. Asking forgets it.
    #[inline]
    pub(crate) fn take_behind(&mut self) -> bool {
        core::mem::take(&mut self.behind)
    }

    /// Returns whether the last reading coincided with a step of a check. Asking forgets it.
    #[inline]
    pub(crate) fn take_stepped(&mut self) -> bool {
        core::mem::take(&mut self.stepped)
    }

    /// Does one step of a check of the factor, with each of the readings that only wait in the filter after a
    /// row block.
    #[inline]
    fn look(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Absorbed if self.until_look > 0 => self.until_look -= 1,
            Outcome::Pending if any!(&mut self.estimator, e => e.settle()) => self.stepped = true,
            Outcome::Pending if self.until_look == 0 => self.step(),
            // Where every reading is a row block, none waits.
            Outcome::Absorbed if any!(&self.estimator, e => e.config().row_every <= 1) => self.step(),
            _ => {}
        }
    }

    #[inline(never)]
    fn step(&mut self) {
        self.stepped = true;
        if any!(&self.estimator, e => e.remembers()) {
            // A segment that the filter's gaps have delayed is waited for.
            self.behind = any!(&self.estimator, e => e.has_segment());
            self.until_look = if self.behind { self.look_every() } else { 1 };
            return;
        }
        let k = self.knock_limit;
        let met = any!(&mut self.estimator, e => e.look(k).map(|sd| within(&self.stop, &sd)));
        if let Some(met) = met {
            self.until_look = LOOK_EVERY_BLOCKS;
            self.stop_rule_met = met && self.may_stop();
            self.behind = self.stop_rule_met;
        }
    }

    fn may_stop(&self) -> bool {
        self.stop.is_some_and(|stop| self.counters().blocks >= stop.minimum_blocks)
    }

    /// Puts a complete segment into the memory, if not everything is retained: outside the path, for it takes
    /// as long as a solution. Returns true if every asked-for parameter had its asked-for uncertainty at the
    /// last check.
    pub(crate) fn catch_up(&mut self) -> bool {
        let k = self.knock_limit;
        let met = any!(&mut self.estimator, e => e.remember(k).map(|sd| within(&self.stop, &sd)));
        core::mem::take(&mut self.stop_rule_met) || (met.unwrap_or_default() && self.may_stop())
    }

    pub(crate) fn counters(&self) -> &Counters {
        any!(&self.estimator, e => e.counters())
    }

    pub(crate) fn statistics(&self) -> &ChannelStatistics<f32> {
        any!(&self.estimator, e => e.channel_statistics())
    }

    /// Returns the number of load-cell samples without neighbours of an IMU.
    pub(crate) fn unaligned(&self) -> u32 {
        let second = self.second.as_ref().map_or(0, Aligner::dropped);
        // What one aligner drops the other's half waits for in vain.
        self.aligner.dropped().max(second).max(self.unmatched)
    }

    /// Keeps a copy of everything absorbed so far.
    pub(crate) fn take_snapshot(&mut self) {
        any!(&mut self.estimator, e => e.take_snapshot());
    }

    /// Does one step towards the factor of the copy. Returns true when it is there.
    pub(crate) fn fold(&mut self) -> bool {
        any!(&mut self.estimator, e => e.fold())
    }

    /// Returns a row of the folded factor. `None` if there is no such row.
    pub(crate) fn row(&self, row: u8) -> Option<FactorRow> {
        any!(&self.estimator, e => row_of(e.folded(), e.gram(), row))
    }

    /// Returns the number of rows in the folded factor.
    #[cfg(feature = "storage")]
    pub(crate) fn folded_rows(&self) -> u32 {
        any!(&self.estimator, e => e.folded().rows())
    }

    /// Writes the numbers of that factor, then what noise of the signals has added to its `RᵀR`, upper
    /// triangle by rows: f32, little-endian. How many bytes; `None` if there is no room.
    #[cfg(feature = "storage")]
    pub(crate) fn write_factor(&self, out: &mut [u8]) -> Option<usize> {
        fn write<const N: usize>(
            factor: &InformationFactor<f32, N>,
            gram: Option<&Gram<f32, MAX_NOISY_PARAMETERS>>,
            out: &mut [u8],
        ) -> Option<usize> {
            let noisy = gram.iter().flat_map(|g| (0..BODY).flat_map(|i| g.row(i).take(BODY - i)));
            let mut length = 0;
            for number in factor.entries().chain(noisy) {
                let slot = out.get_mut(length..)?.first_chunk_mut()?;
                *slot = number.to_le_bytes();
                length += slot.len();
            }
            Some(length)
        }
        any!(&self.estimator, e => write(e.folded(), e.gram(), out))
    }

    /// Starts a path that is newly set up with a factor of the given number of rows that
    /// [`Self::write_factor`] has written, and what had happened until then. Returns false if the bytes are
    /// none of this model's.
    #[cfg(feature = "storage")]
    #[inline(never)]
    pub(crate) fn restore(&mut self, bytes: &[u8], rows: u32, counters: &Counters) -> bool {
        let k = self.knock_limit;
        let mut numbers = bytes.chunks_exact(4).filter_map(|b| b.try_into().ok()).map(f32::from_le_bytes);
        any!(&mut self.estimator, e => {
            let factor = e.folded().like(&mut numbers, rows);
            let mut gram = Gram::ZERO;
            gram.fill(&mut numbers);
            factor.is_some_and(|factor| e.restore(&factor, &gram, counters, k))
        })
    }

    /// Does one step towards the factor of the copy without what noise of the signals adds. Returns true when
    /// it is there.
    pub(crate) fn compensate(&mut self) -> bool {
        any!(&mut self.estimator, e => e.compensate())
    }

    /// Begins to solve that factor, and keeps it for the search where it is one body's. How many parameters
    /// it has.
    #[inline(never)]
    pub(crate) fn begin_solution(
        &self,
        solver: &mut Solver<f32, MAX_PARAMETERS>,
        search: &mut Search<f32>,
    ) -> usize {
        fn body<const N: usize>(
            factor: &InformationFactor<f32, N>,
            solver: &mut Solver<f32, MAX_PARAMETERS>,
            search: &mut Search<f32>,
        ) -> usize {
            search.load(factor);
            solver.begin(factor);
            N
        }
        match &self.estimator {
            ModelEstimator::Ten(e) => body(e.folded(), solver, search),
            ModelEstimator::Sixteen(e) => body(e.folded(), solver, search),
            #[cfg(feature = "links")]
            ModelEstimator::Nineteen(e) => {
                solver.begin(e.folded());
                PARAMETERS
            }
            #[cfg(feature = "links")]
            ModelEstimator::TwentyFive(e) => {
                solver.begin(e.folded());
                WITH_OFFSET
            }
        }
    }
}

/// Returns a row of a factor as it travels. `None` if there is no such row.
fn row_of<const N: usize>(
    factor: &InformationFactor<f32, N>,
    gram: Option<&Gram<f32, MAX_NOISY_PARAMETERS>>,
    row: u8,
) -> Option<FactorRow> {
    (usize::from(row) < N).then(|| FactorRow {
        row,
        parameters: N as u8,
        entries: factor.row(usize::from(row)).collect(),
        gram: gram.iter().flat_map(|gram| gram.row(usize::from(row))).take(N - usize::from(row)).collect(),
        residual_sum_of_squares: if row == 0 { factor.residual_sum_of_squares() } else { 0.0 },
        rows: if row == 0 { factor.rows() } else { 0 },
    })
}

/// Does [`Aligner::pop_into`] once for both aligners of two links.
#[inline(never)]
fn pop(aligner: &mut Aligner<f32>, reading: &mut Reading<f32>) -> bool {
    aligner.pop_into(reading)
}

/// Returns the settings of an aligner of the second IMU, from the first's.
pub(crate) fn second_aligner(first: &AlignerConfig, delay_ns: u32, period_ns: u32) -> AlignerConfig {
    AlignerConfig { imu_delay_ns: delay_ns, imu_period_ns: period_ns, ..*first }
}

/// Converts an IMU's words to a reading.
pub(crate) fn imu_reading(time_ns: u64, specific_force: [f32; 3], angular_rate: [f32; 3]) -> ImuReading<f32> {
    ImuReading {
        time_ns,
        specific_force: SpecificForce::from_array(specific_force),
        angular_rate: AngularRate::from_array(angular_rate),
    }
}

/// Returns whether every asked-for parameter has its asked-for uncertainty.
fn within(stop: &Option<StopLimits>, deviations: &[f32]) -> bool {
    let limits = stop.iter().flat_map(|stop| &stop.standard_deviation);
    deviations.iter().zip(limits).all(|(sd, limit)| *sd <= *limit)
}

/// Takes a sensor's words, if any, and the next reading that they completed through the estimator, if any: it
/// is then `SamplePath::reading`. Call it without words while there is more.
// SAFETY: the name is this function's own; no other symbol of the program has it.
#[unsafe(export_name = "rigident_sample_path")]
#[inline(never)]
pub fn sample_path(path: &mut SamplePath, words: Option<&Words>) -> Option<Outcome> {
    match words {
        Some(Words::Gauges { time_ns, volts }) => {
            #[cfg(feature = "plant-double")]
            crate::planted::double(volts[0]);
            #[cfg(feature = "plant-panic")]
            crate::planted::panic(volts, *time_ns as usize);
            path.push_gauges(*time_ns, volts);
        }
        Some(Words::Imu(reading)) => path.aligner.push_imu(reading),
        Some(Words::SecondImu(reading)) => path.push_second(reading),
        Some(Words::Aligned(reading)) => return Some(path.take(reading)),
        None => {}
    }
    if path.second.is_some() { path.take_joined() } else { path.take_aligned() }
}
